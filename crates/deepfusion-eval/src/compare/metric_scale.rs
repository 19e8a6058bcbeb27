//! How far a checkpoint's metres can be trusted, according to its evaluations.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::saved::SavedEvaluation;
use crate::{GroundTruth, PostProcess};

/// How far predictions may be off overall for their metres to be trusted: exp(|bias|) ≤ 1 ± this.
pub const TRUSTED_WITHIN: f64 = 0.1;

/// Images an evaluation needs for its interval to count. The bootstrap resamples the images it has; with only a few, its interval is too
/// narrow.
pub const LEAST_IMAGES: usize = 10;

/// Steps below which nothing is trusted. Over this many steps the speed loss, which teaches the metres, rises to its full weight
/// (`loss.speed_warmup_steps` of every preset). A network that has hardly learned predicts about the depth it started with, which may be
/// right on average by chance.
pub const LEAST_STEPS: usize = 500;

/// Whether metres can be relied on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// The whole interval lies within [`TRUSTED_WITHIN`] of 1.
    Trusted,
    /// Not measured, or the interval is too wide to decide.
    #[default]
    Open,
    /// The whole interval lies outside.
    Wrong,
}

/// The scale of a checkpoint's metres on recordings it was not trained on, as written to sidecars.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct MetricScale {
    /// Mean over images of ln(median(prediction) / median(truth)): above 0 if predictions are too far. `None` if nothing was measured.
    pub bias: Option<f64>,
    /// Its 95 % interval.
    pub ci95: Option<[f64; 2]>,
    /// The conclusion from the interval.
    pub verdict: Verdict,
}

impl MetricScale {
    /// The verdict on a network trained for `steps`, from its bias and the interval.
    #[must_use]
    pub fn judged(bias: f64, ci95: [f64; 2], steps: usize) -> Self {
        let [low, high] = ci95.map(f64::exp);
        let (least, most) = (1.0 - TRUSTED_WITHIN, 1.0 + TRUSTED_WITHIN);
        let verdict = if high < least || low > most {
            Verdict::Wrong
        } else if low >= least && high <= most && steps >= LEAST_STEPS {
            Verdict::Trusted
        } else {
            Verdict::Open
        };
        Self {
            bias: Some(bias),
            ci95: Some(ci95),
            verdict,
        }
    }

    /// From the evaluations saved in the run's folder. Counted are those of exactly this checkpoint (by the SHA-256 of its file) and, if
    /// the run learned several data sets, of the same data set. They must have the same correction for the focal length and the same
    /// post-processing, use the camera's own depth (not `velodyne`), and be on frames that training is known not to have seen. Of several
    /// evaluations, the bias is the mean over all their images, and the interval spans all of theirs: metres that are right in one place
    /// and wrong in another are not trusted.
    ///
    /// Files that cannot be read are ignored, and so are those of older versions that do not record what training saw.
    #[must_use]
    pub fn measured(
        run: &Path,
        checkpoint_sha256: &str,
        set: Option<&str>,
        focal_correction: bool,
        post_process: Option<PostProcess>,
        steps: usize,
    ) -> Self {
        let read = |path: &std::path::PathBuf| -> Option<SavedEvaluation> {
            serde_json::from_slice(&std::fs::read(path).ok()?).ok()
        };
        let counts = |saved: &SavedEvaluation| {
            saved.model.sha256 == checkpoint_sha256
                && saved.measured.set.as_deref() == set
                && saved.measured.focal_correction == focal_correction
                && saved.measured.post_process == post_process
                && saved.measured.held_out == Some(true)
                // Those depths are measured from the scanner, a quarter of a metre from the camera.
                && saved.report.protocol.gt != GroundTruth::Velodyne
                && saved.report.n >= LEAST_IMAGES
        };
        let (mut images, mut sum) = (0, 0.0);
        let mut span: Option<[f64; 2]> = None;
        for saved in SavedEvaluation::files(run)
            .iter()
            .filter_map(read)
            .filter(counts)
        {
            let scale = saved.report.scale;
            let Some([low, high]) = scale.bias_ci95 else {
                continue;
            };
            images += saved.report.n;
            sum += saved.report.n as f64 * scale.bias;
            span = Some(span.map_or([low, high], |[l, h]| [l.min(low), h.max(high)]));
        }
        match span {
            Some(ci95) => Self::judged(sum / images as f64, ci95, steps),
            None => Self::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_verdict_follows_from_the_whole_interval() {
        let verdict = |low: f64, high: f64| {
            let [low, high] = [low.ln(), high.ln()];
            MetricScale::judged((low + high) / 2.0, [low, high], LEAST_STEPS).verdict
        };
        assert_eq!(verdict(0.95, 1.05), Verdict::Trusted);
        assert_eq!(verdict(0.91, 1.09), Verdict::Trusted);
        // One end outside leaves it open.
        for (low, high) in [(0.85, 1.0), (1.0, 1.2), (0.5, 2.0), (1.05, 1.15)] {
            assert_eq!(verdict(low, high), Verdict::Open, "{low} {high}");
        }
        assert_eq!(verdict(1.11, 1.3), Verdict::Wrong);
        assert_eq!(verdict(0.4, 0.89), Verdict::Wrong);
        assert_eq!(MetricScale::default().verdict, Verdict::Open);
    }

    /// The depth that a network starts with may be right on average by chance, so it is not trusted. Wrong metres are reported at once.
    #[test]
    fn a_network_that_has_hardly_learned_is_not_trusted() {
        let right = MetricScale::judged(0.01, [-0.02, 0.04], 8);
        assert_eq!(right.verdict, Verdict::Open);
        let wrong = MetricScale::judged(0.5, [0.4, 0.6], 8);
        assert_eq!(wrong.verdict, Verdict::Wrong);
    }

    #[test]
    fn the_json_has_the_documented_fields() {
        let open = serde_json::to_value(MetricScale::default()).unwrap();
        let expected = serde_json::json!({"bias": null, "ci95": null, "verdict": "open"});
        assert_eq!(open, expected);
    }
}
