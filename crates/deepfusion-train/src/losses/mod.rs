//! The loss terms of SPEC 2, one file each, and their sum.

mod reprojection;
mod smoothness;
mod speed;

pub use reprojection::{ReprojectionOutput, View, reprojection};
pub use smoothness::smoothness;
pub use speed::{motion, speed, speed_weight};

/// The loss of a batch, term by term, as numbers.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LossTerms {
    /// The weighted sum that is minimised.
    pub total: f64,
    /// L_rp: photometric reprojection error, mean over scales.
    pub reprojection: f64,
    /// Edge-aware smoothness, mean over scales, weighted by 1/2ˢ but not by λ_s.
    pub smoothness: f64,
    /// L_speed in metres per pair, unweighted; the distance of PoseNet's motion from the measured one
    /// while that synthesises the views.
    pub speed: f64,
    /// Share of pixels that the warp finds in view, at full resolution.
    pub valid_share: f64,
    /// Share of pixels that the warped source explains best (the rest are masked).
    pub explained_share: f64,
}

impl LossTerms {
    /// Names and values, in the order of `log.csv`.
    #[must_use]
    pub fn named(&self) -> [(&'static str, f64); 6] {
        [
            ("total", self.total),
            ("reprojection", self.reprojection),
            ("smoothness", self.smoothness),
            ("speed", self.speed),
            ("valid_share", self.valid_share),
            ("explained_share", self.explained_share),
        ]
    }

    /// The first term that is not a finite number; the parts before the sum.
    #[must_use]
    pub fn not_finite(&self) -> Option<(&'static str, f64)> {
        let [total, parts @ ..] = self.named();
        parts
            .into_iter()
            .chain([total])
            .find(|(_, value)| !value.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_part_is_named_before_the_sum() {
        let mut terms = LossTerms::default();
        assert_eq!(terms.not_finite(), None);
        terms.total = f64::NAN;
        terms.speed = f64::INFINITY;
        assert_eq!(terms.not_finite(), Some(("speed", f64::INFINITY)));
    }
}
