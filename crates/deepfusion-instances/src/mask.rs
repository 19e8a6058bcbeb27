//! Masks as weighted sums of a model's prototypes (as in YOLACT).

use std::ops::Range;

use crate::{Candidate, Letterbox};

/// A model's mask prototypes, which cover its whole input.
#[derive(Debug, Clone, Copy)]
pub struct Prototypes<'a> {
    /// Number, height and width.
    pub shape: [usize; 3],
    /// The values, row by row.
    pub values: &'a [f32],
}

/// The pixels of one instance.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Mask {
    /// For each run of pixels its row, its first column, and the column after its last; from the top row down.
    pub runs: Vec<[u32; 3]>,
}

impl Mask {
    /// Number of pixels.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.runs
            .iter()
            .map(|[_, from, to]| (to - from) as usize)
            .sum()
    }

    /// The pixels of an image of `size` (width, height) with centres in `bounds` for which `inside` is true.
    fn within(bounds: [f32; 4], size: [usize; 2], inside: impl Fn(f32, f32) -> bool) -> Self {
        let [left, top, right, bottom] = bounds;
        let pixels = |low: f32, high: f32, size: usize| {
            let first = (low - 0.5).ceil().clamp(0.0, size as f32) as u32;
            let after = (high - 0.5).ceil().clamp(0.0, size as f32) as u32;
            first..after.max(first)
        };
        let mut runs = Vec::new();
        for v in pixels(top, bottom, size[1]) {
            let mut open: Option<u32> = None;
            let columns = pixels(left, right, size[0]);
            for u in columns.clone() {
                let seen = inside(u as f32 + 0.5, v as f32 + 0.5);
                match (seen, open) {
                    (true, None) => open = Some(u),
                    (false, Some(from)) => {
                        runs.push([v, from, u]);
                        open = None;
                    }
                    _ => {}
                }
            }
            if let Some(from) = open {
                runs.push([v, from, columns.end]);
            }
        }
        Self { runs }
    }

    /// All pixels of a box.
    #[must_use]
    pub fn of_box(bounds: [f32; 4], size: [usize; 2]) -> Self {
        Self::within(bounds, size, |_, _| true)
    }
}

impl Prototypes<'_> {
    /// The mask of a candidate: the pixels in the candidate's box where the weighted sum of the prototypes is above 0. It is for an image
    /// of `size` (width, height) with the same content as the letterbox's image.
    #[must_use]
    pub fn mask(&self, candidate: &Candidate, letterbox: &Letterbox, size: [usize; 2]) -> Mask {
        let [count, height, width] = self.shape;
        let plane = height * width;
        let cell = [
            letterbox.input[0] as f32 / width.max(1) as f32,
            letterbox.input[1] as f32 / height.max(1) as f32,
        ];
        // Sum only the part of the prototypes inside the box, and one cell around it for interpolation.
        let [left, top, right, bottom] = candidate.bounds;
        let range = |low: f32, high: f32, cell: f32, size: usize| {
            let first = (low / cell - 1.5).floor().clamp(0.0, size as f32) as usize;
            let last = (high / cell + 1.5).ceil().clamp(0.0, size as f32) as usize;
            first..last.max(first)
        };
        let (columns, rows) = (
            range(left, right, cell[0], width),
            range(top, bottom, cell[1], height),
        );
        if columns.is_empty() || rows.is_empty() || count != candidate.coefficients.len() {
            return Mask::default();
        }
        let mut sums = vec![0.0f32; rows.len() * columns.len()];
        for (weight, prototype) in candidate
            .coefficients
            .iter()
            .zip(self.values.chunks_exact(plane))
        {
            for (row, out) in rows.clone().zip(sums.chunks_exact_mut(columns.len())) {
                let from = &prototype[row * width + columns.start..row * width + columns.end];
                out.iter_mut()
                    .zip(from)
                    .for_each(|(sum, value)| *sum += weight * value);
            }
        }
        // Bilinear, with cell centres at a half. Cells outside the image contain nothing and are not used.
        let of_image = [0, 1].map(|i| letterbox.cells_of_image(i, cell[i]));
        let at = |place: f32, range: &Range<usize>, [first, last]: [f32; 2]| {
            let p = (place - 0.5).max(first).min(last) - range.start as f32;
            let p = p.clamp(0.0, (range.len() - 1) as f32);
            let low = (p as usize).min(range.len().saturating_sub(2));
            (low, (low + 1).min(range.len() - 1), p - low as f32)
        };
        let scale = [0, 1].map(|i| letterbox.image[i] as f32 / size[i].max(1) as f32);
        let inside = |x: f32, y: f32| {
            let [x, y] = letterbox.to_input([x * scale[0], y * scale[1]]);
            let (x0, x1, fx) = at(x / cell[0], &columns, of_image[0]);
            let (y0, y1, fy) = at(y / cell[1], &rows, of_image[1]);
            let value = |x: usize, y: usize| sums[y * columns.len() + x];
            let upper = value(x0, y0) + (value(x1, y0) - value(x0, y0)) * fx;
            let lower = value(x0, y1) + (value(x1, y1) - value(x0, y1)) * fx;
            upper + (lower - upper) * fy > 0.0
        };
        Mask::within(in_size(candidate.bounds, letterbox, size), size, inside)
    }
}

/// A candidate's box, clipped to an image of `size` (width, height) with the same content as the letterbox's image.
#[must_use]
pub fn in_size(bounds: [f32; 4], letterbox: &Letterbox, size: [usize; 2]) -> [f32; 4] {
    let [left, top] = letterbox.to_image([bounds[0], bounds[1]]);
    let [right, bottom] = letterbox.to_image([bounds[2], bounds[3]]);
    let scale = [0, 1].map(|i| size[i] as f32 / letterbox.image[i].max(1) as f32);
    let inside = |place: f32, i: usize| (place * scale[i]).clamp(0.0, size[i] as f32);
    [
        inside(left, 0),
        inside(top, 1),
        inside(right, 0),
        inside(bottom, 1),
    ]
}
