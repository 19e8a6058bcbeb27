//! What there is to say against a row, or for its reader.

use crate::PostProcess;
use crate::compare::evaluation::in_words;

/// What there is to say against a row, or for its reader.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FlagReason {
    /// A figure is infinite, NaN or below 0.
    #[error("{metric} is {value}")]
    OutOfRange {
        /// The metric.
        metric: &'static str,
        /// Its figure.
        value: f64,
    },
    /// A share is above 1.
    #[error("{metric} is {value}, and a share is at most 1")]
    AboveOne {
        /// The metric.
        metric: &'static str,
        /// Its figure.
        value: f64,
    },
    /// More pixels are within a narrower bound than within a wider one.
    #[error(
        "{narrow} = {within} above {wide} = {within_wide}: whoever is within the narrower bound is within the wider"
    )]
    Order {
        /// The share of the narrower bound.
        narrow: &'static str,
        /// Its figure.
        within: f64,
        /// The share of the wider bound.
        wide: &'static str,
        /// Its figure.
        within_wide: f64,
    },
    /// RMSE log is lower than the shares allow.
    #[error("RMSE log = {rmse_log}, and these δ need at least {least:.3}")]
    RmseLog {
        /// Its figure.
        rmse_log: f64,
        /// What they need.
        least: f64,
    },
    /// RMSE log is lower than the shares allow of images alike.
    #[error(
        "RMSE log = {rmse_log}: images alike with these δ have at least {alike:.3} (and any at least {least:.3})"
    )]
    RmseLogOfAlike {
        /// Its figure.
        rmse_log: f64,
        /// What images alike have.
        alike: f64,
        /// What any have.
        least: f64,
    },
    /// Abs Rel is lower than the shares allow.
    #[error("Abs Rel = {abs_rel}, and these δ need at least {least:.3}")]
    AbsRel {
        /// Its figure.
        abs_rel: f64,
        /// What they need.
        least: f64,
    },
    /// RMSE is higher than Sq Rel allows.
    #[error("RMSE = {rmse} m, and this Sq Rel allows at most {most:.3} m up to {cap_m} m")]
    Rmse {
        /// Its figure, metres.
        rmse: f64,
        /// What that allows, metres.
        most: f64,
        /// The farthest depth that counts, metres.
        cap_m: f64,
    },
    /// Sq Rel is higher than Abs Rel allows.
    #[error("Sq Rel = {sq_rel} m, and this Abs Rel allows at most {most:.3} m up to {cap_m} m")]
    SqRel {
        /// Its figure, metres.
        sq_rel: f64,
        /// What that allows, metres.
        most: f64,
        /// The farthest depth that counts, metres.
        cap_m: f64,
    },
    /// Another row has the same figures.
    #[error("every figure equals those of `{row}`")]
    Twin {
        /// Its name.
        row: String,
    },
    /// The checkpoint that was measured is not there any more.
    #[error("{checkpoint} is another file by now than the one that was measured: evaluate again")]
    Outdated {
        /// Its name in the run's folder.
        checkpoint: String,
    },
    /// Each image was predicted several times.
    #[error("{}: {}", in_words(*how), how.explained())]
    PostProcessed {
        /// How.
        how: PostProcess,
    },
    /// Ground truth was left out.
    #[error(
        "{:.2} % of the ground truth has no prediction and is left out",
        100.0 * share
    )]
    NoPrediction {
        /// Which share of it.
        share: f64,
    },
    /// Points lie on the z axis alone.
    #[error("distances along z: the camera was not known")]
    AlongZ,
    /// What a table of published figures says of its row.
    #[error("{0}")]
    Published(String),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_said_against_figures() {
        let cap_m = 80.0;
        for (reason, said) in [
            (
                FlagReason::OutOfRange {
                    metric: "abs_rel",
                    value: f64::NAN,
                },
                "abs_rel is NaN",
            ),
            (
                FlagReason::AboveOne {
                    metric: "a1",
                    value: 88.0,
                },
                "a1 is 88, and a share is at most 1",
            ),
            (
                FlagReason::Order {
                    narrow: "δ₁",
                    within: 0.977,
                    wide: "δ₂",
                    within_wide: 0.968,
                },
                "δ₁ = 0.977 above δ₂ = 0.968: whoever is within the narrower bound is within the wider",
            ),
            (
                FlagReason::RmseLog {
                    rmse_log: 0.01,
                    least: 0.07809,
                },
                "RMSE log = 0.01, and these δ need at least 0.078",
            ),
            (
                FlagReason::RmseLogOfAlike {
                    rmse_log: 0.075,
                    alike: 0.1273,
                    least: 0.0381,
                },
                "RMSE log = 0.075: images alike with these δ have at least 0.127 (and any at least 0.038)",
            ),
            (
                FlagReason::AbsRel {
                    abs_rel: 0.01,
                    least: 0.0624,
                },
                "Abs Rel = 0.01, and these δ need at least 0.062",
            ),
            (
                FlagReason::Rmse {
                    rmse: 5.0,
                    most: 4.005,
                    cap_m,
                },
                "RMSE = 5 m, and this Sq Rel allows at most 4.005 m up to 80 m",
            ),
            (
                FlagReason::SqRel {
                    sq_rel: 9.0,
                    most: 8.04,
                    cap_m,
                },
                "Sq Rel = 9 m, and this Abs Rel allows at most 8.040 m up to 80 m",
            ),
            (
                FlagReason::Twin {
                    row: "DeepFusion, row 4".into(),
                },
                "every figure equals those of `DeepFusion, row 4`",
            ),
        ] {
            assert_eq!(reason.to_string(), said);
        }
    }

    #[test]
    fn what_a_reader_must_know_is_said() {
        for (reason, said) in [
            (
                FlagReason::Outdated {
                    checkpoint: "best.safetensors".into(),
                },
                "best.safetensors is another file by now than the one that was measured: evaluate again",
            ),
            (
                FlagReason::PostProcessed {
                    how: PostProcess::Flip,
                },
                "post-processed: the mean with the mirrored image's prediction, which takes two passes of the network",
            ),
            (
                FlagReason::NoPrediction { share: 0.0123 },
                "1.23 % of the ground truth has no prediction and is left out",
            ),
            (
                FlagReason::AlongZ,
                "distances along z: the camera was not known",
            ),
            (
                FlagReason::Published("read off a figure".into()),
                "read off a figure",
            ),
        ] {
            assert_eq!(reason.to_string(), said);
        }
    }
}
