//! Which trained network is meant: `--model`, or the one that the program carries.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use deepfusion_compare::{MetricScale, sha256_of_file};
use deepfusion_eval::IntervalFactors;
use deepfusion_train::{CheckpointKind, RunFolder, StoredNetwork};
use deepfusion_weights::{DEFAULT, Shipped};
use sha2::{Digest, Sha256};

use crate::commands::uncertainty;
use crate::error::CliError;
use crate::output;
use crate::progress::say;

/// Where a trained depth network comes from. Everything that takes `--model` asks this.
#[derive(Debug)]
pub enum ModelSource {
    /// A run's folder, or a checkpoint in it.
    Run {
        /// As it was given.
        given: PathBuf,
        /// The folder.
        folder: RunFolder,
        /// The checkpoint meant: the one given, or the one the folder prefers.
        kind: CheckpointKind,
    },
    /// A network without a run: an embedded one by its name, or a packed file with its card beside it.
    Packed {
        /// As it was given.
        given: PathBuf,
        /// The network.
        network: Box<Shipped>,
    },
}

impl ModelSource {
    /// What `--model` says; without it the network that the program carries, which is told.
    ///
    /// # Errors
    /// As [`Self::named`]; [`CliError::NoModelGiven`] without a word where no network is embedded.
    pub fn of(asked: Option<&Path>) -> Result<Self> {
        match asked {
            Some(model) => Self::named(model),
            None => Self::embedded_default()?.ok_or_else(|| CliError::NoModelGiven.into()),
        }
    }

    /// The network that is meant without a word, which is told; none where this build has none.
    ///
    /// # Errors
    /// As [`deepfusion_weights::find`] for one that is there.
    pub fn embedded_default() -> Result<Option<Self>> {
        if !deepfusion_weights::names().any(|name| name == DEFAULT) {
            return Ok(None);
        }
        let network = Box::new(deepfusion_weights::find(DEFAULT)?);
        say(&format!(
            "no --model: the embedded network `{DEFAULT}` of {} is used",
            network.card.date
        ));
        Ok(Some(Self::Packed {
            given: DEFAULT.into(),
            network,
        }))
    }

    /// What a path or a name says: a path that is there comes first, then an embedded network's name.
    ///
    /// # Errors
    /// [`CliError::NoSuchModel`] for neither; [`RunFolder::open`]'s and [`Shipped::read`]'s for a path that holds no network.
    pub fn named(model: &Path) -> Result<Self> {
        let given = model.to_owned();
        if Shipped::is_at(model) {
            let network = Box::new(Shipped::read(model)?);
            return Ok(Self::Packed { given, network });
        }
        // A checkpoint that is named and not there is told as one: its folder may be a run.
        if !model.exists() && !names_a_checkpoint(model) {
            return match embedded(model)? {
                Some(network) => Ok(Self::Packed { given, network }),
                None => Err(CliError::NoSuchModel {
                    model: given,
                    known: known(),
                }
                .into()),
            };
        }
        let (folder, kind) = RunFolder::open(model)?;
        let kind = kind.unwrap_or_else(|| folder.preferred());
        Ok(Self::Run {
            given,
            folder,
            kind,
        })
    }

    /// As it was given: a path, or a name.
    pub fn given(&self) -> &Path {
        match self {
            Self::Run { given, .. } | Self::Packed { given, .. } => given,
        }
    }

    /// Its name, for people.
    pub fn name(&self) -> String {
        match self {
            Self::Run { folder, .. } => output::name_of(folder.path()),
            Self::Packed { network, .. } => network.card.name.clone(),
        }
    }

    /// The run's folder, where there is one.
    pub fn folder(&self) -> Option<&Path> {
        match self {
            Self::Run { folder, .. } => Some(folder.path()),
            Self::Packed { .. } => None,
        }
    }

    /// Its configuration and weights; `set` names one of the data sets it learned from, where it learned several.
    ///
    /// # Errors
    /// As [`StoredNetwork::of_checkpoint`] and [`StoredNetwork::packed`].
    pub fn load(&self, set: Option<&str>) -> Result<StoredNetwork, deepfusion_train::Error> {
        match self {
            Self::Run { folder, kind, .. } => StoredNetwork::of_checkpoint(folder, *kind, set),
            Self::Packed { network, .. } => unpacked(network, set),
        }
    }

    /// SHA-256 of the weights' file, in hexadecimal.
    ///
    /// # Errors
    /// Where it cannot be read.
    pub fn sha256(&self) -> Result<String> {
        Ok(match self {
            Self::Run { folder, kind, .. } => sha256_of_file(&folder.checkpoint_path(*kind))?,
            Self::Packed { network, .. } => network.card.sha256.clone(),
        })
    }

    /// SHA-256 of a packed network's weights; none of a run's, whose checkpoints change.
    pub fn packed_sha256(&self) -> Option<&str> {
        match self {
            Self::Run { .. } => None,
            Self::Packed { network, .. } => Some(&network.card.sha256),
        }
    }

    /// SHA-256 of configuration, weights and the factors of the intervals: all that what it predicts depends on.
    ///
    /// # Errors
    /// Where they cannot be read.
    pub fn content_sha256(&self) -> Result<String> {
        let mut hash = Sha256::new();
        match self {
            Self::Run { folder, kind, .. } => {
                for path in [folder.config_path(), folder.checkpoint_path(*kind)] {
                    let failed = |e| deepfusion_data::Error::file(&path, e);
                    // In pieces: a checkpoint may be larger than what predicting takes.
                    let mut file = std::fs::File::open(&path).map_err(failed)?;
                    std::io::copy(&mut file, &mut hash).map_err(failed)?;
                }
            }
            Self::Packed { network, .. } => {
                hash.update(network.card.config.to_string());
                hash.update(&network.card.sha256);
            }
        }
        let factors = self.interval_factors()?;
        if factors.is_calibrated() {
            hash.update(toml::to_string(&factors)?);
        }
        Ok(format!("{:x}", hash.finalize()))
    }

    /// The factors of the intervals of a network that says how sure it is: those found for it, else it is taken at its word.
    ///
    /// # Errors
    /// For a file or a card that holds none.
    pub fn interval_factors(&self) -> Result<IntervalFactors> {
        let found = match self {
            Self::Run { folder, .. } => uncertainty::read(folder.path())?,
            Self::Packed { network, .. } => {
                let table = network.card.uncertainty.clone();
                let factors: Option<IntervalFactors> = table
                    .map(toml::Table::try_into)
                    .transpose()
                    .with_context(|| network.card.name.clone())?;
                if let Some(factors) = &factors {
                    let named = || network.card.name.clone();
                    factors.validate().with_context(named)?;
                }
                factors
            }
        };
        Ok(found.unwrap_or_else(IntervalFactors::uncalibrated))
    }

    /// What evaluations that the run's folder keeps say of this checkpoint's metres, with the metres of a data set, for a network that
    /// has learned for `steps`. A packed network keeps none.
    ///
    /// # Errors
    /// As [`Self::sha256`].
    pub fn scale(
        &self,
        set: Option<&str>,
        focal_correction: bool,
        steps: usize,
    ) -> Result<MetricScale> {
        let Some(folder) = self.folder() else {
            return Ok(MetricScale::default());
        };
        let sha256 = self.sha256()?;
        Ok(MetricScale::measured(
            folder,
            &sha256,
            set,
            focal_correction,
            steps,
        ))
    }
}

/// The embedded network that a path which is not there names, if it is the name of one.
///
/// # Errors
/// As [`deepfusion_weights::find`] for one that is there.
pub fn embedded(model: &Path) -> Result<Option<Box<Shipped>>, deepfusion_weights::Error> {
    let name = deepfusion_weights::names().find(|name| Path::new(name) == model);
    let network = name.map(deepfusion_weights::find).transpose()?;
    Ok(network.map(Box::new))
}

/// The names of the embedded networks.
pub fn known() -> Vec<&'static str> {
    deepfusion_weights::names().collect()
}

/// A packed network's configuration and weights; `set` as in [`ModelSource::load`].
///
/// # Errors
/// As [`StoredNetwork::packed`].
pub fn unpacked(
    network: &Shipped,
    set: Option<&str>,
) -> Result<StoredNetwork, deepfusion_train::Error> {
    let Shipped { card, bytes } = network;
    StoredNetwork::packed(&card.name, card.config.clone(), bytes, card.steps, set)
}

fn names_a_checkpoint(path: &Path) -> bool {
    path.extension().is_some_and(|e| e == "safetensors")
}
