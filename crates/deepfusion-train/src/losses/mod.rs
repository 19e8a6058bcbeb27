//! The loss terms (docs/concepts/losses.md), one file each, and their sum.

mod affine;
mod agreement;
mod depth;
mod explainability;
mod flow;
mod mean;
mod median;
mod moving;
mod reprojection;
mod smoothness;
mod speed;
mod uncertainty;

pub(crate) use affine::seen_in_both;
pub use affine::{affine_invariant, depth_seen_from_target};
pub use agreement::agreement;
pub(crate) use agreement::both_explain;
pub use depth::{DepthLoss, DepthTruth, depth, log_depth_error};
pub use explainability::{explainability, mean_reprojection};
pub use flow::{FlowView, flow, flow_view, visible};
pub use mean::share;
pub use moving::{RigidView, epipolar_distance, moving_pixels};
pub use reprojection::{ReprojectionOutput, View, reprojection};
pub use smoothness::smoothness;
pub use speed::{distance_weight, motion, speed, speed_weight};
pub use uncertainty::uncertainty;

/// The loss of a batch, term by term, as numbers.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LossTerms {
    /// The weighted sum that is minimised.
    pub total: f64,
    /// L_rp: photometric reprojection error, mean over scales.
    pub reprojection: f64,
    /// Edge-aware smoothness, mean over scales, weighted by 1/2ˢ but not by λ_s.
    pub smoothness: f64,
    /// L_speed in metres per pair, unweighted; if views are warped by the measured motion, the distance of PoseNet's motion from it.
    pub speed: f64,
    /// The affine invariant loss, unweighted.
    pub affine: f64,
    /// L_flow: photometric error both ways, consistency and smoothness, unweighted.
    pub flow: f64,
    /// Distance between the rigid flow and the optical flow where both explain the pixel, in pixels, unweighted.
    pub agreement: f64,
    /// L_depth of known depth, unweighted.
    pub depth: f64,
    /// L_nll of a network that predicts uncertainty, on known depth.
    pub uncertainty: f64,
    /// L_e: −ln of the explainability masks, unweighted.
    pub explainability: f64,
    /// Share of pixels that the warp keeps in view, at full resolution.
    pub valid_share: f64,
    /// Share of pixels that the warped source explains best (the rest are masked).
    pub explained_share: f64,
    /// Share of pixels taken out of the reprojection because they are dynamic.
    pub moving_share: f64,
}

impl LossTerms {
    /// Names and values, in the order of `log.csv`.
    #[must_use]
    pub fn named(&self) -> [(&'static str, f64); 13] {
        [
            ("total", self.total),
            ("reprojection", self.reprojection),
            ("smoothness", self.smoothness),
            ("speed", self.speed),
            ("affine", self.affine),
            ("flow", self.flow),
            ("agreement", self.agreement),
            ("depth", self.depth),
            ("uncertainty", self.uncertainty),
            ("explainability", self.explainability),
            ("valid_share", self.valid_share),
            ("explained_share", self.explained_share),
            ("moving_share", self.moving_share),
        ]
    }

    /// Sets the terms in the order of [`Self::named`]. Terms beyond the end of `values` stay as they are.
    pub fn set_from(&mut self, values: &[f64]) {
        let Self {
            total,
            reprojection,
            smoothness,
            speed,
            affine,
            flow,
            agreement,
            depth,
            uncertainty,
            explainability,
            valid_share,
            explained_share,
            moving_share,
        } = self;
        let terms = [
            total,
            reprojection,
            smoothness,
            speed,
            affine,
            flow,
            agreement,
            depth,
            uncertainty,
            explainability,
            valid_share,
            explained_share,
            moving_share,
        ];
        terms
            .into_iter()
            .zip(values)
            .for_each(|(term, value)| *term = *value);
    }

    /// Adds every term of another batch, times `weight`, to accumulate a weighted mean.
    pub fn add(&mut self, other: &Self, weight: f64) {
        self.total += weight * other.total;
        self.reprojection += weight * other.reprojection;
        self.smoothness += weight * other.smoothness;
        self.speed += weight * other.speed;
        self.affine += weight * other.affine;
        self.flow += weight * other.flow;
        self.agreement += weight * other.agreement;
        self.depth += weight * other.depth;
        self.uncertainty += weight * other.uncertainty;
        self.explainability += weight * other.explainability;
        self.valid_share += weight * other.valid_share;
        self.explained_share += weight * other.explained_share;
        self.moving_share += weight * other.moving_share;
    }

    /// The first term that is not finite; the parts come before the sum.
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
    fn terms_are_set_in_the_order_of_their_names() {
        let values: Vec<f64> = (0..13).map(f64::from).collect();
        let mut terms = LossTerms::default();
        terms.set_from(&values);
        assert_eq!(terms.named().map(|(_, value)| value).to_vec(), values);
    }

    #[test]
    fn a_non_finite_term_is_named_before_the_total() {
        let mut terms = LossTerms::default();
        assert_eq!(terms.not_finite(), None);
        terms.total = f64::NAN;
        terms.speed = f64::INFINITY;
        assert_eq!(terms.not_finite(), Some(("speed", f64::INFINITY)));
    }
}
