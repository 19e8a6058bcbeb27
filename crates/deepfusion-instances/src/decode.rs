//! Decodes a model's output into candidates.

use crate::layout::STRIDES;
use crate::{Candidate, Kind, Layout};

/// The candidates with a score of at least `least`, in the order of the model. A candidate with numbers that are not finite is left out.
///
/// `input` is the height and width of the model's input, `values` the output in which [`Layout::of`] found the candidates.
#[must_use]
pub fn decode(layout: &Layout, input: [usize; 2], values: &[f32], least: f32) -> Vec<Candidate> {
    let count = layout.candidates;
    let fields = values.len() / count.max(1);
    let grid = match layout.kind {
        Kind::GridRows => cells(input),
        _ => Vec::new(),
    };
    let mut candidates = Vec::new();
    for i in 0..count {
        let field = |k: usize| match layout.kind {
            Kind::Columns => values[k * count + i],
            Kind::Rows | Kind::GridRows | Kind::Final => values[i * fields + k],
        };
        let found = match layout.kind {
            Kind::Final => (field(5) >= 0.0).then(|| (field(5) as usize, field(4), 6)),
            Kind::Columns => {
                best(&field, 4, layout.classes).map(|(c, s)| (c, s, 4 + layout.classes))
            }
            Kind::Rows | Kind::GridRows => best(&field, 5, layout.classes)
                .map(|(class, score)| (class, score * field(4), 5 + layout.classes)),
        };
        let Some((class, score, first)) = found.filter(|(_, score, _)| *score >= least) else {
            continue;
        };
        let place = [0, 1, 2, 3].map(&field);
        let bounds = match layout.kind {
            Kind::Final => place,
            Kind::Columns | Kind::Rows => corners(place),
            Kind::GridRows => {
                let ([x, y], stride) = grid[i];
                let [dx, dy, ln_w, ln_h] = place;
                corners([
                    (dx + x) * stride,
                    (dy + y) * stride,
                    ln_w.exp() * stride,
                    ln_h.exp() * stride,
                ])
            }
        };
        if bounds.iter().all(|b| b.is_finite()) {
            candidates.push(Candidate {
                bounds,
                score,
                class,
                coefficients: (first..fields).map(&field).collect(),
            });
        }
    }
    candidates
}

/// The class with the highest of the scores, which begin at field `first`.
fn best(field: &impl Fn(usize) -> f32, first: usize, classes: usize) -> Option<(usize, f32)> {
    (0..classes)
        .map(|class| (class, field(first + class)))
        .max_by(|a, b| a.1.total_cmp(&b.1))
}

fn corners([x, y, width, height]: [f32; 4]) -> [f32; 4] {
    [
        x - 0.5 * width,
        y - 0.5 * height,
        x + 0.5 * width,
        y + 0.5 * height,
    ]
}

/// Column and row of each cell of the three grids, and the stride of its grid; the finest grid comes first.
fn cells([height, width]: [usize; 2]) -> Vec<([f32; 2], f32)> {
    let grid = |stride: usize| {
        (0..height / stride).flat_map(move |y| {
            (0..width / stride).map(move |x| ([x as f32, y as f32], stride as f32))
        })
    };
    STRIDES.into_iter().flat_map(grid).collect()
}
