//! Of candidates that mean the same thing, the surest.

use crate::Candidate;

/// Keeps those that no surer one of the same class overlaps by more than `overlap` (area in common over area in all),
/// the surest first, `most` at most.
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
