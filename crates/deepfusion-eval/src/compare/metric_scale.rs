//! What a checkpoint's metres are worth, from what was measured of it.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::saved::SavedEvaluation;
use crate::{GroundTruth, PostProcess};

/// How far a prediction may be off as a whole, and its metres still be trusted: exp(|bias|) ≤ 1 ± this.
pub const TRUSTED_WITHIN: f64 = 0.1;

/// Images that an evaluation must have for its interval to count. The bootstrap draws from the images that there are: of a few
/// it knows only those, and its interval is too narrow.
pub const LEAST_IMAGES: usize = 10;

/// Steps below which nothing is trusted: over so many the speed loss, which the metres come from, rises to its full weight
/// (`loss.speed_warmup_steps` of every preset). A network that has hardly learned predicts about the depth that it starts with, which may be right on average.
pub const LEAST_STEPS: usize = 500;

/// Whether metres can be relied on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// The whole interval lies within [`TRUSTED_WITHIN`] of 1.
    Trusted,
    /// Not measured, or not well enough to say.
    #[default]
    Open,
    /// The whole interval lies outside.
    Wrong,
}

/// The scale of a checkpoint's metres on recordings that it has not learned from, as sidecars say it.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct MetricScale {
    /// Mean over images of ln(median(prediction) / median(truth)): above 0 where things are seen too far away. `None` where
    /// nothing was measured.
    pub bias: Option<f64>,
    /// Its 95 % interval.
    pub ci95: Option<[f64; 2]>,
    /// What follows.
    pub verdict: Verdict,
}

impl MetricScale {
    /// What a bias and its interval say of a network that has learned for `steps`.
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

    /// From the evaluations that a run's folder keeps: those of this very checkpoint (by the SHA-256 of its file), and of the same
    /// data set where it learned several. They must have the same correction for the focal length and the same post-processing, be of the camera's own depth (not
    /// `velodyne`), and be known to be of frames that training did not see. Of several the bias is over all their images, and the interval spans all of theirs: metres that hold in one
    /// place and not in another are not trusted.
    ///
    /// A file that cannot be read, or is of an older version that does not say what training saw, says nothing.
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
                // Those depths are the scanner's, a quarter of a metre from the camera's.
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
        // One end outside says that it may be either.
        for (low, high) in [(0.85, 1.0), (1.0, 1.2), (0.5, 2.0), (1.05, 1.15)] {
            assert_eq!(verdict(low, high), Verdict::Open, "{low} {high}");
        }
        assert_eq!(verdict(1.11, 1.3), Verdict::Wrong);
        assert_eq!(verdict(0.4, 0.89), Verdict::Wrong);
        assert_eq!(MetricScale::default().verdict, Verdict::Open);
    }

    /// The depth that a network starts with may be right on average: that is no trust. That it is wrong can be said at once.
    #[test]
    fn a_network_that_has_hardly_learned_is_not_trusted() {
        let right = MetricScale::judged(0.01, [-0.02, 0.04], 8);
        assert_eq!(right.verdict, Verdict::Open);
        let wrong = MetricScale::judged(0.5, [0.4, 0.6], 8);
        assert_eq!(wrong.verdict, Verdict::Wrong);
    }

    #[test]
    fn it_is_written_as_scripts_expect_it() {
        let open = serde_json::to_value(MetricScale::default()).unwrap();
        let expected = serde_json::json!({"bias": null, "ci95": null, "verdict": "open"});
        assert_eq!(open, expected);
    }
}
