//! Recognises the kind of a model from the shapes of its outputs.

/// Pixels of the input that a cell of each of the three grids covers.
pub(crate) const STRIDES: [usize; 3] = [8, 16, 32];
/// Most rows of a model that has suppressed its candidates itself.
const MOST_FINAL_ROWS: usize = 1000;

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
    /// A sentence that names the shapes found.
    pub fn of(input: [usize; 2], outputs: &[Vec<usize>]) -> Result<Self, String> {
        let found = || {
            let shape = |s: &Vec<usize>| {
                let sizes: Vec<String> = s.iter().map(ToString::to_string).collect();
                sizes.join("x")
            };
            let all: Vec<String> = outputs.iter().map(shape).collect();
            format!(
                "outputs {} of an input {}x{}",
                all.join(", "),
                input[1],
                input[0]
            )
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
            let found = of(outputs).unwrap_err();
            assert!(found.contains("640x640"), "{found}");
        }
    }
}
