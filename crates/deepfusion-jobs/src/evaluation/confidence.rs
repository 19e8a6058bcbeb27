//! The confidence of each pixel of a run's depth: learned from frames with ground truth, saved beside the run.

use std::fmt;
use std::path::{Path, PathBuf};

use deepfusion_data::Dataset;
use deepfusion_hint::count_of;
use deepfusion_perception::{ConfidenceModel, Evidence, Reliability};
use deepfusion_runtime::DepthEstimator;
use serde::{Deserialize, Serialize};

use super::division::divide;
use super::{Evaluated, ImageRef, Truth, known_pixels};
use crate::files::write;
use crate::{Error, Result, StaleCalibration};

/// Name of the file in a run's folder.
const FILE: &str = "confidence.toml";
/// Range of the depths that are compared, in metres.
const RANGE_M: std::ops::Range<f64> = 1e-3..80.0;
/// Number of dots in the reliability plot.
const BINS: usize = 10;

/// The confidence models of a network, as saved.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Confidence {
    /// For a single prediction of an image.
    pub single: ConfidenceModel,
    /// For the mean of the predictions of an image and its mirror image.
    pub mirrored: ConfidenceModel,
    /// The step of the network that it was learned for.
    #[serde(default)]
    pub step: Option<usize>,
    /// Number of frames that it was learned from.
    pub frames: usize,
    /// Number of frames that it was tested on: of other drives, or of another part of the same drive; none was learned from.
    #[serde(default)]
    pub held_out: usize,
    /// Number of pixels in them.
    pub pixels: usize,
}

impl Confidence {
    /// The confidence of a run's network at this step. One learned at another step does not apply: [`Self::stale`].
    ///
    /// # Errors
    /// An invalid file.
    pub fn read(run: &Path, step: usize) -> Result<Option<Self>> {
        Ok(Self::saved(run)?.filter(|kept| kept.step == Some(step)))
    }

    /// The confidence beside a run, if it was learned at another step of the network.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn stale(run: &Path, step: usize) -> Result<Option<StaleCalibration>> {
        let kept = Self::saved(run)?.filter(|kept| kept.step != Some(step));
        Ok(kept.map(|kept| StaleCalibration {
            path: run.join(FILE),
            found: kept.step,
            step,
        }))
    }

    fn saved(run: &Path) -> Result<Option<Self>> {
        let path = run.join(FILE);
        match std::fs::read_to_string(&path) {
            Ok(text) => match toml::from_str(&text) {
                Ok(confidence) => Ok(Some(confidence)),
                Err(source) => Err(Error::NetworkFile { path, source }),
            },
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(e) => Err(deepfusion_data::Error::file(&path, e).into()),
        }
    }

    fn write(&self, run: &Path) -> Result<PathBuf> {
        let path = run.join(FILE);
        let text = format!(
            "# Expected relative error of a depth = constant + gradient * (local gradient of disparity) + flip * (disagreement\n\
             # with the mirrored image); confidence = exp(-error). Measured by an evaluation.\n{}",
            toml::to_string(self)?
        );
        write(&path, text)?;
        Ok(path)
    }
}

/// The result of [`calibrate`].
#[derive(Debug, Clone, PartialEq)]
pub struct Calibrated {
    /// The learned confidence.
    pub confidence: Confidence,
    /// Path of the file that it was saved as.
    pub path: PathBuf,
    /// Whether it was tested on other drives, not on another part of the same drive.
    pub by_drive: bool,
    /// How reliable it is on the frames that it was tested on.
    pub reliability: Vec<Reliability>,
}

/// The frames that a confidence was tested on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum JudgedBy {
    /// No frames were left.
    Nothing,
    /// This many frames of other drives.
    OtherDrives(usize),
    /// This many frames of another part of the same drive.
    AnotherPart(usize),
}

impl fmt::Display for JudgedBy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Nothing => f.write_str("no frames left to test it on"),
            Self::OtherDrives(n) => write!(f, "tested on {n} of other drives"),
            Self::AnotherPart(n) => write!(f, "tested on {n} of another part of the drive"),
        }
    }
}

impl Calibrated {
    /// The frames that it was tested on.
    #[must_use]
    pub fn judged_by(&self) -> JudgedBy {
        match (self.confidence.held_out, self.by_drive) {
            (0, _) => JudgedBy::Nothing,
            (n, true) => JudgedBy::OtherDrives(n),
            (n, false) => JudgedBy::AnotherPart(n),
        }
    }
}

impl fmt::Display for Calibrated {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "confidence learned from {}, {}, saved as {}",
            count_of(self.confidence.frames, "frame"),
            self.judged_by(),
            self.path.display()
        )
    }
}

/// Learns a confidence from one part of the evaluated frames, saves it beside the run, and tests it on the other part: other drives, or
/// another part of the same drive. `None` if there are too few frames to learn from.
///
/// # Errors
/// A file or image that cannot be read, predicted or written.
pub fn calibrate(
    estimator: &mut DepthEstimator,
    datasets: &[Dataset],
    truth: &mut Truth,
    evaluated: &Evaluated,
    correct_focal: bool,
    run: &Path,
) -> Result<Option<Calibrated>> {
    let images: Vec<_> = evaluated
        .places
        .iter()
        .map(|p| image(datasets, *p))
        .collect();
    let division = divide(&images);
    let mut sampled = |part: &[usize]| -> Result<Vec<Sampled>> {
        let mut samples = Vec::new();
        for ImageRef(set, frame) in part.iter().map(|i| evaluated.places[*i]) {
            let dataset = &datasets[set];
            samples.extend(of_frame(estimator, dataset, frame, truth, correct_focal)?);
        }
        Ok(samples)
    };
    let learned = sampled(&division.learned)?;
    let held_out = sampled(&division.held_out)?;
    let fit = |flip: bool| ConfidenceModel::fit(&with_flip(&learned, flip));
    let (Some(single), Some(mirrored)) = (fit(false), fit(true)) else {
        return Ok(None);
    };
    let confidence = Confidence {
        single,
        mirrored,
        step: Some(estimator.step),
        frames: division.learned.len(),
        held_out: division.held_out.len(),
        pixels: learned.len(),
    };
    let path = confidence.write(run)?;
    // A single frame cannot be divided: the confidence is tested on the frame that it was learned from.
    let judged = if held_out.is_empty() {
        &learned
    } else {
        &held_out
    };
    let reliability = mirrored.reliability(&with_flip(judged, true), BINS);
    Ok(Some(Calibrated {
        confidence,
        path,
        by_drive: division.by_drive,
        reliability,
    }))
}

/// The drive of an image, and its frame's number. The drives of a folder of bags share the folder, and names of two videos may differ only
/// in their extensions.
fn image(datasets: &[Dataset], ImageRef(set, frame): ImageRef) -> ((&Path, &str), u64) {
    let dataset = &datasets[set];
    let drive = (dataset.place(), dataset.split_name());
    (drive, dataset.frames()[frame].number)
}

/// A pixel's evidence, and its relative error.
type Sampled = (Evidence, f64);

fn with_flip(samples: &[Sampled], flip: bool) -> Vec<Sampled> {
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
    let preparer = estimator.preparer();
    let prepared = preparer.prepare(&image, Some(&camera), correct_focal, false);
    let seen = estimator.infer(&prepared)?;
    let mirrored = estimator.infer_mirrored(&prepared)?;
    let evidence = Evidence::of(&seen.disparity, Some(&mirrored.disparity), seen.width);
    Ok(known_pixels(&depth, &seen, &RANGE_M)
        .into_iter()
        .map(|(at, z)| {
            let predicted = 1.0 / f64::from(seen.disparity[at]);
            (evidence[at], (predicted - z).abs() / z)
        })
        .collect())
}
