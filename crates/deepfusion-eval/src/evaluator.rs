use deepfusion_geometry::Intrinsics;
use sha2::{Digest, Sha256};

use crate::error::first_names;
use crate::holes;
use crate::metrics::{Metrics, Sums};
use crate::points::{DrawnPoint, Points};
use crate::report::{FixedScaled, ProtocolSummary, RangeBin, Report, Scale};
use crate::resample::{Axis, sample};
use crate::statistics::{Reservoir, bootstrap_mean_ci95, mean, median, standard_deviation};
use crate::{Error, Grid, Holes, ImageSharpness, Prediction, Protocol, Result, Scaling, Sharpness};

/// Limits of the depth ranges, in metres.
const RANGES_M: [u32; 5] = [0, 10, 20, 40, 80];

/// An image to evaluate. The optional parts are known only for some images.
#[derive(Debug, Clone, Copy)]
pub struct Sample<'a> {
    /// The image's name, for messages and the report.
    pub name: &'a str,
    /// The prediction, at any size.
    pub prediction: &'a Prediction,
    /// Depth in metres, 0 = none. Images are compared at its size.
    pub ground_truth: &'a Grid,
    /// Which pixels of the ground truth are dynamic, H×W row by row, if labels or FMCW velocities show it.
    pub moving: Option<&'a [bool]>,
    /// The camera at the ground truth's size. With it, point statistics are distances in space; without it, along z.
    pub intrinsics: Option<&'a Intrinsics>,
    /// Dense depth in metres beside a sparse ground truth: 0 = unknown, infinity = sky. Used only to measure sharpness; with `None`, the
    /// ground truth is used for that if it is dense.
    pub dense: Option<&'a Grid>,
}

/// Scores of one image.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageScore {
    /// The image's name.
    pub name: String,
    /// Number of pixels compared.
    pub pixels: usize,
    /// Metrics of the unchanged prediction.
    pub unscaled: Metrics,
    /// Metrics of the prediction times `ratio`.
    pub median_scaled: Metrics,
    /// Metrics of the prediction times the fixed factor, if the protocol has one.
    pub fixed_scaled: Option<Metrics>,
    /// median(gt) / median(prediction) over the compared pixels, before clamping: 1 for a metric method.
    pub ratio: f64,
    /// Unscaled metrics of the static pixels, if known.
    pub still: Option<Metrics>,
    /// Unscaled metrics of the dynamic pixels, if known.
    pub moving: Option<Metrics>,
    /// Sharpness of the prediction, if dense ground truth is known.
    pub sharpness: Option<ImageSharpness>,
}

/// Compares predictions with ground truth, image by image, and summarises them.
///
/// ```
/// use deepfusion_eval::{Evaluator, Grid, Prediction, Protocol};
/// let truth = Grid::new(2, 1, vec![10.0, 20.0])?;
/// let depth = Prediction::Depth(Grid::new(2, 1, vec![11.0, 20.0])?);
/// let mut evaluator = Evaluator::new(Protocol::default())?;
/// evaluator.add("frame 0", &depth, &truth)?;
/// assert!((evaluator.report()?.unscaled.abs_rel - 0.05).abs() < 1e-12);
/// # Ok::<(), deepfusion_eval::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Evaluator {
    protocol: Protocol,
    images: Vec<ImageScore>,
    skipped: Vec<String>,
    bins: [Sums; RANGES_M.len() - 1],
    points: Reservoir<DrawnPoint>,
    /// Whether every image came with its camera.
    in_space: bool,
    /// Hash of the compared ground truth, in the order of the images.
    truth: Sha256,
    /// Pixels with ground truth inside the mask (`masked`), and how many of them lack a prediction (`missing`).
    masked: usize,
    missing: usize,
    /// Hole rates of the images with near pixels, over all pixels and over dynamic pixels.
    hole_rates: Vec<f64>,
    moving_hole_rates: Vec<f64>,
}

impl Evaluator {
    /// An evaluator without images.
    ///
    /// # Errors
    /// [`Error::Protocol`] for a protocol that cannot measure anything.
    pub fn new(protocol: Protocol) -> Result<Self> {
        protocol.validate()?;
        Ok(Self {
            images: Vec::new(),
            skipped: Vec::new(),
            bins: Default::default(),
            points: Reservoir::new(protocol.points, protocol.points_seed),
            in_space: true,
            truth: Sha256::new(),
            masked: 0,
            missing: 0,
            hole_rates: Vec::new(),
            moving_hole_rates: Vec::new(),
            protocol,
        })
    }

    /// Compares one image. Returns its score, or `None` if the image has no pixel to compare (the report then lists it as skipped).
    ///
    /// # Errors
    /// [`Error::InvalidPrediction`] if the prediction contains values that are not valid depths and holes are not allowed.
    pub fn add(
        &mut self,
        name: &str,
        prediction: &Prediction,
        ground_truth: &Grid,
    ) -> Result<Option<&ImageScore>> {
        self.add_sample(&Sample {
            name,
            prediction,
            ground_truth,
            moving: None,
            intrinsics: None,
            dense: None,
        })
    }

    /// Like [`Evaluator::add`], with data known only for some images.
    ///
    /// # Errors
    /// As for [`Evaluator::add`]; [`Error::Shape`] if the moving labels differ in size from the ground truth.
    pub fn add_sample(&mut self, image: &Sample<'_>) -> Result<Option<&ImageScore>> {
        let truth = image.ground_truth;
        if let Some(labels) = image.moving
            && labels.len() != truth.values().len()
        {
            return Err(Error::Shape {
                name: format!("moving labels of {}", image.name),
                width: truth.width(),
                height: truth.height(),
                len: labels.len(),
            });
        }
        let disparities = self.checked_disparities(image)?;
        let pixels = self.compared_pixels(image, &disparities);
        let (Some(middle_gt), Some(middle_pred)) =
            (median_of(&pixels, |p| p.gt), median_of(&pixels, |p| p.pred))
        else {
            self.skipped.push(image.name.to_owned());
            return Ok(None);
        };
        let ratio = middle_gt / middle_pred;
        let unscaled = self.sums(&pixels, 1.0, |_| true);
        let (Some(all), Some(median_scaled)) = (
            unscaled.metrics(),
            self.sums(&pixels, ratio, |_| true).metrics(),
        ) else {
            self.skipped.push(image.name.to_owned());
            return Ok(None);
        };
        let fixed_scaled = match self.protocol.scaling {
            Scaling::Fixed(factor) => self.sums(&pixels, factor, |_| true).metrics(),
            Scaling::None | Scaling::Median => None,
        };
        let part = |moving: bool| {
            image.moving.and_then(|labels| {
                self.sums(&pixels, 1.0, |p| labels[p.index] == moving)
                    .metrics()
            })
        };
        let score = ImageScore {
            name: image.name.to_owned(),
            pixels: pixels.len(),
            unscaled: all,
            median_scaled,
            fixed_scaled,
            ratio,
            still: part(false),
            moving: part(true),
            sharpness: ImageSharpness::of(
                image.dense.unwrap_or(truth),
                image.prediction,
                &self.protocol,
            ),
        };
        for (bin, edges) in RANGES_M.windows(2).enumerate() {
            let inside = |p: &Pixel| p.gt >= f64::from(edges[0]) && p.gt < f64::from(edges[1]);
            let sums = self.sums(&pixels, 1.0, inside);
            self.bins[bin].add(&sums);
        }
        if self.protocol.points > 0 {
            self.in_space &= image.intrinsics.is_some();
            let (number, width) = (self.images.len(), truth.width());
            for pixel in &pixels {
                let depths = [
                    pixel.gt,
                    self.clamp(pixel.pred),
                    self.clamp(pixel.pred * ratio),
                ];
                let place = (pixel.index % width, pixel.index / width);
                self.points
                    .push(|| DrawnPoint::new(number, image.intrinsics, place, depths));
            }
        }
        self.images.push(score);
        Ok(self.images.last())
    }

    /// Scores of the images so far, in the order they were added.
    #[must_use]
    pub fn images(&self) -> &[ImageScore] {
        &self.images
    }

    /// The points drawn so far: at most the protocol's number.
    #[must_use]
    pub fn drawn_points(&self) -> &[DrawnPoint] {
        &self.points.items
    }

    /// Summarises all images.
    ///
    /// # Errors
    /// [`Error::NothingToEvaluate`] if no image had a pixel to compare.
    pub fn report(&self) -> Result<Report> {
        let nothing = || Error::NothingToEvaluate {
            skipped: self.skipped.len(),
            names: first_names(&self.skipped),
        };
        let images = &self.images;
        let average = |part: fn(&ImageScore) -> Option<&Metrics>| {
            Metrics::mean(images.iter().filter_map(part))
        };
        let unscaled = average(|i| Some(&i.unscaled)).ok_or_else(nothing)?;
        let median_scaled = average(|i| Some(&i.median_scaled)).ok_or_else(nothing)?;
        let fixed_scaled = match self.protocol.scaling {
            Scaling::Fixed(factor) => {
                average(|i| i.fixed_scaled.as_ref()).map(|metrics| FixedScaled { factor, metrics })
            }
            Scaling::None | Scaling::Median => None,
        };
        Ok(Report {
            n: images.len(),
            expected: None,
            protocol: ProtocolSummary::from(&self.protocol),
            unscaled,
            median_scaled,
            fixed_scaled,
            scale: self.scale().ok_or_else(nothing)?,
            ranges: self.ranges(),
            still: average(|i| i.still.as_ref()),
            moving: average(|i| i.moving.as_ref()),
            moving_images: images.iter().filter(|i| i.moving.is_some()).count(),
            hole_rate: mean(&self.hole_rates),
            hole_rate_moving: mean(&self.moving_hole_rates),
            missing_rate: (self.protocol.holes == Holes::Skip)
                .then(|| self.missing as f64 / self.masked.max(1) as f64),
            sharpness: Sharpness::mean(images.iter().filter_map(|i| i.sharpness.as_ref())),
            intervals: None,
            points: self.point_statistics(),
            mean_depth_baseline: None,
            scenarios: Vec::new(),
            skipped: self.skipped.clone(),
            truth_sha256: Some(format!("{:x}", self.truth.clone().finalize())),
        })
    }

    fn scale(&self) -> Option<Scale> {
        let ratios: Vec<f64> = self.images.iter().map(|i| i.ratio).collect();
        // ln(median(pred) / median(gt)): positive if predictions are too far.
        let biases: Vec<f64> = ratios.iter().map(|r| -r.ln()).collect();
        let middle = median(&ratios)?;
        Some(Scale {
            median: middle,
            std_rel: standard_deviation(&ratios, 0)? / middle,
            bias: mean(&biases)?,
            bias_ci95: bootstrap_mean_ci95(&biases, self.protocol.seed),
        })
    }

    fn ranges(&self) -> Vec<RangeBin> {
        RANGES_M
            .windows(2)
            .zip(&self.bins)
            .map(|(edges, sums)| {
                let metrics = sums.metrics();
                RangeBin {
                    from_m: edges[0],
                    to_m: edges[1],
                    n: sums.n,
                    abs_rel: metrics.map(|m| m.abs_rel),
                    rmse: metrics.map(|m| m.rmse),
                }
            })
            .collect()
    }

    fn point_statistics(&self) -> Option<Points> {
        Points::of(
            &self.points.items,
            &RANGES_M,
            self.in_space,
            self.protocol.points_seed,
        )
    }

    fn clamp(&self, depth_m: f64) -> f64 {
        depth_m.clamp(self.protocol.min_m, self.protocol.cap_m)
    }

    fn sums(&self, pixels: &[Pixel], factor: f64, wanted: impl Fn(&Pixel) -> bool) -> Sums {
        let mut sums = Sums::default();
        for pixel in pixels.iter().filter(|p| wanted(p)) {
            sums.push(pixel.gt, self.clamp(pixel.pred * factor));
        }
        sums
    }

    fn checked_disparities(&self, image: &Sample<'_>) -> Result<Vec<Option<f64>>> {
        let disparities = image.prediction.disparities();
        let first = disparities.iter().position(Option::is_none);
        match (first, self.protocol.holes) {
            (Some(index), Holes::Refuse) => {
                let grid = image.prediction.grid();
                Err(Error::InvalidPrediction {
                    name: image.name.to_owned(),
                    kind: image.prediction.kind(),
                    value: grid.values()[index],
                    x: index % grid.width(),
                    y: index / grid.width(),
                    count: disparities.iter().filter(|d| d.is_none()).count(),
                    total: disparities.len(),
                })
            }
            _ => Ok(disparities),
        }
    }

    /// The first two steps of the protocol (docs/concepts/evaluation.md): the pixels inside the mask, with the prediction resized as
    /// disparity and inverted. Only predictions are resized, since the ground truth is sparse.
    fn compared_pixels(&mut self, image: &Sample<'_>, disparities: &[Option<f64>]) -> Vec<Pixel> {
        let (truth, grid) = (image.ground_truth, image.prediction.grid());
        let columns = Axis::new(grid.width(), truth.width());
        let rows = Axis::new(grid.height(), truth.height());
        let (window_rows, window_columns) =
            self.protocol.crop.window(truth.width(), truth.height());
        let (mut near, mut near_moving) = (holes::Holes::default(), holes::Holes::default());
        let mut pixels = Vec::new();
        let mut counted = Vec::new();
        for y in window_rows {
            for x in window_columns.clone() {
                let index = y * truth.width() + x;
                let gt = truth.values()[index];
                if !(gt > self.protocol.min_m && gt < self.protocol.cap_m) {
                    continue;
                }
                self.masked += 1;
                counted.extend_from_slice(&(index as u64).to_le_bytes());
                counted.extend_from_slice(&gt.to_le_bytes());
                let pred = sample(disparities, grid.width(), &columns, &rows, x, y)
                    .map(|disparity| 1.0 / disparity);
                near.push(gt, pred, self.protocol.cap_m);
                if image.moving.is_some_and(|labels| labels[index]) {
                    near_moving.push(gt, pred, self.protocol.cap_m);
                }
                match pred {
                    Some(pred) => pixels.push(Pixel { index, gt, pred }),
                    None => self.missing += 1,
                }
            }
        }
        for size in [truth.width(), truth.height()] {
            self.truth.update((size as u64).to_le_bytes());
        }
        self.truth.update(&counted);
        self.hole_rates.extend(near.rate());
        self.moving_hole_rates.extend(near_moving.rate());
        pixels
    }
}

/// A compared pixel with its depths in metres.
#[derive(Debug, Clone, Copy)]
struct Pixel {
    /// The pixel's index in the ground truth, row by row.
    index: usize,
    gt: f64,
    pred: f64,
}

fn median_of(pixels: &[Pixel], value: fn(&Pixel) -> f64) -> Option<f64> {
    median(&pixels.iter().map(value).collect::<Vec<_>>())
}
