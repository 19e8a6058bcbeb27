//! What is missing from a verdict, and why.

use deepfusion_eval::verdict::{NoCertificate, Verdict};

/// Something missing from a verdict that the user may expect.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VerdictWarning {
    /// The scale is missing, since training may have seen the frames.
    #[error("whether training saw these frames is not known, so there is no scale certificate")]
    SeenNotKnown,
    /// The comparison with PoseNet's speed is missing, since PoseNet cannot be loaded.
    #[cfg(feature = "train")]
    #[error("PoseNet is not compared with the vehicle's speed: {0}")]
    NoPoseNet(#[source] deepfusion_train::Error),
}

impl VerdictWarning {
    /// The warning about a verdict without a scale because it is unknown what training saw.
    #[must_use]
    pub fn of(verdict: &Verdict) -> Option<Self> {
        let unknown = verdict.no_certificate == Some(NoCertificate::SeenNotKnown);
        unknown.then_some(Self::SeenNotKnown)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_unknown_training_frames_give_a_warning() {
        let of = |why| {
            let verdict = Verdict {
                no_certificate: Some(why),
                ..Verdict::default()
            };
            VerdictWarning::of(&verdict).map(|warning| warning.to_string())
        };
        assert_eq!(
            of(NoCertificate::SeenNotKnown).as_deref(),
            Some(
                "whether training saw these frames is not known, so there is no scale certificate"
            )
        );
        assert_eq!(of(NoCertificate::AllSeen), None);
    }
}
