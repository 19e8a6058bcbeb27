//! The intervals of a network that predicts uncertainty: whether they hold, and the factors that make them hold.

use std::path::{Path, PathBuf};

use deepfusion_data::Dataset;
use deepfusion_eval::{IntervalFactors, IntervalSample, Intervals, Protocol};
use deepfusion_geometry::DepthMap;
use deepfusion_runtime::{DepthEstimator, ModelSource, Prediction};

use crate::drives::first_of_drive;
use crate::evaluation::{Evaluated, ImageRef, Truth, known_pixels};
use crate::files;
use crate::{Error, ModelFacts, Result, StaleCalibration};

/// Name of the file in a run's folder.
const FILE: &str = "uncertainty.toml";
/// The file's key for the network's step.
const STEP: &str = "step";

/// The contents of a run's file: the factors, and the step of the network that they were measured for.
fn saved(run: &Path) -> Result<Option<(IntervalFactors, Option<usize>)>> {
    let path = run.join(FILE);
    let text = match std::fs::read_to_string(&path) {
        Ok(text) => text,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(deepfusion_data::Error::file(&path, e).into()),
    };
    let parsed = text.parse::<toml::Table>().and_then(|mut table| {
        let step = table.remove(STEP).map(toml::Value::try_into).transpose()?;
        Ok((table.try_into()?, step))
    });
    match parsed {
        Ok((factors, step)) => Ok(Some((validated(factors, &path)?, step))),
        Err(source) => Err(Error::NetworkFile { path, source }),
    }
}

/// The factors of a run's network at this step. Those of another step do not apply: [`stale`].
///
/// # Errors
/// A file without factors.
pub fn read(run: &Path, step: usize) -> Result<Option<IntervalFactors>> {
    let saved = saved(run)?.filter(|(_, found)| *found == Some(step));
    Ok(saved.map(|(factors, _)| factors))
}

/// The factors beside a run, if they were measured at another step of the network.
///
/// # Errors
/// As [`read`].
pub fn stale(run: &Path, step: usize) -> Result<Option<StaleCalibration>> {
    let saved = saved(run)?.filter(|(_, found)| *found != Some(step));
    Ok(saved.map(|(_, found)| StaleCalibration {
        path: run.join(FILE),
        found,
        step,
    }))
}

/// Checks factors; `path` is the file named in the error.
pub(crate) fn validated(factors: IntervalFactors, path: &Path) -> Result<IntervalFactors> {
    match factors.validate() {
        Ok(()) => Ok(factors),
        Err(error) => Err(Error::IntervalFactors {
            path: path.to_owned(),
            source: Box::new(error),
        }),
    }
}

fn write(factors: &IntervalFactors, step: usize, run: &Path) -> Result<PathBuf> {
    let path = run.join(FILE);
    let text = format!(
        "# The interval of a depth is depth * exp(-q * b) to depth * exp(q * b); b is the network's prediction; q follows for\n\
         # each level and range of predicted depth. Measured by an evaluation, for the network at this step.\n{STEP} = {step}\n{}",
        toml::to_string(factors)?
    );
    files::write(&path, text)?;
    Ok(path)
}

/// Standard deviation of a prediction's depth (`depth`, at the image's size) in metres, scaled by the factors of the 80 % interval; `None`
/// if the network does not predict uncertainty.
#[must_use]
pub fn sigma(
    prediction: &Prediction,
    depth: &DepthMap,
    factors: &IntervalFactors,
) -> Option<DepthMap> {
    let mut sigma = prediction.sigma_of(depth)?;
    for (sigma, depth) in sigma.data.iter_mut().zip(&depth.data) {
        *sigma *= factors.stretch(f64::from(*depth)) as f32;
    }
    Some(sigma)
}

/// A depth map without the pixels whose standard deviation exceeds `most`, as a share of their depth.
#[must_use]
pub fn without_unsure(depth: &DepthMap, sigma: &DepthMap, most: f64) -> DepthMap {
    let mut sure = depth.clone();
    for (depth, sigma) in sure.data.iter_mut().zip(&sigma.data) {
        if *sigma > *depth * most as f32 {
            *depth = 0.0;
        }
    }
    sure
}

/// Adds to an evaluation whether the network's intervals hold on its frames. With `calibrate`, it measures new factors on these frames,
/// saves them beside the run, returns them with their file, and marks the result as measured on the same frames.
///
/// # Errors
/// A file or image that cannot be read, predicted or written.
pub fn measure(
    (model, estimator): (&ModelSource, &mut DepthEstimator),
    datasets: &[Dataset],
    truth: &mut Truth,
    evaluated: &mut Evaluated,
    (protocol, correct_focal): (&Protocol, bool),
    calibrate: bool,
) -> Result<Option<(IntervalFactors, PathBuf)>> {
    let drives = first_of_drive(datasets);
    let mut samples = Vec::new();
    for ImageRef(set, frame) in &evaluated.places {
        let dataset = &datasets[*set];
        let Some(depth) = truth.of(dataset, *frame, None)? else {
            continue;
        };
        let image = dataset.load_image(*frame)?;
        let camera = dataset.intrinsics(*frame);
        let seen = estimator.predict(&image, Some(&camera), correct_focal, false)?;
        let Some(log_scale) = &seen.log_scale else {
            return Ok(None);
        };
        let range = protocol.min_m..protocol.cap_m;
        for (at, z) in known_pixels(&depth, &seen, &range) {
            let predicted = 1.0 / f64::from(seen.disparity[at]);
            samples.push(IntervalSample {
                depth_m: predicted,
                scale: f64::from(log_scale[at]).exp(),
                error: (predicted / z).ln().abs(),
                drive: drives[*set],
            });
        }
    }
    let mut factors = model.interval_factors()?;
    let mut kept = None;
    if calibrate
        && let Some(found) = IntervalFactors::calibrate(&samples)
        && let Some(run) = model.folder()
    {
        kept = Some((found.clone(), write(&found, estimator.step, run)?));
        factors = found;
    }
    evaluated.report.intervals = factors.measure(&samples).map(|measured| Intervals {
        in_sample: kept.is_some(),
        ..measured
    });
    Ok(kept)
}
