//! Finds trained networks: by path, or by the name of an embedded one.

use std::fmt;
use std::path::{Path, PathBuf};

use deepfusion_geometry::Intrinsics;
use deepfusion_model::{CheckpointKind, Int8Calibration, RunFolder, StoredNetwork, TrainConfig};
use deepfusion_weights::{Card, DEFAULT, Shipped};

use crate::Error;

/// The origin of a trained depth network.
#[derive(Debug)]
pub enum ModelSource {
    /// A run's folder, or a checkpoint in it.
    Run {
        /// The path as given.
        given: PathBuf,
        /// The run's folder.
        folder: RunFolder,
        /// The checkpoint: the given one, or the folder's default.
        kind: CheckpointKind,
    },
    /// A network without a run: an embedded one by its name, or a packed file with its card beside it.
    Packed {
        /// The path or name as given.
        given: PathBuf,
        /// The network.
        network: Box<Shipped>,
    },
}

impl ModelSource {
    /// The default embedded network; `None` if this build has none.
    ///
    /// # Errors
    /// As for [`deepfusion_weights::find`], for a network that exists.
    pub fn embedded_default() -> Result<Option<Self>, Error> {
        let network = embedded(Path::new(DEFAULT))?;
        Ok(network.map(|network| Self::Packed {
            given: DEFAULT.into(),
            network,
        }))
    }

    /// Resolves a path or a name. An existing run or file takes precedence over an embedded network of that name ([`hidden_by_run`] reports
    /// if both exist). A folder of images that has an embedded network's name is ignored.
    ///
    /// # Errors
    /// [`Error::NoSuchModel`] for neither; the errors of [`RunFolder::open`] and [`Shipped::read`] for a path without a network.
    pub fn named(model: &Path) -> Result<Self, Error> {
        let given = model.to_owned();
        if Shipped::is_at(model) {
            let network = Box::new(Shipped::read(model)?);
            return Ok(Self::Packed { given, network });
        }
        if let Some(network) = embedded_unless_run(model)? {
            return Ok(Self::Packed { given, network });
        }
        // A missing checkpoint is reported as such: its folder may be a run.
        if !model.exists() && !names_a_checkpoint(model) {
            return Err(Error::NoSuchModel {
                model: given,
                known: embedded_names(),
            });
        }
        let (folder, kind) = RunFolder::open(model)?;
        let kind = kind.unwrap_or_else(|| folder.preferred());
        Ok(Self::Run {
            given,
            folder,
            kind,
        })
    }

    /// The path or name that was given.
    #[must_use]
    pub fn given(&self) -> &Path {
        match self {
            Self::Run { given, .. } | Self::Packed { given, .. } => given,
        }
    }

    /// The run's folder, if there is one.
    #[must_use]
    pub fn folder(&self) -> Option<&Path> {
        match self {
            Self::Run { folder, .. } => Some(folder.path()),
            Self::Packed { .. } => None,
        }
    }

    /// Loads configuration and weights; `set` names one of the data sets it was trained on, if there are several.
    ///
    /// # Errors
    /// As for [`StoredNetwork::of_checkpoint`] and [`StoredNetwork::packed`].
    pub fn load(&self, set: Option<&str>) -> Result<StoredNetwork, deepfusion_model::Error> {
        match self {
            Self::Run { folder, kind, .. } => StoredNetwork::of_checkpoint(folder, *kind, set),
            Self::Packed { network, .. } => unpacked(network, set),
        }
    }

    /// Its calibration for int8; `None` if it is not calibrated, or the calibration cannot be read.
    #[must_use]
    pub fn int8(&self) -> Option<Int8Calibration> {
        match self {
            Self::Run { folder, kind, .. } => {
                let step = folder.read_state(*kind).ok()?.step;
                Int8Calibration::of_run(folder.path(), step).ok()?
            }
            Self::Packed { network, .. } => {
                let Card { name, int8, .. } = &network.card;
                Int8Calibration::from_table(name, int8.clone()?).ok()
            }
        }
    }

    /// The camera to assume for recordings without one: the camera that the run assumed or learned for such recordings. `None` if all its
    /// recordings stated theirs. `set` as in [`Self::load`].
    ///
    /// # Errors
    /// As for [`RunFolder::read_config`] and [`RunFolder::read_state`], [`deepfusion_model::Error::ConfigFile`].
    pub fn assumed_camera(
        &self,
        set: Option<&str>,
    ) -> Result<Option<Intrinsics>, deepfusion_model::Error> {
        match self {
            Self::Run { folder, kind, .. } => {
                let config = folder.read_config()?;
                match (config.assumed_camera, config.learned_camera()) {
                    (None, _) => Ok(None),
                    // Fixed to this one, whatever the cameras of other recordings were.
                    (Some(fixed), None) => Ok(Some(fixed.intrinsics())),
                    (Some(_), Some(_)) => folder.camera_of(&folder.read_state(*kind)?, set),
                }
            }
            Self::Packed { network, .. } => {
                let read = TrainConfig::from_run_table(network.card.config.clone());
                let (config, findings) = read.map_err(|e| deepfusion_model::Error::ConfigFile {
                    path: network.card.name.clone().into(),
                    reason: e.into(),
                })?;
                Ok(match (config.assumed_camera, config.learned_camera()) {
                    (None, _) => None,
                    (Some(fixed), None) => Some(fixed.intrinsics()),
                    (Some(_), Some(_)) => findings.camera_of(&config, set),
                })
            }
        }
    }

    /// SHA-256 of a packed network's weights; `None` for a run, whose checkpoints change.
    #[must_use]
    pub fn packed_sha256(&self) -> Option<&str> {
        match self {
            Self::Run { .. } => None,
            Self::Packed { network, .. } => Some(&network.card.sha256),
        }
    }
}

/// The embedded network named `model`; `None` if there is none.
///
/// # Errors
/// As for [`deepfusion_weights::find`], for a network that exists.
pub fn embedded(model: &Path) -> Result<Option<Box<Shipped>>, deepfusion_weights::Error> {
    let name = deepfusion_weights::names().find(|name| Path::new(name) == model);
    let network = name.map(deepfusion_weights::find).transpose()?;
    Ok(network.map(Box::new))
}

/// Like [`embedded`], but `None` if a folder of that name contains a run or the remains of one.
///
/// # Errors
/// As for [`embedded`].
pub fn embedded_unless_run(
    model: &Path,
) -> Result<Option<Box<Shipped>>, deepfusion_weights::Error> {
    if contains_run(model) {
        return Ok(None);
    }
    embedded(model)
}

/// Whether a folder contains a run, or the remains of one.
fn contains_run(folder: &Path) -> bool {
    let of_a_run = |path: &Path| path.ends_with("config.toml") || names_a_checkpoint(path);
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    entries.flatten().any(|entry| of_a_run(&entry.path()))
}

/// An embedded network whose name is also that of a run's folder here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HiddenByRun {
    /// The name that both have.
    pub name: &'static str,
}

impl fmt::Display for HiddenByRun {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = self.name;
        write!(
            f,
            "`{name}` is used as the run in the folder of that name, not as the embedded network: write ./{name} to make that \
             clear, or rename the folder to use the embedded network"
        )
    }
}

/// The embedded network of the same name, if [`ModelSource::named`] takes a run instead; `None` if `model` is clearly a path.
#[must_use]
pub fn hidden_by_run(model: &Path) -> Option<HiddenByRun> {
    // Compared as text, not as paths, in which `street/` equals `street`.
    let name = deepfusion_weights::names().find(|name| model.as_os_str() == *name)?;
    contains_run(model).then_some(HiddenByRun { name })
}

/// The names of the embedded networks.
#[must_use]
pub fn embedded_names() -> Vec<&'static str> {
    deepfusion_weights::names().collect()
}

/// A packed network's configuration and weights; `set` as in [`ModelSource::load`].
///
/// # Errors
/// As for [`StoredNetwork::packed`].
pub fn unpacked(
    network: &Shipped,
    set: Option<&str>,
) -> Result<StoredNetwork, deepfusion_model::Error> {
    let Shipped { card, bytes } = network;
    let mut stored =
        StoredNetwork::packed(&card.name, card.config.clone(), bytes, card.steps, set)?;
    let int8 = card.int8.clone();
    stored.int8 = int8
        .map(|table| Int8Calibration::from_table(&card.name, table))
        .transpose();
    Ok(stored)
}

fn names_a_checkpoint(path: &Path) -> bool {
    path.extension().is_some_and(|e| e == "safetensors")
}
