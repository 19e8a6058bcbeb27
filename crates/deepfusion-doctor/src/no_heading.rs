//! Why images do not show where a camera heads.

use deepfusion_hint::{Hint, count_of};

/// Why images do not show where a camera heads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{} straight ahead, {needed} are needed", count_of(*straight, "pair"))]
#[non_exhaustive]
pub struct NoHeading {
    /// Pairs of them that were taken driving straight ahead.
    pub straight: usize,
    /// How many are needed.
    pub needed: usize,
}

impl Hint for NoHeading {
    fn hint(&self) -> Option<String> {
        Some(
            "give a drive with more of it straight ahead, or the camera's place on the vehicle"
                .into(),
        )
    }
}
