//! What a run's depth is worth, pixel by pixel: learned from frames with ground truth, kept beside the run.

use std::path::Path;

use deepfusion_data::Dataset;
use deepfusion_perception::{ConfidenceModel, Evidence, Reliability};
use deepfusion_runtime::DepthEstimator;
use image::imageops::flip_horizontal;
use serde::{Deserialize, Serialize};

use super::division::divide;
use super::evaluate::{Evaluated, Place, Truth};
use super::known_pixels::known_pixels;
use crate::failure::{Failure, Result};
use crate::output;

/// The file in a run's folder.
const FILE: &str = "confidence.toml";
/// Depths that are compared, metres.
const RANGE_M: std::ops::Range<f64> = 1e-3..80.0;
/// Dots of the reliability plot.
const BINS: usize = 10;

/// What is kept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Confidence {
    /// From a single look at an image.
    pub single: ConfidenceModel,
    /// From the image and its mirror image.
    pub mirrored: ConfidenceModel,
    /// Frames it was learned from.
    pub frames: usize,
    /// Frames it was judged by: of other drives, or of another part of the one drive, none of them learned from.
    #[serde(default)]
    pub held_out: usize,
    /// Pixels of them.
    pub pixels: usize,
}

impl Confidence {
    /// A run's, where it was calibrated; a file that is none is an error.
    pub fn read(run: &Path) -> Result<Option<Self>> {
        let path = run.join(FILE);
        match std::fs::read_to_string(&path) {
            Ok(text) => {
                Ok(Some(toml::from_str(&text).map_err(|e| {
                    Failure::from(e).context(path.display().to_string())
                })?))
            }
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(e) => Err(deepfusion_data::Error::file(&path, e).into()),
        }
    }

    fn write(&self, run: &Path) -> Result<std::path::PathBuf> {
        let path = run.join(FILE);
        let text = format!(
            "# Expected relative error of a depth = constant + gradient * (local gradient of disparity) + flip * (disagreement\n\
             # with the mirrored image); confidence = exp(-error). Written by `eval --calibrate-confidence`.\n{}",
            toml::to_string(self)?
        );
        output::write(&path, text)?;
        Ok(path)
    }
}

/// Learns from one part of the evaluated frames, keeps the result beside the run, and tells how it holds on the other, which
/// is of other drives or of another part of the drive.
pub fn calibrate(
    estimator: &mut DepthEstimator,
    datasets: &[Dataset],
    truth: &mut Truth,
    evaluated: &Evaluated,
    correct_focal: bool,
    run: &Path,
) -> Result<Option<Vec<Reliability>>> {
    let images: Vec<_> = evaluated
        .places
        .iter()
        .map(|p| image(datasets, *p))
        .collect();
    let division = divide(&images);
    let mut sampled = |part: &[usize]| -> Result<Vec<Sampled>> {
        let mut samples = Vec::new();
        for Place(set, frame) in part.iter().map(|i| evaluated.places[*i]) {
            let dataset = &datasets[set];
            samples.extend(of_frame(estimator, dataset, frame, truth, correct_focal)?);
        }
        Ok(samples)
    };
    let learned = sampled(&division.learned)?;
    let held_out = sampled(&division.held_out)?;
    let fit = |flip: bool| ConfidenceModel::fit(&told(&learned, flip));
    let (Some(single), Some(mirrored)) = (fit(false), fit(true)) else {
        return Ok(None);
    };
    let confidence = Confidence {
        single,
        mirrored,
        frames: division.learned.len(),
        held_out: division.held_out.len(),
        pixels: learned.len(),
    };
    let path = confidence.write(run)?;
    let judged_by = match (held_out.is_empty(), division.by_drive) {
        (true, _) => "none left to judge it by".to_owned(),
        (false, true) => format!("judged by {} of other drives", confidence.held_out),
        (false, false) => format!("judged by {} of another part", confidence.held_out),
    };
    crate::progress::say(&format!(
        "confidence learned from {} frames, {judged_by}, kept as {}",
        confidence.frames,
        path.display()
    ));
    // One frame has no other half: it is told of itself.
    let judged = if held_out.is_empty() {
        &learned
    } else {
        &held_out
    };
    Ok(Some(mirrored.reliability(&told(judged, true), BINS)))
}

/// The drive that an image is of, and its frame's number. The drives of a folder of bags share the folder.
fn image(datasets: &[Dataset], Place(set, frame): Place) -> ((&Path, &str), u64) {
    let dataset = &datasets[set];
    let drive = (dataset.folder(), dataset.split_name());
    (drive, dataset.frames()[frame].number)
}

/// A pixel's evidence, and its relative error.
type Sampled = (Evidence, f64);

fn told(samples: &[Sampled], flip: bool) -> Vec<Sampled> {
    let without = |e: Evidence| Evidence { flip: 0.0, ..e };
    samples
        .iter()
        .map(|(e, error)| (if flip { *e } else { without(*e) }, *error))
        .collect()
}

fn of_frame(
    estimator: &mut DepthEstimator,
    dataset: &Dataset,
    frame: usize,
    truth: &mut Truth,
    correct_focal: bool,
) -> Result<Vec<Sampled>> {
    let Some(depth) = truth.of(dataset, frame, None)? else {
        return Ok(Vec::new());
    };
    let image = dataset.load_image(frame)?;
    let camera = dataset.intrinsics(frame);
    let seen = estimator.predict(&image, Some(&camera), correct_focal, false)?;
    let mirror = flip_horizontal(&image);
    let mut mirrored = estimator
        .predict(&mirror, Some(&camera.flipped()), correct_focal, false)?
        .disparity;
    for row in mirrored.chunks_exact_mut(seen.width.max(1)) {
        row.reverse();
    }
    let evidence = Evidence::of(&seen.disparity, Some(&mirrored), seen.width);
    Ok(known_pixels(&depth, &seen, &RANGE_M)
        .into_iter()
        .map(|(at, z)| {
            let predicted = 1.0 / f64::from(seen.disparity[at]);
            (evidence[at], (predicted - z).abs() / z)
        })
        .collect())
}
