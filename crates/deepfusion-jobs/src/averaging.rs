//! The mean of several networks' weights, as a run of its own.
//!
//! Networks fine-tuned from the same network usually lie in one valley of the loss. So the mean of their weights is a working network too,
//! and can be a better one on images that none of them saw: "model soups" (Wortsman et al., arXiv 2203.05482); for a network and the one it
//! was fine-tuned from, arXiv 2109.01903.
//!
//! The statistics of batch norms are averaged like weights, and not measured again. If they were frozen (`frozen_statistics`), as in
//! `adapt`, all networks have the same ones, and the mean is exact; otherwise [`Averaged::statistics`] says how far apart they are.

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

/// The parts of a checkpoint, besides the depth network, that training continues with.
const OTHER_PARTS: [&str; 2] = ["pose.", "flow."];

/// What [`average`] wrote.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Averaged {
    /// The new run's checkpoint.
    pub checkpoint: PathBuf,
    /// The averaged networks, in the order given.
    pub networks: Vec<AveragedNetwork>,
    /// What is known of their common origin.
    pub kinship: Kinship,
    /// Whether the mean has no uncertainty head because only some of the networks had one.
    pub lost_uncertainty: bool,
    /// How far apart the statistics of their batch norms are; `None` if all are the same.
    pub statistics: Option<StatisticsSpread>,
}

/// Writes the mean of the depth networks' weights as a new run into `out`: Σ sᵢ·wᵢ / Σ sᵢ, computed in f64; without `shares`, all weigh the
/// same.
///
/// The first must be a run: the new run takes its settings, camera and PoseNet. The others may be packed networks, or embedded ones by
/// name. A run's folder stands for its preferred checkpoint. Interval factors and int8 ranges belong to one network's weights and are not
/// copied.
///
/// # Errors
/// [`Error::NoMean`] for networks that do not match, [`Error::Shares`] for invalid shares, [`Error::Occupied`] if `out` is not empty;
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

/// The shares, scaled to add up to 1.
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

/// Loads the network. If it learned several data sets, any will do: their metres do not matter here.
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

/// Σ sᵢ·wᵢ of the tensors that all networks have, for shares that add up to 1.
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
        // A packed file can be found again by its path; an embedded network only has a name.
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
