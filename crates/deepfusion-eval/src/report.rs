use serde::{Deserialize, Serialize};

use crate::{Crop, GroundTruth, Intervals, Metrics, Points, Protocol, Sharpness};

/// The result of an evaluation. It serialises to JSON that scripts rely on: field names are fixed, parts that do not apply are absent, and
/// a number that does not exist is `null`, never NaN.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Number of images compared.
    pub n: usize,
    /// Number of frames in the split, if one was given. If fewer images were compared, this is not the split's benchmark.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expected: Option<usize>,
    /// The protocol.
    pub protocol: ProtocolSummary,
    /// Metrics of the unchanged predictions: the headline of a metric method.
    pub unscaled: Metrics,
    /// Metrics after each prediction was scaled by median(gt) / median(prediction).
    pub median_scaled: Metrics,
    /// Metrics after scaling by a fixed factor, if the protocol has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fixed_scaled: Option<FixedScaled>,
    /// How close the predictions are to true metres.
    pub scale: Scale,
    /// Unscaled metrics by distance; pooled over pixels.
    pub ranges: Vec<RangeBin>,
    /// Unscaled metrics of static pixels, if labels identify them; means over the images that have such pixels.
    #[serde(default, rename = "static", skip_serializing_if = "Option::is_none")]
    pub still: Option<Metrics>,
    /// Unscaled metrics of dynamic pixels, if labels identify them; means over the images that have such pixels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub moving: Option<Metrics>,
    /// Number of images with dynamic pixels.
    #[serde(default, skip_serializing_if = "none")]
    pub moving_images: usize,
    /// Share of the near ground truth (nearer than half the cap) whose prediction is at the far limit (0.9 of the cap or more), more than
    /// three times too far, or absent. Mean over images with near ground truth. Unscaled.
    #[serde(default)]
    pub hole_rate: Option<f64>,
    /// The same share for dynamic pixels, if labels identify them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hole_rate_moving: Option<f64>,
    /// Share of the ground truth without a prediction, if predictions may be absent; pooled over pixels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub missing_rate: Option<f64>,
    /// Sharpness of the predictions, if the ground truth is dense; median-scaled.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sharpness: Option<Sharpness>,
    /// Coverage and width of the intervals of a network with an uncertainty head.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intervals: Option<Intervals>,
    /// Distances of randomly drawn points from the truth, if asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points: Option<Points>,
    /// The mean-depth baseline on the same images: the mean depth of each pixel over the training scans, which a useful network must beat.
    #[serde(default, rename = "trivial", skip_serializing_if = "Option::is_none")]
    pub mean_depth_baseline: Option<MeanDepthRow>,
    /// Results of each kind of drive, if the recordings state their kind and there is more than one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub scenarios: Vec<ScenarioRow>,
    /// Names of the images without a pixel to compare, if any.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub skipped: Vec<String>,
    /// SHA-256 of the compared ground truth: two evaluations with the same value compared the same pixels of the same images with the same
    /// depths, in the same order.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub truth_sha256: Option<String>,
}

/// Whether a count is 0 and its field is omitted.
fn none(count: &usize) -> bool {
    *count == 0
}

impl Report {
    /// Adds the mean-depth baseline: `baseline` is the report of its predictions on the same images.
    #[must_use]
    pub fn with_mean_depth_baseline(mut self, baseline: &Report) -> Self {
        self.mean_depth_baseline = Some(MeanDepthRow {
            unscaled: baseline.unscaled,
            median_scaled: baseline.median_scaled,
        });
        self
    }
}

/// Results for one kind of drive, such as `garage`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ScenarioRow {
    /// The kind's name.
    pub name: String,
    /// Number of images compared.
    pub n: usize,
    /// Metrics of the unchanged predictions.
    pub unscaled: Metrics,
    /// Metrics after median scaling.
    pub median_scaled: Metrics,
    /// How close the predictions are to true metres.
    pub scale: Scale,
}

impl ScenarioRow {
    /// Makes the row of a scenario from the report on its images alone.
    #[must_use]
    pub fn new(name: impl Into<String>, report: &Report) -> Self {
        Self {
            name: name.into(),
            n: report.n,
            unscaled: report.unscaled,
            median_scaled: report.median_scaled,
            scale: report.scale,
        }
    }
}

/// The parts of a [`Protocol`] that are needed to repeat the comparison.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ProtocolSummary {
    /// The part of the image that was compared.
    pub crop: Crop,
    /// Ground truth at or beyond this depth was left out, in metres.
    pub cap_m: f64,
    /// Ground truth at or below this depth was left out, in metres.
    pub min_m: f64,
    /// The kind of depth in the ground truth.
    pub gt: GroundTruth,
}

impl From<&Protocol> for ProtocolSummary {
    fn from(protocol: &Protocol) -> Self {
        Self {
            crop: protocol.crop,
            cap_m: protocol.cap_m,
            min_m: protocol.min_m,
            gt: protocol.gt,
        }
    }
}

/// Metrics after a fixed factor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FixedScaled {
    /// The factor.
    pub factor: f64,
    /// The seven metrics.
    #[serde(flatten)]
    pub metrics: Metrics,
}

/// How close the predictions are to true metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Scale {
    /// Median over images of median(gt) / median(prediction): 1 for a metric method.
    pub median: f64,
    /// Standard deviation of these ratios divided by their median.
    pub std_rel: f64,
    /// Mean over images of ln(median(prediction) / median(gt)): above 0 if predictions are too far.
    pub bias: f64,
    /// 95 % interval of the bias, by bootstrap over images; `None` for a single image.
    pub bias_ci95: Option<[f64; 2]>,
}

/// Unscaled metrics of the pixels with a true depth in [`from_m`, `to_m`).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RangeBin {
    /// Lower limit of the true depth, in metres.
    pub from_m: u32,
    /// Upper limit of the true depth, in metres.
    pub to_m: u32,
    /// Number of pixels.
    pub n: usize,
    /// mean |gt − pred| / gt; `None` without pixels.
    pub abs_rel: Option<f64>,
    /// √mean (gt − pred)², in metres; `None` without pixels.
    pub rmse: Option<f64>,
}

/// The mean-depth baseline's scores on the same images.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MeanDepthRow {
    /// Metrics of the unchanged baseline.
    pub unscaled: Metrics,
    /// Metrics after median scaling.
    pub median_scaled: Metrics,
}
