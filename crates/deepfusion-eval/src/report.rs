use serde::{Deserialize, Serialize};

use crate::{Crop, GroundTruth, Intervals, Metrics, Points, Protocol, Sharpness};

/// What an evaluation says. Serialises to the JSON that scripts rely on: field names are fixed, parts that do not apply
/// are absent, and a number that does not exist is `null`, never NaN.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// How many images were compared.
    pub n: usize,
    /// How many frames the split lists that was asked for, where one was; below it, this is another benchmark than the
    /// split's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expected: Option<usize>,
    /// How.
    pub protocol: ProtocolSummary,
    /// Metrics of the predictions as they are: the headline of a metric method.
    pub unscaled: Metrics,
    /// Metrics after each prediction was scaled by median(gt) / median(prediction).
    pub median_scaled: Metrics,
    /// Metrics after a fixed factor, where the protocol asks for one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fixed_scaled: Option<FixedScaled>,
    /// How metric the predictions are.
    pub scale: Scale,
    /// Unscaled, by distance; pooled over pixels.
    pub ranges: Vec<RangeBin>,
    /// Unscaled metrics of static pixels, where labels say which; means over the images that have such pixels.
    #[serde(default, rename = "static", skip_serializing_if = "Option::is_none")]
    pub still: Option<Metrics>,
    /// Unscaled metrics of dynamic pixels, where labels say which; means over the images that have some.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub moving: Option<Metrics>,
    /// How many images these are.
    #[serde(default, skip_serializing_if = "none")]
    pub moving_images: usize,
    /// Share of the near ground truth (nearer than half the cap) whose prediction is at the far limit (0.9 of the cap
    /// or more), more than three times too far, or absent; the mean over images with near ground truth. Unscaled.
    #[serde(default)]
    pub hole_rate: Option<f64>,
    /// The same of dynamic pixels, where labels say which.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hole_rate_moving: Option<f64>,
    /// Share of the ground truth without prediction, where predictions may be absent; pooled over pixels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub missing_rate: Option<f64>,
    /// How sharp the predictions are, where truth is dense; median-scaled.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sharpness: Option<Sharpness>,
    /// Whether the intervals of a network that says how sure it is hold what they promise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intervals: Option<Intervals>,
    /// Distances of randomly drawn points from the truth, where asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points: Option<Points>,
    /// The mean depth of each pixel over the training scans, on the same images: what a useful network must beat.
    #[serde(default, rename = "trivial", skip_serializing_if = "Option::is_none")]
    pub mean_depth_baseline: Option<MeanDepthRow>,
    /// The same of each kind of drive, where the recordings say theirs and there is more than one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub scenarios: Vec<ScenarioRow>,
    /// Names of images without a pixel to compare, if any.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub skipped: Vec<String>,
    /// SHA-256 of the ground truth that counts: two evaluations with the same one compared the same pixels of the same
    /// images with the same depths, in the same order.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub truth_sha256: Option<String>,
}

/// Whether a count is not worth a field.
fn none(count: &usize) -> bool {
    *count == 0
}

impl Report {
    /// Puts the mean-depth baseline beside the method's: `baseline` is the report of its predictions on the same images.
    #[must_use]
    pub fn with_mean_depth_baseline(mut self, baseline: &Report) -> Self {
        self.mean_depth_baseline = Some(MeanDepthRow {
            unscaled: baseline.unscaled,
            median_scaled: baseline.median_scaled,
        });
        self
    }
}

/// One kind of drive, such as `garage`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ScenarioRow {
    /// Its name.
    pub name: String,
    /// How many images were compared.
    pub n: usize,
    /// Metrics of the predictions as they are.
    pub unscaled: Metrics,
    /// Metrics after median scaling.
    pub median_scaled: Metrics,
    /// How metric the predictions are.
    pub scale: Scale,
}

impl ScenarioRow {
    /// The row of a scenario, from the report on its images alone.
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

/// The part of a [`Protocol`] that a reader needs to repeat the comparison.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ProtocolSummary {
    /// The part of the image that was compared.
    pub crop: Crop,
    /// Ground truth from here on was left out, in metres.
    pub cap_m: f64,
    /// Ground truth up to here was left out, in metres.
    pub min_m: f64,
    /// Which depth the ground truth holds.
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

/// How metric the predictions are.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Scale {
    /// Median over images of median(gt) / median(prediction): 1 for a metric method.
    pub median: f64,
    /// Standard deviation of these ratios over their median.
    pub std_rel: f64,
    /// Mean over images of ln(median(prediction) / median(gt)): above 0 where the method sees things too far away.
    pub bias: f64,
    /// 95 % interval of the bias by bootstrap over images; `None` for a single image.
    pub bias_ci95: Option<[f64; 2]>,
}

/// Unscaled metrics of the pixels whose true depth is in [`from_m`, `to_m`).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RangeBin {
    /// From, in metres.
    pub from_m: u32,
    /// Up to, in metres.
    pub to_m: u32,
    /// How many pixels.
    pub n: usize,
    /// mean |gt − pred| / gt; `None` without pixels.
    pub abs_rel: Option<f64>,
    /// √mean (gt − pred)², in metres; `None` without pixels.
    pub rmse: Option<f64>,
}

/// The mean-depth baseline's scores on the same images.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MeanDepthRow {
    /// As it is.
    pub unscaled: Metrics,
    /// After median scaling.
    pub median_scaled: Metrics,
}
