//! The mean of several networks' weights, as a run of its own.
//!
//! Networks that were trained from the same one lie in one valley of the loss. So the mean of their weights is a network as well, and can be a
//! better one on images that none of them saw: "model soups" (Wortsman et al., arXiv 2203.05482); of a network and the one it began from,
//! arXiv 2109.01903.
//!
//! What batch norms measured of their inputs is averaged like weights, and not measured anew. Where they were frozen (`frozen_statistics`), as in
//! `adapt`, all networks have the same, and the mean is exact; where they were not, [`Averaged::statistics`] says how far apart they are.

mod ancestors;
mod fit;
mod statistics;

use std::path::{Path, PathBuf};

use deepfusion_fs::absolute;
use deepfusion_model::weights::{Weights, read_safetensors_under, write_safetensors};
use deepfusion_model::{
    AveragedNetwork, Checkpoint, CheckpointKind, Error as ModelError, RunFolder, StoredNetwork,
    UNCERTAINTY_PREFIX,
};
use deepfusion_runtime::{ModelSource, unpacked};
use deepfusion_weights::Shipped;

pub use self::ancestors::Kinship;
pub use self::statistics::StatisticsSpread;
use crate::{Error, NoMean, Result};

/// The parts of a run's checkpoint beside the depth network that training goes on with.
const OTHER_PARTS: [&str; 2] = ["pose.", "flow."];

/// What [`average`] wrote.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Averaged {
    /// The new run's checkpoint.
    pub checkpoint: PathBuf,
    /// What it is the mean of, in the order given.
    pub networks: Vec<AveragedNetwork>,
    /// What is known of where they come from.
    pub kinship: Kinship,
    /// Whether some could say how sure they are and others could not, so that the mean cannot.
    pub lost_uncertainty: bool,
    /// How far apart their batch norms measured their inputs; `None` where all measured the same.
    pub statistics: Option<StatisticsSpread>,
}

/// Writes the mean of the depth networks' weights as a new run into `out`: Σ sᵢ·wᵢ / Σ sᵢ, computed in f64; without `shares` all count alike.
///
/// The first must be a run: settings, camera and PoseNet are its own. The others may be packed, or embedded ones by their names. A run's folder
/// stands for the checkpoint that it prefers. Factors of intervals and ranges for int8 belong to one network's weights and are not taken over.
///
/// # Errors
/// [`Error::NoMean`] for networks that are not alike, [`Error::Shares`] for shares that cannot be such, [`Error::Occupied`] where `out` holds anything;
/// networks that cannot be read.
pub fn average(models: &[PathBuf], shares: Option<&[f64]>, out: &Path) -> Result<Averaged> {
    let shares = parts_of(models.len(), shares)?;
    let is_empty = std::fs::read_dir(out).map_or(true, |mut entries| entries.next().is_none());
    if !is_empty {
        return Err(Error::Occupied {
            path: out.to_owned(),
        });
    }
    let mut sources = Vec::with_capacity(models.len());
    let mut networks = Vec::with_capacity(models.len());
    for model in models {
        let source = ModelSource::named(model)?;
        networks.push(load(&source)?);
        sources.push(source);
    }
    let ModelSource::Run { folder, kind, .. } = &sources[0] else {
        return Err(Error::NoMean {
            path: models[0].clone(),
            why: NoMean::Packed,
        });
    };
    for (source, network) in sources.iter().zip(&networks) {
        if let Some(why) = fit::hindrance(&networks[0], network) {
            return Err(Error::NoMean {
                path: source.given().to_owned(),
                why,
            });
        }
    }
    let origins: Vec<AveragedNetwork> = sources.iter().zip(&shares).map(origin).collect();
    let kinship = ancestors::kinship(&origins);

    let weights: Vec<(&Weights, f64)> = networks
        .iter()
        .map(|network| &network.weights)
        .zip(shares)
        .collect();
    let statistics = statistics::spread(&weights);
    let depth = mean(&weights);
    let mut config = folder.read_settings()?;
    config.make_absolute();
    let has_head = |weights: &Weights| {
        weights
            .tensors
            .keys()
            .any(|k| k.starts_with(UNCERTAINTY_PREFIX))
    };
    config.depth_net.uncertainty = has_head(&depth);
    let lost_uncertainty =
        !has_head(&depth) && networks.iter().any(|network| has_head(&network.weights));

    let file = folder.checkpoint_path(*kind);
    let mut all = depth.with_prefix("depth.");
    for part in OTHER_PARTS {
        let own = read_safetensors_under(&file, part).map_err(ModelError::from)?;
        all = all.merged(own.with_prefix(part));
    }
    let state = Checkpoint {
        best_validation: None,
        ..folder.read_state(*kind)?
    };
    all.metadata = state.metadata();
    let mut findings = folder.read_findings()?;
    findings.averaged.clone_from(&origins);
    let run = RunFolder::create(out)?;
    let checkpoint = run.checkpoint_path(CheckpointKind::Last);
    write_safetensors(&checkpoint, &all).map_err(ModelError::from)?;
    run.write_config(&config, &findings)?;
    Ok(Averaged {
        checkpoint,
        networks: origins,
        kinship,
        lost_uncertainty,
        statistics,
    })
}

/// The shares as parts of 1.
fn parts_of(networks: usize, shares: Option<&[f64]>) -> Result<Vec<f64>> {
    let equal = vec![1.0; networks];
    let shares = shares.unwrap_or(&equal);
    let total: f64 = shares.iter().sum();
    let positive = shares.iter().all(|share| *share > 0.0) && total.is_finite();
    if networks == 0 || shares.len() != networks || !positive {
        return Err(Error::Shares {
            found: shares.len(),
            networks,
        });
    }
    Ok(shares.iter().map(|share| share / total).collect())
}

/// The network, whichever of several data sets it learned: their metres do not matter here.
fn load(source: &ModelSource) -> Result<StoredNetwork> {
    match source {
        ModelSource::Packed { network, .. } => Ok(unpacked(network, None)?),
        ModelSource::Run { folder, kind, .. } => {
            if folder.read_state(*kind)?.encoders_only {
                return Err(Error::NoMean {
                    path: source.given().to_owned(),
                    why: NoMean::EncodersOnly,
                });
            }
            let (weights, state) = folder.load_depth_weights(*kind)?;
            Ok(StoredNetwork {
                config: folder.read_config()?,
                camera: folder.read_findings()?.camera,
                weights,
                step: state.step,
                int8: Ok(None),
            })
        }
    }
}

/// Σ sᵢ·wᵢ of the tensors that all have, for shares that add up to 1.
fn mean(networks: &[(&Weights, f64)]) -> Weights {
    let mut mean = networks[0].0.clone();
    mean.tensors
        .retain(|name, _| networks.iter().all(|(w, _)| w.tensors.contains_key(name)));
    for (name, tensor) in &mut mean.tensors {
        let parts: Vec<(&[f32], f64)> = networks
            .iter()
            .map(|(weights, share)| (weights.tensors[name].values.as_slice(), *share))
            .collect();
        for (i, value) in tensor.values.iter_mut().enumerate() {
            let weighted = parts
                .iter()
                .map(|(values, share)| share * f64::from(values[i]));
            *value = weighted.sum::<f64>() as f32;
        }
    }
    mean
}

fn origin((source, share): (&ModelSource, &f64)) -> AveragedNetwork {
    let share = *share;
    match source {
        ModelSource::Run { folder, kind, .. } => AveragedNetwork {
            path: absolute(&folder.checkpoint_path(*kind)),
            sha256: None,
            share,
        },
        // A packed file is found again by its path; an embedded network has a name alone.
        ModelSource::Packed { given, .. } if Shipped::is_at(given) => AveragedNetwork {
            path: absolute(given),
            sha256: None,
            share,
        },
        ModelSource::Packed { given, network } => AveragedNetwork {
            path: given.clone(),
            sha256: Some(network.card.sha256.clone()),
            share,
        },
    }
}

#[cfg(test)]
mod tests;
