//! How sure a network is: whether its intervals hold, and by how much they must be stretched so that they do.

use std::path::{Path, PathBuf};

use deepfusion_data::Dataset;
use deepfusion_eval::{IntervalFactors, IntervalSample, Protocol};
use deepfusion_geometry::DepthMap;
use deepfusion_runtime::ModelSource;
use deepfusion_runtime::{DepthEstimator, Prediction};

use super::evaluate::{Evaluated, Place, Truth};
use super::known_pixels::known_pixels;
use crate::error::CliError;
use crate::failure::{Context, Result};
use crate::model::ModelFacts;
use crate::output;
use crate::progress::say;

/// The file in a run's folder.
const FILE: &str = "uncertainty.toml";

/// A run's factors, where they were found; a file that holds none is an error.
pub fn read(run: &Path) -> Result<Option<IntervalFactors>> {
    let path = run.join(FILE);
    let named = || path.display().to_string();
    match std::fs::read_to_string(&path) {
        Ok(text) => {
            let factors: IntervalFactors = toml::from_str(&text).with_context(named)?;
            factors.validate().with_context(named)?;
            Ok(Some(factors))
        }
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(e) => Err(deepfusion_data::Error::file(&path, e).into()),
    }
}

fn write(factors: &IntervalFactors, run: &Path) -> Result<PathBuf> {
    let path = run.join(FILE);
    let text = format!(
        "# The interval of a depth is depth * exp(-q * b) to depth * exp(q * b); b is what the network says, and q stands here for\n\
         # each level and range of predicted depth. Written by `eval --calibrate-uncertainty`.\n{}",
        toml::to_string(factors)?
    );
    output::write(&path, text)?;
    Ok(path)
}

/// Standard deviation of a prediction's depth (`depth`, at the image's size), metres, stretched as the intervals of 80 % are;
/// `None` of a network that does not say how sure it is.
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

/// A depth without the pixels whose standard deviation is above a share of it.
pub fn without_unsure(depth: &DepthMap, sigma: &DepthMap, most: f64) -> DepthMap {
    let mut sure = depth.clone();
    for (depth, sigma) in sure.data.iter_mut().zip(&sigma.data) {
        if *sigma > *depth * most as f32 {
            *depth = 0.0;
        }
    }
    sure
}

/// That a network can be calibrated at all, before anything is measured.
///
/// # Errors
/// [`CliError::NoUncertainty`], [`CliError::NoRunFolder`].
pub fn check(model: &ModelSource, estimator: &DepthEstimator) -> Result<()> {
    if !estimator.knows_uncertainty() {
        return Err(CliError::NoUncertainty.into());
    }
    match model.folder() {
        Some(_) => Ok(()),
        None => Err(CliError::NoRunFolder {
            option: "--calibrate-uncertainty",
            model: model.name(),
        }
        .into()),
    }
}

/// Adds to an evaluation whether the network's intervals hold on its frames; with `calibrate` finds new factors on them, and
/// keeps those beside the run.
pub fn measure(
    (model, estimator): (&ModelSource, &mut DepthEstimator),
    datasets: &[Dataset],
    truth: &mut Truth,
    evaluated: &mut Evaluated,
    (protocol, correct_focal): (&Protocol, bool),
    calibrate: bool,
) -> Result<()> {
    let mut samples = Vec::new();
    for Place(set, frame) in &evaluated.places {
        let dataset = &datasets[*set];
        let Some(depth) = truth.of(dataset, *frame, None)? else {
            continue;
        };
        let image = dataset.load_image(*frame)?;
        let camera = dataset.intrinsics(*frame);
        let seen = estimator.predict(&image, Some(&camera), correct_focal, false)?;
        let Some(log_scale) = &seen.log_scale else {
            return Ok(());
        };
        let range = protocol.min_m..protocol.cap_m;
        for (at, z) in known_pixels(&depth, &seen, &range) {
            let predicted = 1.0 / f64::from(seen.disparity[at]);
            samples.push(IntervalSample {
                depth_m: predicted,
                scale: f64::from(log_scale[at]).exp(),
                error: (predicted / z).ln().abs(),
                drive: *set,
            });
        }
    }
    let mut factors = model.interval_factors()?;
    if calibrate
        && let Some(found) = IntervalFactors::calibrate(&samples)
        && let Some(run) = model.folder()
    {
        let path = write(&found, run)?;
        say(&format!(
            "intervals calibrated on {} pixels of {} drives, kept as {}; what stands below is of the same pixels, measure on others",
            found.pixels,
            found.drives,
            path.display()
        ));
        factors = found;
    }
    evaluated.report.intervals = factors.measure(&samples);
    Ok(())
}
