//! Calibration for int8: the input ranges of a network's convolutions on the user's images, and which convolutions tolerate int8.

use std::path::{Path, PathBuf};

use deepfusion_data::load_photo;
use deepfusion_model::weights::Weights;
use deepfusion_model::{Int8Calibration, StoredNetwork, TrainConfig};
use deepfusion_runtime::{
    Augmentation, DepthRunner, FusedRunner, ModelSource, Precision, Preparer, SeenInputs,
};
use deepfusion_weights::Shipped;

use crate::packing::simulated_input;
use crate::{Error, Input, Result};

/// Number of images on which depth in int8 is compared with depth in f32.
const COMPARED_ON: usize = 4;

/// Options of the calibration.
#[derive(Debug, Clone, Copy)]
pub struct Int8Options<'a> {
    /// Number of images to use, evenly spread.
    pub images: usize,
    /// How far depth may differ from that in f32 on average (|ln|): the convolutions that harm it most stay in bf16 until it does not.
    pub most_deviation: f64,
    /// One of the network's training data sets, if there were several.
    pub set: Option<&'a str>,
}

/// Checks that a network can be calibrated on this machine.
///
/// # Errors
/// [`Error::EmbeddedNetwork`]; a processor without int8.
pub fn check(source: &ModelSource) -> Result<()> {
    match source {
        ModelSource::Packed { given, .. } if !Shipped::is_at(given) => {
            Err(Error::EmbeddedNetwork {
                name: given.display().to_string(),
            })
        }
        _ => Ok(FusedRunner::check_int8()?),
    }
}

/// Measures the input ranges of a network's convolutions, and saves them beside it: in the run's folder, or in the packed file's card.
/// `shown` receives the number of steps done, and of all. Returns the calibration and the path of its file.
///
/// # Errors
/// As [`check`]; [`Error::NoImages`] without images, [`Error::NothingInInt8`] if no convolution tolerates int8; images that cannot be read;
/// a file that cannot be written.
pub fn calibrate(
    source: &ModelSource,
    images: &[Input],
    options: Int8Options<'_>,
    shown: impl FnMut(usize, usize),
) -> Result<(Int8Calibration, PathBuf)> {
    check(source)?;
    let packed = match source {
        ModelSource::Packed { given, network } => Some((given, network)),
        ModelSource::Run { .. } => None,
    };
    let network = source.load(options.set)?;
    let calibration = found(&network, images, options, shown)?;
    if calibration.ranges.is_empty() {
        return Err(Error::NothingInInt8 {
            most_deviation: options.most_deviation,
        });
    }
    let path = match (packed, source.folder()) {
        (Some((given, network)), _) => {
            let mut network = network.clone();
            network.card.int8 = Some(toml::Table::try_from(&calibration)?);
            let folder = given.parent().unwrap_or(Path::new("."));
            let [card, _] = network.write(folder, true)?;
            card
        }
        (None, Some(folder)) => calibration.write(folder)?,
        (None, None) => unreachable!("a network is packed or a run's"),
    };
    Ok((calibration, path))
}

/// The calibration of a network with these weights on a simulated street: enough to time int8 without trained weights.
///
/// # Errors
/// Weights of another network.
pub fn on_a_street(config: &TrainConfig, weights: &Weights) -> Result<Int8Calibration> {
    let input = simulated_input(config)?;
    observed(config, weights, 0, std::iter::once(Ok(input)))
}

/// An image as the network's input, at the training size.
fn prepared(network: &StoredNetwork, input: &Input) -> Result<Vec<f32>> {
    let preparer = Preparer {
        size: network.config.size,
        training_camera: network.camera,
        canonical_focal_px: None,
        augmentation: Augmentation::NONE,
    };
    let (image, camera) = match &input.frame {
        Some((dataset, frame)) => {
            let camera = dataset.intrinsics(*frame);
            (dataset.load_image(*frame)?, Some(camera))
        }
        None => {
            let photo = load_photo(&input.path)?;
            (photo.image, photo.intrinsics)
        }
    };
    let seen = preparer.prepare(&image, camera.as_ref(), false, true);
    Ok(seen.views.into_iter().flat_map(|view| view.input).collect())
}

/// Up to `most` items, evenly spread.
fn spread<T>(all: &[T], most: usize) -> impl Iterator<Item = &T> {
    let count = most.min(all.len());
    (0..count).map(move |i| &all[i * all.len() / count])
}

/// The input ranges of all convolutions that can be computed in int8.
fn observed(
    config: &TrainConfig,
    weights: &Weights,
    step: usize,
    inputs: impl Iterator<Item = Result<Vec<f32>>>,
) -> Result<Int8Calibration> {
    let mut runner = FusedRunner::new(config, weights.clone(), Precision::F32)?;
    let mut seen = SeenInputs::default();
    for input in inputs {
        runner.observe(&input?, &mut seen)?;
    }
    let computed = FusedRunner::computed_in_int8(config, weights.clone())?;
    let mut ranges = seen.ranges();
    ranges.retain(|name, _| computed.contains(name));
    Ok(Int8Calibration {
        step,
        images: seen.images(),
        deviation: 0.0,
        ranges,
    })
}

/// The input ranges, without as many as necessary of the convolutions that harm depth most in int8.
fn found(
    network: &StoredNetwork,
    images: &[Input],
    options: Int8Options<'_>,
    mut shown: impl FnMut(usize, usize),
) -> Result<Int8Calibration> {
    if images.is_empty() {
        return Err(Error::NoImages {
            input: "the arguments".into(),
        });
    }
    let (config, weights) = (&network.config, &network.weights);
    let chosen: Vec<&Input> = spread(images, options.images).collect();
    // One step for each image, then one for each convolution alone.
    let convolutions = FusedRunner::computed_in_int8(config, weights.clone())?.len();
    let all = chosen.len() + convolutions;
    let inputs = chosen.iter().enumerate().map(|(i, input)| {
        shown(i, all);
        prepared(network, input)
    });
    let mut calibration = observed(config, weights, network.step, inputs)?;
    let compared = spread(&chosen, COMPARED_ON);
    let inputs: Vec<Vec<f32>> = compared
        .map(|input| prepared(network, input))
        .collect::<Result<_>>()?;
    let mut exact = FusedRunner::new(config, weights.clone(), Precision::F32)?;
    let exact = disparities(&mut exact, &inputs)?;
    let deviation = |calibration: &Int8Calibration| -> Result<f64> {
        let weights = weights.clone();
        let int8 = Some(calibration);
        let mut runner = FusedRunner::with_calibration(config, weights, Precision::Int8, int8)?;
        Ok(mean_deviation(&disparities(&mut runner, &inputs)?, &exact))
    };
    let mut harm = Vec::with_capacity(convolutions);
    for (i, (name, range)) in calibration.ranges.iter().enumerate() {
        let alone = Int8Calibration {
            ranges: [(name.clone(), *range)].into(),
            ..calibration.clone()
        };
        harm.push((name.clone(), deviation(&alone)?));
        shown(all - convolutions + i + 1, all);
    }
    harm.sort_by(|a, b| a.1.total_cmp(&b.1));
    tracing::debug!(?harm, "each convolution alone in int8");
    loop {
        calibration.deviation = deviation(&calibration)?;
        if calibration.deviation <= options.most_deviation {
            break;
        }
        let Some((worst, _)) = harm.pop() else { break };
        calibration.ranges.remove(&worst);
    }
    Ok(calibration)
}

fn disparities(runner: &mut FusedRunner, inputs: &[Vec<f32>]) -> Result<Vec<f32>> {
    let mut all = Vec::new();
    for input in inputs {
        all.extend(runner.disparity(input)?);
    }
    Ok(all)
}

/// Mean |ln(a / b)|; the same for disparities and for depths.
fn mean_deviation(a: &[f32], b: &[f32]) -> f64 {
    let off = a.iter().zip(b);
    let off = off.map(|(a, b)| (f64::from(*a) / f64::from(*b)).ln().abs());
    off.sum::<f64>() / a.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_are_spread_evenly() {
        let all: Vec<usize> = (0..10).collect();
        let of = |most| spread(&all, most).copied().collect::<Vec<_>>();
        assert_eq!(of(3), [0, 3, 6]);
        assert_eq!(of(20), all);
        assert!(of(0).is_empty());
    }

    #[test]
    fn deviation_is_between_logarithms() {
        let off = mean_deviation(&[1.0, 2.0], &[1.0, 1.0]);
        assert!((off - 2_f64.ln() / 2.0).abs() < 1e-12, "{off}");
    }
}
