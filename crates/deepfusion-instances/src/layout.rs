//! Recognises the kind of a model from the shapes of its outputs.

use deepfusion_hint::{Hint, count_of};
use deepfusion_onnx::runtime::TensorInfo;

/// Pixels of the input that a cell of each of the three grids covers.
pub(crate) const STRIDES: [usize; 3] = [8, 16, 32];
/// Most rows of a model that has suppressed its candidates itself.
const MOST_FINAL_ROWS: usize = 1000;

/// Why a model's inputs and outputs are none that are known.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ShapeProblem {
    /// Several inputs, or none.
    #[error("{}, expected one picture", count_of(*found, "input"))]
    Inputs {
        /// How many.
        found: usize,
    },
    /// An input that is no picture.
    #[error("input `{}` is {}{}", input.name, sizes(&input.shape), if input.f32 { "" } else { ", no 32-bit float" })]
    Input {
        /// As the model describes it.
        input: TensorInfo,
    },
    /// An output of other numbers.
    #[error("output `{name}` is no 32-bit float")]
    OutputNumbers {
        /// Its name.
        name: String,
    },
    /// Outputs of no known kind of model.
    #[error("outputs {} of an input {}x{}", shapes(outputs), input[1], input[0])]
    Outputs {
        /// Height and width of the input.
        input: [usize; 2],
        /// The dimensions of each output.
        outputs: Vec<Vec<usize>>,
    },
    /// Outputs of another kind than those of the image before.
    #[error("the shapes of its outputs change from image to image")]
    Changing,
}

impl Hint for ShapeProblem {
    fn hint(&self) -> Option<String> {
        Some(
            "known are exports of one picture (1x3xHxW, f32) with the outputs of YOLO-seg (v5, v8 and later, with or without NMS), of YOLO boxes, \
             and of YOLOX"
                .into(),
        )
    }
}

/// Dimensions in a line, `?` for one that is left open.
fn sizes(shape: &[Option<usize>]) -> String {
    let size = |d: &Option<usize>| d.map_or("?".into(), |d| d.to_string());
    shape.iter().map(size).collect::<Vec<String>>().join("x")
}

/// The same of several arrays.
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
        // Depth, a classifier, a detector of another input's grid, one without classes, three heads.
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
