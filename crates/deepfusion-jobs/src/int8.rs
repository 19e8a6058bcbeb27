//! Calibration for int8: what a network's convolutions read on images of the user's.

use std::path::PathBuf;

use deepfusion_data::{load_photo, to_network_input};
use deepfusion_model::weights::Weights;
use deepfusion_model::{Int8Calibration, StoredNetwork, TrainConfig};
use deepfusion_runtime::{FusedRunner, InputRanges, ModelSource, Precision, Preparer};
use deepfusion_sim::{SimConfig, Simulation};
use deepfusion_weights::Shipped;

use crate::{Error, Input, Result};

/// Looks at `most` of the images, evenly spread, and keeps the ranges beside the network: in the run's folder, or in the packed file's
/// card. `shown` hears how many are done, of how many. Returns what was found and the file that holds it.
///
/// # Errors
/// [`Error::NoImages`] for none, [`Error::EmbeddedNetwork`] for a network inside the program, images that cannot be read, a file that
/// cannot be written.
pub fn calibrate(
    source: &ModelSource,
    images: &[Input],
    most: usize,
    mut shown: impl FnMut(usize, usize),
) -> Result<(Int8Calibration, PathBuf)> {
    let packed = match source {
        ModelSource::Packed { given, .. } if !Shipped::is_at(given) => {
            return Err(Error::EmbeddedNetwork {
                name: given.display().to_string(),
            });
        }
        ModelSource::Packed { given, network } => Some((given, network)),
        ModelSource::Run { .. } => None,
    };
    let network = source.load(None)?;
    let chosen = spread(images, most);
    let seen = observed(&network, &chosen, |done| shown(done, chosen.len()))?;
    let calibration = Int8Calibration::new(network.step, &seen);
    let path = match (packed, source.folder()) {
        (Some((given, network)), _) => {
            let mut network = network.clone();
            network.card.int8 = Some(toml::Table::try_from(&calibration)?);
            let folder = given.parent().unwrap_or(std::path::Path::new("."));
            let [card, _] = network.write(folder, true)?;
            card
        }
        (None, Some(folder)) => calibration.write(folder)?,
        (None, None) => unreachable!("a network is packed or a run's"),
    };
    Ok((calibration, path))
}

/// What a network of these weights reads of a simulated street: enough to time int8 where no weights are trained.
///
/// # Errors
/// Weights of another network.
pub fn on_a_street(config: &TrainConfig, weights: &Weights) -> Result<Int8Calibration> {
    let (width, height) = (config.size.width as u32, config.size.height as u32);
    let street = Simulation::new(&SimConfig {
        frames: 1,
        width,
        height,
        ..SimConfig::default()
    })?;
    let input = to_network_input(&street.frame(0).rgb, [0, 0, width, height], width, height);
    let mut runner = FusedRunner::new(config, weights.clone(), Precision::F32)?;
    let mut seen = InputRanges::default();
    runner.observe(&input, &mut seen)?;
    Ok(Int8Calibration::new(0, &seen))
}

/// Up to `most` of them, as far apart as they can be.
fn spread(images: &[Input], most: usize) -> Vec<&Input> {
    let count = most.min(images.len());
    (0..count)
        .map(|i| &images[i * images.len() / count])
        .collect()
}

fn observed(
    network: &StoredNetwork,
    images: &[&Input],
    mut done: impl FnMut(usize),
) -> Result<InputRanges> {
    let config = &network.config;
    // At the size trained with, whatever the image's.
    let preparer = Preparer {
        size: config.size,
        training_camera: network.camera,
        canonical_focal_px: None,
    };
    let mut runner = FusedRunner::new(config, network.weights.clone(), Precision::F32)?;
    let mut seen = InputRanges::default();
    for (i, input) in images.iter().enumerate() {
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
        let prepared = preparer.prepare(&image, camera.as_ref(), false, true);
        runner.observe(&prepared.input, &mut seen)?;
        done(i + 1);
    }
    if images.is_empty() {
        return Err(Error::NoImages {
            input: "the arguments".into(),
        });
    }
    Ok(seen)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_are_taken_from_all_over() {
        let inputs: Vec<Input> = (0..10)
            .map(|i| Input {
                path: format!("{i}.png").into(),
                name: i.to_string(),
                frame: None,
            })
            .collect();
        let names = |most| {
            let chosen = spread(&inputs, most);
            chosen
                .iter()
                .map(|i| i.name.as_str())
                .collect::<Vec<_>>()
                .concat()
        };
        assert_eq!(
            (names(3), names(20)),
            ("036".to_owned(), "0123456789".to_owned())
        );
        assert_eq!(names(0), "");
    }
}
