//! Packs a run's depth network into a file, with a card that describes it.

mod past;

use std::path::{Path, PathBuf};

use deepfusion_data::to_network_input;
use deepfusion_eval::compare::sha256_of_file;
use deepfusion_model::weights::read_bytes;
use deepfusion_model::{
    AveragedNetwork, CheckpointKind, Error as ModelError, Int8Calibration, RunFolder,
    StoredNetwork, TrainConfig, depth_graph_with_uncertainty,
};
use deepfusion_runtime::{DepthRunner, FusedRunner, ModelSource, Precision};
use deepfusion_sim::{SimConfig, Simulation};
use deepfusion_weights::{Card, FORMAT_VERSION, NUMBERS, Shipped, Tensor, pack};

use crate::figures::{figures, names};
use crate::{Error, Result, StaleCalibration, dates, intervals};

/// Entries of the card that do not follow from the run.
#[derive(Debug, Clone, Default)]
pub struct PackOptions {
    /// Which checkpoint to pack; `None`: the one given with the run, or the one that the folder prefers.
    pub checkpoint: Option<CheckpointKind>,
    /// The network's name: letters a to z, digits and dashes.
    pub name: String,
    /// A note about it.
    pub note: Option<String>,
    /// How to make it again.
    pub recipe: Option<String>,
    /// Its licence.
    pub licence: String,
    /// Whether it was trained only on simulated images. This is checked as far as its run and its ancestors record it.
    pub simulated_only: bool,
}

/// The result of [`pack_run`].
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct PackedRun {
    /// The network with its card.
    pub shipped: Shipped,
    /// If it should count as trained only on simulated images: the recordings and networks in its past for which this cannot be shown. The
    /// card contains the claim nevertheless.
    pub not_known_as_simulated: Vec<PathBuf>,
    /// Interval factors beside the run that belong to another step, so that the card has none.
    pub stale: Option<StaleCalibration>,
}

/// Packs the depth network of a run (its folder, or a checkpoint in it): kernels rounded to bf16, vectors in f32.
///
/// # Errors
/// [`Error::PackedAlready`], [`Error::NothingToPack`], [`Error::SawReal`]; a run that cannot be read.
pub fn pack_run(model: &Path, options: PackOptions) -> Result<PackedRun> {
    if Shipped::is_at(model) {
        let path = model.to_owned();
        return Err(Error::PackedAlready { path });
    }
    let (folder, given) = RunFolder::open(model)?;
    let kind = options.checkpoint.or(given);
    let kind = kind.unwrap_or_else(|| folder.preferred());
    let file = folder.checkpoint_path(kind);
    if folder.read_state(kind)?.encoders_only {
        return Err(Error::NothingToPack { path: file });
    }
    let (config, mut findings) = (folder.read_config()?, folder.read_findings()?);
    let not_known_as_simulated = if options.simulated_only {
        past::not_known_as_simulated(folder.path(), &config, &findings)?
    } else {
        Vec::new()
    };
    let (weights, state) = folder.load_depth_weights(kind)?;
    if state.focal_ratio.is_some()
        && let Some(camera) = folder.camera_of(&state, None)?
    {
        // The camera at this step, without the standard deviation of another step.
        findings.learn_camera(&config, camera);
        findings.learned_camera = findings.learned_camera.filter(|l| l.step == state.step);
    }
    let network = StoredNetwork {
        config: config.clone(),
        camera: findings.camera,
        weights,
        step: state.step,
        int8: Int8Calibration::of_run(folder.path(), state.step),
    };
    // Checks that the weights are complete, and contain nothing else.
    depth_graph_with_uncertainty(&network.config.depth_net, network.weights.clone())
        .map_err(ModelError::from)?;
    let tensors = network.weights.tensors.iter();
    let tensors: Vec<Tensor> = tensors
        .map(|(name, tensor)| Tensor {
            name,
            shape: &tensor.shape,
            values: &tensor.values,
        })
        .collect();
    let bytes = pack(&tensors)?;
    let modified = std::fs::metadata(&file).and_then(|meta| meta.modified());
    let modified = modified.map_err(|e| deepfusion_data::Error::file(&file, e))?;
    let parts = config.depth_net.costs(config.size);
    let no_form = |what| move |source| Error::NoTomlForm { what, source };
    let data = recordings(&config, &findings.averaged);
    // Paths on this machine mean nothing elsewhere.
    findings.averaged.clear();
    let card = Card {
        format_version: FORMAT_VERSION,
        name: options.name,
        // Filled in with the bytes.
        sha256: String::new(),
        bytes: 0,
        parameters: parts.iter().map(|part| part.parameters).sum(),
        steps: state.step,
        checkpoint: kind.name().into(),
        date: dates::day(modified),
        data,
        simulated_only: options.simulated_only,
        recipe: options.recipe,
        licence: options.licence,
        numbers: NUMBERS.into(),
        depth_difference: rounded(difference(&network, &bytes)?),
        note: options.note,
        figures: figures(folder.path(), &sha256_of_file(&file)?),
        uncertainty: intervals::read(folder.path(), state.step)?
            .map(toml::Table::try_from)
            .transpose()
            .map_err(no_form("the interval factors cannot be written as TOML"))?,
        int8: network
            .int8
            .clone()
            .map_err(deepfusion_runtime::Error::from)?
            .as_ref()
            .map(toml::Table::try_from)
            .transpose()
            .map_err(no_form("the int8 ranges cannot be written as TOML"))?,
        config: config
            .without_places()
            .to_run_table(&findings)
            .map_err(no_form("the run's configuration cannot be written as TOML"))?,
    };
    Ok(PackedRun {
        shipped: Shipped::new(card, bytes)?,
        not_known_as_simulated,
        stale: intervals::stale(folder.path(), state.step)?,
    })
}

/// The names of the recordings that a run, or the runs that it is the mean of, learned from, as far as these exist.
fn recordings(config: &TrainConfig, averaged: &[AveragedNetwork]) -> Vec<String> {
    let mut all = learned_from(config);
    for network in averaged {
        let others = match ModelSource::named(&network.path) {
            Ok(ModelSource::Packed { network, .. }) => network.card.data,
            Ok(ModelSource::Run { folder, .. }) => match folder.read_config() {
                Ok(config) => learned_from(&config),
                Err(_) => vec![format!("those of {}", network.path.display())],
            },
            Err(_) => vec![format!("those of {}", network.path.display())],
        };
        for name in others {
            if !all.contains(&name) {
                all.push(name);
            }
        }
    }
    all
}

/// The names of the recordings that a run learned from.
fn learned_from(config: &TrainConfig) -> Vec<String> {
    let sets = config.data.sets.iter();
    let recorded = sets.clone().flat_map(|set| &set.paths);
    let simulated = sets.filter(|set| set.simulated.is_some());
    let simulated = simulated.map(|set| format!("{} (simulated views)", set.name));
    let mut names = names(config.data.paths.iter().chain(recorded));
    names.extend(simulated);
    names
}

/// Largest |packed − original| / original over the depths of a simulated picture, both computed in f32.
fn difference(network: &StoredNetwork, bytes: &[u8]) -> Result<f64> {
    let config = &network.config;
    let input = simulated_input(config)?;
    let depth = |weights| -> Result<Vec<f64>> {
        let mut runner = FusedRunner::new(config, weights, Precision::F32)?;
        let disparity = runner.disparity(&input)?;
        Ok(disparity
            .into_iter()
            .map(|d| f64::from(d).recip())
            .collect())
    };
    let original = depth(network.weights.clone())?;
    let packed = read_bytes("the packed network", bytes).map_err(ModelError::from)?;
    let packed = depth(packed)?;
    let relative = original.iter().zip(&packed).map(|(a, b)| (b - a).abs() / a);
    Ok(relative.fold(0.0, f64::max))
}

/// A picture of a simulated street, as the network's input.
///
/// # Errors
/// A size that cannot be simulated.
pub(crate) fn simulated_input(config: &TrainConfig) -> Result<Vec<f32>> {
    let (width, height) = (config.size.width as u32, config.size.height as u32);
    let street = Simulation::new(&SimConfig {
        frames: 1,
        width,
        height,
        ..SimConfig::default()
    })?;
    let picture = street.frame(0).rgb;
    Ok(to_network_input(
        &picture,
        [0, 0, width, height],
        width,
        height,
    ))
}

/// Rounds to three digits: the last ones depend on the processor.
fn rounded(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_digits_are_kept() {
        assert_eq!(rounded(0.001_234_5), 0.001_23);
        assert_eq!(rounded(0.0), 0.0);
    }
}
