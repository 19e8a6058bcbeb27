//! Non-maximum suppression.

use crate::Candidate;

/// Drops candidates that a better one of the same class overlaps by more than `overlap` (intersection over union).
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
