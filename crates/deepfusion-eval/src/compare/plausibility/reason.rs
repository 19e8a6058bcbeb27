//! Why a row is flagged.

use crate::PostProcess;
use crate::compare::evaluation::in_words;

/// Why a row is flagged.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FlagReason {
    /// A figure is infinite, NaN or below 0.
    #[error("{metric} is {value}")]
    OutOfRange {
        /// The metric's name.
        metric: &'static str,
        /// Its figure.
        value: f64,
    },
    /// A share is above 1.
    #[error("{metric} is {value}, but a share is at most 1")]
    AboveOne {
        /// The metric's name.
        metric: &'static str,
        /// Its figure.
        value: f64,
    },
    /// A narrower bound contains more pixels than a wider one.
    #[error(
        "{narrow} = {within} above {wide} = {within_wide}: pixels within the narrower bound are also within the wider one"
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
    /// RMSE log is lower than the shares δ allow.
    #[error("RMSE log = {rmse_log}, but these δ require at least {least:.3}")]
    RmseLog {
        /// The RMSE log of the row.
        rmse_log: f64,
        /// The least that the shares allow.
        least: f64,
    },
    /// RMSE log is lower than the shares δ allow if all images are alike.
    #[error(
        "RMSE log = {rmse_log}: with these δ, similar images have at least {alike:.3} (and any images at least {least:.3})"
    )]
    RmseLogOfAlike {
        /// The RMSE log of the row.
        rmse_log: f64,
        /// The least for images that are alike.
        alike: f64,
        /// The least for any images.
        least: f64,
    },
    /// Abs Rel is lower than the shares δ allow.
    #[error("Abs Rel = {abs_rel}, but these δ require at least {least:.3}")]
    AbsRel {
        /// The Abs Rel of the row.
        abs_rel: f64,
        /// The least that the shares allow.
        least: f64,
    },
    /// RMSE is higher than Sq Rel allows.
    #[error("RMSE = {rmse} m, but this Sq Rel allows at most {most:.3} m up to {cap_m} m")]
    Rmse {
        /// The RMSE of the row, in metres.
        rmse: f64,
        /// The most that Sq Rel allows, in metres.
        most: f64,
        /// The largest depth that counts, in metres.
        cap_m: f64,
    },
    /// Sq Rel is higher than Abs Rel allows.
    #[error("Sq Rel = {sq_rel} m, but this Abs Rel allows at most {most:.3} m up to {cap_m} m")]
    SqRel {
        /// The Sq Rel of the row, in metres.
        sq_rel: f64,
        /// The most that Abs Rel allows, in metres.
        most: f64,
        /// The largest depth that counts, in metres.
        cap_m: f64,
    },
    /// Another row has the same figures.
    #[error("every figure equals those of `{row}`")]
    Twin {
        /// The other row's name.
        row: String,
    },
    /// The checkpoint has changed since it was measured.
    #[error("{checkpoint} has changed since it was measured: evaluate again")]
    Outdated {
        /// The checkpoint's name in the run's folder.
        checkpoint: String,
    },
    /// Each image was predicted several times.
    #[error("{}: {}", in_words(*how), how.explained())]
    PostProcessed {
        /// The test-time augmentation.
        how: PostProcess,
    },
    /// Ground truth was left out.
    #[error(
        "{:.2} % of the ground truth has no prediction and is left out",
        100.0 * share
    )]
    NoPrediction {
        /// The share that was left out, 0 to 1.
        share: f64,
    },
    /// The camera was unknown, so that distances of points are along the z axis only.
    #[error("distances along z: the camera is unknown")]
    AlongZ,
    /// A note in the table of published figures on its row.
    #[error("{0}")]
    Published(String),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_against_figures_as_text() {
        let cap_m = 80.0;
        for (reason, text) in [
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
                "a1 is 88, but a share is at most 1",
            ),
            (
                FlagReason::Order {
                    narrow: "δ₁",
                    within: 0.977,
                    wide: "δ₂",
                    within_wide: 0.968,
                },
                "δ₁ = 0.977 above δ₂ = 0.968: pixels within the narrower bound are also within the wider one",
            ),
            (
                FlagReason::RmseLog {
                    rmse_log: 0.01,
                    least: 0.07809,
                },
                "RMSE log = 0.01, but these δ require at least 0.078",
            ),
            (
                FlagReason::RmseLogOfAlike {
                    rmse_log: 0.075,
                    alike: 0.1273,
                    least: 0.0381,
                },
                "RMSE log = 0.075: with these δ, similar images have at least 0.127 (and any images at least 0.038)",
            ),
            (
                FlagReason::AbsRel {
                    abs_rel: 0.01,
                    least: 0.0624,
                },
                "Abs Rel = 0.01, but these δ require at least 0.062",
            ),
            (
                FlagReason::Rmse {
                    rmse: 5.0,
                    most: 4.005,
                    cap_m,
                },
                "RMSE = 5 m, but this Sq Rel allows at most 4.005 m up to 80 m",
            ),
            (
                FlagReason::SqRel {
                    sq_rel: 9.0,
                    most: 8.04,
                    cap_m,
                },
                "Sq Rel = 9 m, but this Abs Rel allows at most 8.040 m up to 80 m",
            ),
            (
                FlagReason::Twin {
                    row: "DeepFusion, row 4".into(),
                },
                "every figure equals those of `DeepFusion, row 4`",
            ),
        ] {
            assert_eq!(reason.to_string(), text);
        }
    }

    #[test]
    fn notes_for_readers_as_text() {
        for (reason, text) in [
            (
                FlagReason::Outdated {
                    checkpoint: "best.safetensors".into(),
                },
                "best.safetensors has changed since it was measured: evaluate again",
            ),
            (
                FlagReason::PostProcessed {
                    how: PostProcess::Flip,
                },
                "post-processed: averaged with the mirrored image's prediction, which takes two passes of the network",
            ),
            (
                FlagReason::NoPrediction { share: 0.0123 },
                "1.23 % of the ground truth has no prediction and is left out",
            ),
            (
                FlagReason::AlongZ,
                "distances along z: the camera is unknown",
            ),
            (
                FlagReason::Published("read off a figure".into()),
                "read off a figure",
            ),
        ] {
            assert_eq!(reason.to_string(), text);
        }
    }
}
