//! Recognises the kind of a model from the shapes of its outputs.

use deepfusion_hint::{Hint, count_of};
use deepfusion_onnx::runtime::TensorInfo;

/// Strides of the three grids: pixels of the input per cell.
pub(crate) const STRIDES: [usize; 3] = [8, 16, 32];
/// Greatest number of rows of a model that suppresses its candidates itself.
const MOST_FINAL_ROWS: usize = 1000;

/// Why a model's inputs and outputs match no known kind of model.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ShapeProblem {
    /// The model has several inputs, or none.
    #[error("{}, expected one", count_of(*found, "input"))]
    Inputs {
        /// Number of inputs.
        found: usize,
    },
    /// The input is not one image.
    #[error("input `{}` is {}{}, expected 1x3xHxW of 32-bit floats", input.name, sizes(&input.shape), if input.f32 { "" } else { " of another type" })]
    Input {
        /// The input, as the model describes it.
        input: TensorInfo,
    },
    /// An output is not of 32-bit floats.
    #[error("output `{name}` is not of 32-bit floats")]
    OutputNumbers {
        /// Name of the output.
        name: String,
    },
    /// The shapes of the outputs match no known kind of model.
    #[error("outputs {} for an input of {}x{}", shapes(outputs), input[1], input[0])]
    Outputs {
        /// Height and width of the input.
        input: [usize; 2],
        /// The dimensions of each output.
        outputs: Vec<Vec<usize>>,
    },
    /// The outputs have another layout than those of the previous image.
    #[error("the shapes of the outputs change from image to image")]
    Changing,
}

impl Hint for ShapeProblem {
    fn hint(&self) -> Option<String> {
        Some(
            "export a model for one image (1x3xHxW, f32) with the outputs of YOLO-seg (v5, v8 and later, with or without NMS), YOLO boxes or YOLOX"
                .into(),
        )
    }
}

/// Dimensions joined by `x`; `?` for one that the model leaves open.
fn sizes(shape: &[Option<usize>]) -> String {
    let size = |d: &Option<usize>| d.map_or("?".into(), |d| d.to_string());
    shape.iter().map(size).collect::<Vec<String>>().join("x")
}

/// The dimensions of several arrays.
fn shapes(all: &[Vec<usize>]) -> String {
    let shape = |shape: &Vec<usize>| {
        let open: Vec<_> = shape.iter().copied().map(Some).collect();
        sizes(&open)
    };
    all.iter().map(shape).collect::<Vec<String>>().join(", ")
}

/// A model's output format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// One column per candidate: x, y, width, height, a score per class, coefficients (YOLOv8 and later).
    Columns,
    /// One row per candidate: x, y, width, height, objectness, a score per class, coefficients (YOLOv5, YOLOv7).
    Rows,
    /// As [`Self::Rows`], with positions and sizes relative to the grid's cells (YOLOX).
    GridRows,
    /// One row per candidate after suppression: left, top, right, bottom, score, class, coefficients (YOLOv10, YOLO26,
    /// exports with NMS).
    Final,
}

/// The meaning of a model's outputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// The output format.
    pub kind: Kind,
    /// Number of candidates.
    pub candidates: usize,
    /// Number of classes; 0 if unknown.
    pub classes: usize,
    /// Number, height and width of the mask prototypes; `None` if the model outputs boxes only.
    pub prototypes: Option<[usize; 3]>,
}

impl Layout {
    /// The layout of a model with an input of this height and width.
    ///
    /// # Errors
    /// [`ShapeProblem::Outputs`] with the shapes found.
    pub fn of(input: [usize; 2], outputs: &[Vec<usize>]) -> Result<Self, ShapeProblem> {
        let found = || ShapeProblem::Outputs {
            input,
            outputs: outputs.to_vec(),
        };
        let prototypes = outputs.iter().find_map(|shape| match shape[..] {
            [1, count, height, width] => Some([count, height, width]),
            _ => None,
        });
        let candidates = outputs.iter().find_map(|shape| match shape[..] {
            [1, a, b] => Some([a, b]),
            _ => None,
        });
        let most = 1 + usize::from(prototypes.is_some());
        let [a, b] = candidates
            .filter(|_| outputs.len() == most)
            .ok_or_else(found)?;
        let coefficients = prototypes.map_or(0, |[count, ..]| count);
        let cells: usize = STRIDES
            .iter()
            .map(|stride| (input[0] / stride) * (input[1] / stride))
            .sum();
        let (kind, candidates, fields, fixed) = if b == cells {
            (Kind::Columns, b, a, 4)
        } else if a == cells {
            (Kind::GridRows, a, b, 5)
        } else if a == 3 * cells {
            (Kind::Rows, a, b, 5)
        } else if b == 6 + coefficients && a <= MOST_FINAL_ROWS {
            (Kind::Final, a, b, 6)
        } else {
            return Err(found());
        };
        let classes = fields.checked_sub(fixed + coefficients).ok_or_else(found)?;
        if kind != Kind::Final && classes == 0 {
            return Err(found());
        }
        Ok(Self {
            kind,
            candidates,
            classes,
            prototypes,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_follow_from_shapes() {
        let of = |outputs: &[&[usize]]| {
            let outputs: Vec<Vec<usize>> = outputs.iter().map(|s| s.to_vec()).collect();
            Layout::of([640, 640], &outputs)
        };
        let layout = |kind, candidates, classes, prototypes| Layout {
            kind,
            candidates,
            classes,
            prototypes,
        };
        let masks = Some([32, 160, 160]);
        let protos: &[usize] = &[1, 32, 160, 160];
        let cases: [(&[&[usize]], Layout); 6] = [
            (
                &[&[1, 116, 8400], protos],
                layout(Kind::Columns, 8400, 80, masks),
            ),
            (&[&[1, 84, 8400]], layout(Kind::Columns, 8400, 80, None)),
            (
                &[&[1, 25200, 117], protos],
                layout(Kind::Rows, 25200, 80, masks),
            ),
            (&[&[1, 8400, 85]], layout(Kind::GridRows, 8400, 80, None)),
            (&[protos, &[1, 300, 38]], layout(Kind::Final, 300, 0, masks)),
            (&[&[1, 300, 6]], layout(Kind::Final, 300, 0, None)),
        ];
        for (outputs, expected) in cases {
            assert_eq!(of(outputs), Ok(expected));
        }
        // Depth, a classifier, a detector for another input size, one without classes, one with three heads, no outputs.
        let strangers: [&[&[usize]]; 6] = [
            &[&[1, 1, 640, 640]],
            &[&[1, 1000]],
            &[&[1, 84, 2100]],
            &[&[1, 4, 8400]],
            &[&[1, 255, 80, 80], &[1, 255, 40, 40], &[1, 255, 20, 20]],
            &[],
        ];
        for outputs in strangers {
            let found = of(outputs).unwrap_err().to_string();
            assert!(found.contains("640x640"), "{found}");
        }
    }
}
