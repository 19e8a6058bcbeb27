//! The mean of several networks' weights, as a run of its own.
//!
//! Networks that were trained from the same one lie in one valley of the loss, so that the mean of their weights is a network as well, and can be a better
//! one on images that none of them saw ("model soups", Wortsman et al., arXiv 2203.05482; of a network and the one it began from, arXiv 2109.01903).

use std::collections::{BTreeSet, HashSet};
use std::path::{Path, PathBuf};

use deepfusion_eval::compare::sha256_of_file;
use deepfusion_model::weights::{Weights, read_safetensors_under, write_safetensors};
use deepfusion_model::{
    Checkpoint, CheckpointKind, Error as ModelError, RunFolder, StoredNetwork, TrainConfig,
    WeightsOrigin,
};
use deepfusion_runtime::ModelSource;
use deepfusion_weights::Shipped;

use crate::{Error, NoMean, Result};

/// The parts of a run's checkpoint beside the depth network that training goes on with.
const OTHER_PARTS: [&str; 2] = ["pose.", "flow."];

/// The head for uncertainty, which a network may lack or get anew.
const UNCERTAINTY: &str = "uncertainty.";

/// What [`average`] wrote.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Averaged {
    /// The new run's checkpoint.
    pub checkpoint: PathBuf,
    /// Whether all networks are known to come from one. Others' mean may be worth nothing.
    pub related: bool,
}

/// Writes the mean of the depth networks' weights as a new run into `out`: Σ sᵢ·wᵢ / Σ sᵢ, computed in f64; without `shares` all count alike.
///
/// The first must be a run: settings, findings and PoseNet are its own, and the head for uncertainty where not all have one. The others may be packed, or embedded ones by their names. Factors of intervals
/// and ranges for int8 belong to one network's weights and are not taken over.
///
/// # Errors
/// [`Error::NoMean`] for networks that are not alike, and shares that are none; networks that cannot be read;
/// [`ModelError::RunExists`] where `out` holds a run.
pub fn average(models: &[PathBuf], shares: Option<&[f64]>, out: &Path) -> Result<Averaged> {
    let sources = models
        .iter()
        .map(|model| Ok(ModelSource::named(model)?))
        .collect::<Result<Vec<_>>>()?;
    let refuse = |source: &ModelSource, why| Error::NoMean {
        path: source.given().to_owned(),
        why,
    };
    let Some(first) = sources.first() else {
        return Err(Error::NoMean {
            path: out.to_owned(),
            why: NoMean::Shares,
        });
    };
    let ModelSource::Run { folder, kind, .. } = first else {
        return Err(refuse(first, NoMean::Packed));
    };
    let equal = vec![1.0; sources.len()];
    let shares = shares.unwrap_or(&equal);
    if shares.len() != sources.len() || shares.iter().any(|s| !(s.is_finite() && *s > 0.0)) {
        return Err(refuse(first, NoMean::Shares));
    }
    for source in &sources {
        let ModelSource::Run { folder, kind, .. } = source else {
            continue;
        };
        let state = folder.read_state(*kind)?;
        if state.encoders_only {
            return Err(refuse(source, NoMean::EncodersOnly));
        }
        if state.focal_ratio.is_some() {
            return Err(refuse(source, NoMean::LearnedCamera));
        }
    }
    let networks = sources
        .iter()
        .map(|source| Ok(source.load(None)?))
        .collect::<Result<Vec<_>>>()?;
    for (source, network) in sources.iter().zip(&networks) {
        if let Some(what) = difference(&networks[0], network) {
            return Err(refuse(source, NoMean::Other(what)));
        }
    }
    let weights = networks.iter().map(|network| &network.weights);
    let depth = mean(&weights.zip(shares.iter().copied()).collect::<Vec<_>>());

    let mut config = folder.read_settings()?;
    let others = sources[1..].iter().map(origin);
    config.averaged_with.extend(others);
    config.make_absolute();
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
    let run = RunFolder::create(out)?;
    run.write_config(&config, &folder.read_findings()?)?;
    let checkpoint = run.checkpoint_path(CheckpointKind::Last);
    write_safetensors(&checkpoint, &all).map_err(ModelError::from)?;
    Ok(Averaged {
        checkpoint,
        related: related(&sources)?,
    })
}

/// Σ sᵢ·wᵢ / Σ sᵢ of the tensors that all have; the others are the first network's.
fn mean(networks: &[(&Weights, f64)]) -> Weights {
    let total: f64 = networks.iter().map(|(_, share)| share).sum();
    let mut mean = networks[0].0.clone();
    for (name, tensor) in &mut mean.tensors {
        let all: Option<Vec<(&[f32], f64)>> = networks
            .iter()
            .map(|(weights, share)| Some((&weights.tensors.get(name)?.values[..], *share)))
            .collect();
        let Some(all) = all else {
            continue;
        };
        for (i, value) in tensor.values.iter_mut().enumerate() {
            let sum: f64 = all.iter().map(|(v, share)| share * f64::from(v[i])).sum();
            *value = (sum / total) as f32;
        }
    }
    mean
}

/// What makes another network's weights mean something else than the first's.
fn difference(first: &StoredNetwork, other: &StoredNetwork) -> Option<&'static str> {
    let (a, b) = (&first.config, &other.config);
    let shapes = |network: &StoredNetwork| {
        let tensors = network.weights.tensors.iter();
        tensors
            .filter(|(name, _)| !name.starts_with(UNCERTAINTY))
            .map(|(name, tensor)| (name.clone(), tensor.shape.clone()))
            .collect::<BTreeSet<_>>()
    };
    let checks = [
        (shapes(first) != shapes(other), "has other layers"),
        (
            a.depth_net.range != b.depth_net.range,
            "has another range of depths",
        ),
        (
            a.canonical_focal_px != b.canonical_focal_px,
            "has another canonical focal length",
        ),
        (
            a.depth_net.encoder.normalisation != b.depth_net.encoder.normalisation,
            "normalises images otherwise",
        ),
    ];
    checks
        .into_iter()
        .find_map(|(differs, what)| differs.then_some(what))
}

fn origin(source: &ModelSource) -> WeightsOrigin {
    let given = source.given();
    // A packed file is found again by its path; an embedded network has a name alone.
    let sha256 = source.packed_sha256().filter(|_| !Shipped::is_at(given));
    WeightsOrigin {
        path: given.to_owned(),
        sha256: sha256.map(str::to_owned),
    }
}

/// Whether all of them come from one network, as far as their configurations say.
fn related(sources: &[ModelSource]) -> Result<bool> {
    let mut common: Option<HashSet<String>> = None;
    for source in sources {
        let mut ancestors = HashSet::new();
        add_ancestors(&origin(source), &mut ancestors)?;
        common = Some(match common {
            None => ancestors,
            Some(common) => common.intersection(&ancestors).cloned().collect(),
        });
    }
    Ok(common.is_some_and(|common| !common.is_empty()))
}

/// A network and those that it began from: runs by their folders, other files by what is in them.
fn add_ancestors(origin: &WeightsOrigin, found: &mut HashSet<String>) -> Result<()> {
    let path = std::path::absolute(&origin.path).unwrap_or_else(|_| origin.path.clone());
    let config: Option<TrainConfig> = match (&origin.sha256, RunFolder::open(&path)) {
        (Some(sha256), _) => {
            found.insert(sha256.clone());
            None
        }
        (None, Ok((folder, _))) => {
            // Once around is enough.
            let new = found.insert(folder.path().display().to_string());
            if new {
                Some(folder.read_settings()?)
            } else {
                None
            }
        }
        (None, Err(_)) => {
            if path.is_file() {
                found.insert(sha256_of_file(&path)?);
            }
            None
        }
    };
    for origin in config.iter().flat_map(|config| config.beginning()) {
        add_ancestors(&origin, found)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_geometry::DepthRange;
    use deepfusion_model::weights::{WeightTensor, read_safetensors};
    use deepfusion_model::{Preset, TrainFindings};

    fn weights(tensors: &[(&str, [f32; 2])]) -> Weights {
        let mut weights = Weights::new("test");
        for (name, values) in tensors {
            let (shape, values) = (vec![2], values.to_vec());
            let tensor = WeightTensor { shape, values };
            weights.tensors.insert((*name).into(), tensor);
        }
        weights
    }

    const STATE: Checkpoint = Checkpoint {
        step: 7,
        best_validation: Some(0.25),
        skipped: 0,
        encoders_only: false,
        focal_ratio: None,
    };

    /// A run of that folder's name, as `last`.
    fn run(
        folder: &Path,
        tensors: &[(&str, [f32; 2])],
        state: Checkpoint,
        change: impl FnOnce(&mut TrainConfig),
    ) -> PathBuf {
        let run = RunFolder::create(folder).unwrap();
        let mut config = Preset::Tiny.config();
        change(&mut config);
        run.write_config(&config, &TrainFindings::default())
            .unwrap();
        let mut all = weights(tensors);
        all.metadata = state.metadata();
        write_safetensors(&run.checkpoint_path(CheckpointKind::Last), &all).unwrap();
        folder.to_owned()
    }

    #[test]
    fn shares_need_not_add_up_to_one() {
        let (a, b) = (
            weights(&[("a", [1.0, -2.0])]),
            weights(&[("a", [5.0, 2.0])]),
        );
        let values = |shares: [f64; 2]| {
            let mean = mean(&[(&a, shares[0]), (&b, shares[1])]);
            mean.tensors["a"].values.clone()
        };
        assert_eq!(values([1.0, 1.0]), [3.0, 0.0]);
        assert_eq!(values([3.0, 1.0]), [2.0, -1.0]);
        assert_eq!(values([0.3, 0.1]), values([3.0, 1.0]));
    }

    #[test]
    fn depth_is_the_mean_and_the_rest_the_firsts() {
        let at = tempfile::tempdir().unwrap();
        let at = at.path();
        let of = |depth, pose, adam| {
            [
                ("depth.a", depth),
                ("pose.a", pose),
                ("adam.m.depth.a", adam),
            ]
        };
        let tensors = of([1.0, 2.0], [8.0, 9.0], [1.0, 1.0]);
        let first = run(&at.join("first"), &tensors, STATE, |_| {});
        let mut tensors = of([3.0, 6.0], [0.0, 0.0], [1.0, 1.0]).to_vec();
        tensors.push(("depth.uncertainty.bias", [5.0, 5.0]));
        let second = run(&at.join("second"), &tensors, STATE, |config| {
            config.init = Some(first.join("last.safetensors"));
        });
        let made = average(&[first.clone(), second.clone()], None, &at.join("mean")).unwrap();
        assert!(made.related);
        let found = read_safetensors(&made.checkpoint).unwrap();
        let expected = weights(&[("depth.a", [2.0, 4.0]), ("pose.a", [8.0, 9.0])]);
        assert_eq!(found.tensors, expected.tensors);
        let (folder, _) = RunFolder::open(&made.checkpoint).unwrap();
        let state = folder.read_state(CheckpointKind::Last).unwrap();
        assert_eq!((state.step, state.best_validation), (7, None));
        let config = folder.read_settings().unwrap();
        let with = WeightsOrigin {
            path: second.clone(),
            sha256: None,
        };
        assert_eq!(config.averaged_with, [with]);
        assert!(config.without_places().averaged_with.is_empty());
        // What is there stays.
        let again = average(&[first, second], None, &at.join("mean"));
        assert!(matches!(
            again,
            Err(Error::Model(ModelError::RunExists { .. }))
        ));
    }

    #[test]
    fn what_has_no_mean_is_refused() {
        let at = tempfile::tempdir().unwrap();
        let at = at.path();
        let layers = [("depth.a", [1.0, 2.0])];
        let first = run(&at.join("first"), &layers, STATE, |_| {});
        let alone = run(&at.join("alone"), &layers, STATE, |_| {});
        let both = [first.clone(), alone];
        let made = average(&both, None, &at.join("strangers")).unwrap();
        assert!(!made.related, "neither began from the other");
        for shares in [&[1.0][..], &[1.0, 0.0], &[1.0, f64::NAN]] {
            let refused = average(&both, Some(shares), &at.join("no"));
            assert!(matches!(
                refused,
                Err(Error::NoMean {
                    why: NoMean::Shares,
                    ..
                })
            ));
        }
        let plain = |_: &mut TrainConfig| {};
        let learned = Checkpoint {
            focal_ratio: Some(1.1),
            ..STATE
        };
        let encoders = Checkpoint {
            encoders_only: true,
            ..STATE
        };
        let others = [
            run(&at.join("layers"), &[("depth.b", [1.0, 2.0])], STATE, plain),
            run(&at.join("range"), &layers, STATE, |config| {
                config.depth_net.initial_depth_m = None;
                config.depth_net.range = DepthRange {
                    min_m: 0.5,
                    max_m: 7.0,
                };
            }),
            run(&at.join("canonical"), &layers, STATE, |config| {
                config.canonical_focal_px = Some(300.0);
            }),
            run(&at.join("learned"), &layers, learned, plain),
            run(&at.join("encoders"), &layers, encoders, plain),
        ];
        for other in others {
            let refused = average(&[first.clone(), other.clone()], None, &at.join("no"));
            let Err(Error::NoMean { path, .. }) = refused else {
                panic!("{}: {refused:?}", other.display());
            };
            assert_eq!(path, other);
        }
        assert!(!at.join("no").exists());
    }
}
