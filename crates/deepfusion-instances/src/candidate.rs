//! Boxes proposed by a model, and non-maximum suppression among them.

/// A box proposed by a model, in pixels of the model's input.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Left, top, right, bottom.
    pub bounds: [f32; 4],
    /// Score, 0 to 1.
    pub score: f32,
    /// Index of the class.
    pub class: usize,
    /// Weights of the mask prototypes; empty if the model outputs boxes only.
    pub coefficients: Vec<f32>,
}

impl Candidate {
    /// Intersection over union, 0 to 1.
    #[must_use]
    pub fn overlap(&self, other: &Self) -> f32 {
        let [l, t, r, b] = self.bounds;
        let [ol, ot, or, ob] = other.bounds;
        let common = (r.min(or) - l.max(ol)).max(0.0) * (b.min(ob) - t.max(ot)).max(0.0);
        let all = (r - l) * (b - t) + (or - ol) * (ob - ot) - common;
        if all > 0.0 { common / all } else { 0.0 }
    }
}

/// Drops each candidate that a better one of the same class overlaps by more than `overlap` (intersection over union).
/// The result is sorted by descending score and has at most `most` entries.
#[must_use]
pub fn suppress(mut candidates: Vec<Candidate>, overlap: f32, most: usize) -> Vec<Candidate> {
    candidates.sort_by(|a, b| b.score.total_cmp(&a.score));
    let mut kept: Vec<Candidate> = Vec::new();
    for candidate in candidates {
        if kept.len() == most {
            break;
        }
        let same = |k: &Candidate| k.class == candidate.class && k.overlap(&candidate) > overlap;
        if !kept.iter().any(same) {
            kept.push(candidate);
        }
    }
    kept
}
