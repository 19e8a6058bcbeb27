use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use deepfusion_geometry::Intrinsics;

use crate::weights::{Weights, read_safetensors_under};
use crate::{CHECKPOINT_VERSION, Error, ExpectedSetting, NoRun, TrainConfig, TrainFindings};

/// Metadata key: the lowest validation loss so far, by which `best` is chosen. Older files lack it: they chose by a loss with terms that
/// depth cannot change, which is not comparable.
const BEST: &str = "best_selection";
/// Metadata key: which parts of the networks were ever trained, if not all.
const TRAINED: &str = "trained";
const ENCODERS: &str = "encoders";
/// Metadata key: the learned camera.
const FOCAL: &str = "focal_ratio";

/// Which checkpoint of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CheckpointKind {
    /// Everything needed to continue training.
    Last,
    /// The networks with the lowest held-out loss, counting only terms that depth can change.
    Best,
}

impl CheckpointKind {
    /// The file's name without its extension.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Last => "last",
            Self::Best => "best",
        }
    }

    fn file(self) -> &'static str {
        match self {
            Self::Last => "last.safetensors",
            Self::Best => "best.safetensors",
        }
    }
}

/// The state of training at a checkpoint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Checkpoint {
    /// Number of steps done, including skipped ones.
    pub step: usize,
    /// The lowest validation loss so far, by which `best` is chosen.
    pub best_validation: Option<f64>,
    /// Number of steps skipped because a gradient was not finite.
    pub skipped: usize,
    /// Whether only the encoders were ever trained: imported ImageNet weights.
    pub encoders_only: bool,
    /// f/f₀: the learned focal length divided by the assumed one ([`TrainConfig::camera_learned`]).
    pub focal_ratio: Option<f64>,
}

/// A run's folder: `config.toml`, `last.safetensors`, `best.safetensors`, logs and panels.
#[derive(Debug, Clone)]
pub struct RunFolder {
    path: PathBuf,
}

impl RunFolder {
    /// Creates the folder of a new run.
    ///
    /// # Errors
    /// [`Error::RunExists`] if the folder already contains a run; [`Error::Io`].
    pub fn create(path: &Path) -> Result<Self, Error> {
        if path.join("config.toml").exists() {
            return Err(Error::RunExists {
                path: path.to_owned(),
            });
        }
        std::fs::create_dir_all(path).map_err(|e| Error::io(path, "write", e))?;
        Ok(Self {
            path: path.to_owned(),
        })
    }

    /// The folder of a run that another process creates; neither checked nor written to.
    #[must_use]
    pub fn of_another(path: &Path) -> Self {
        Self {
            path: path.to_owned(),
        }
    }

    /// The folder of an existing run. `path` is that folder or a checkpoint file in it, which also decides the checkpoint.
    ///
    /// # Errors
    /// [`Error::NotARun`].
    pub fn open(path: &Path) -> Result<(Self, Option<CheckpointKind>), Error> {
        let (folder, kind) = match path.file_name().and_then(|n| n.to_str()) {
            Some("last.safetensors") => (path.parent(), Some(CheckpointKind::Last)),
            Some("best.safetensors") => (path.parent(), Some(CheckpointKind::Best)),
            _ => (Some(path), None),
        };
        let folder = folder.unwrap_or(Path::new("."));
        if !folder.join("config.toml").is_file() {
            let reason = if folder.exists() {
                NoRun::NoConfig
            } else {
                NoRun::Missing
            };
            return Err(Error::NotARun {
                path: path.to_owned(),
                reason,
            });
        }
        let folder = Self {
            path: folder.to_owned(),
        };
        Ok((folder, kind))
    }

    /// Path of the folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Path of the configuration file.
    #[must_use]
    pub fn config_path(&self) -> PathBuf {
        self.path.join("config.toml")
    }

    /// Path of a checkpoint's file.
    #[must_use]
    pub fn checkpoint_path(&self, kind: CheckpointKind) -> PathBuf {
        self.path.join(kind.file())
    }

    /// The checkpoint to use if none is named: `best` if it exists, else `last`.
    #[must_use]
    pub fn preferred(&self) -> CheckpointKind {
        if self.checkpoint_path(CheckpointKind::Best).exists() {
            CheckpointKind::Best
        } else {
            CheckpointKind::Last
        }
    }

    /// Checks that a checkpoint exists.
    ///
    /// # Errors
    /// [`Error::NoCheckpoint`].
    pub fn require_checkpoint(&self, kind: CheckpointKind) -> Result<(), Error> {
        if self.checkpoint_path(kind).exists() {
            return Ok(());
        }
        Err(Error::NoCheckpoint {
            path: self.path.clone(),
        })
    }

    /// Writes the configuration, and the run's findings from its data.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write_config(
        &self,
        config: &TrainConfig,
        findings: &TrainFindings,
    ) -> Result<(), Error> {
        let found = findings.to_toml();
        let found = found.map_err(|e| Error::config("findings", ExpectedSetting::TomlValues, e))?;
        let text = config.to_toml()? + &found;
        let path = self.config_path();
        deepfusion_fs::write(&path, text).map_err(|e| Error::io(&path, "write", e))
    }

    /// The configuration as the networks need it: settings left open are filled in from the run's findings.
    ///
    /// # Errors
    /// As for [`TrainConfig::read`].
    pub fn read_config(&self) -> Result<TrainConfig, Error> {
        Ok(self.read_findings()?.complete(self.read_settings()?))
    }

    /// The configuration as set by the user.
    ///
    /// # Errors
    /// As for [`TrainConfig::read`].
    pub fn read_settings(&self) -> Result<TrainConfig, Error> {
        TrainConfig::read(&self.config_path())
    }

    /// The run's findings from its data.
    ///
    /// # Errors
    /// [`Error::NoSuchFile`], [`Error::Io`], [`Error::ConfigFile`].
    pub fn read_findings(&self) -> Result<TrainFindings, Error> {
        let path = self.config_path();
        let text = std::fs::read_to_string(&path).map_err(|e| Error::io(&path, "read", e))?;
        let read = TrainConfig::from_run_text(&text);
        let (_, findings) = read.map_err(|e| Error::ConfigFile {
            path,
            reason: e.into(),
        })?;
        Ok(findings)
    }

    /// The state of training at a checkpoint, read without its tensors.
    ///
    /// # Errors
    /// [`Error::Checkpoint`] for a file of another version, [`Error::Network`] for one that cannot be read.
    pub fn read_state(&self, kind: CheckpointKind) -> Result<Checkpoint, Error> {
        let path = self.checkpoint_path(kind);
        Checkpoint::of(&path, &read_safetensors_under(&path, "no tensor's name")?)
    }

    /// Whether a checkpoint contains a PoseNet. Runs without PoseNet and imported depth networks have none.
    ///
    /// # Errors
    /// [`Error::Network`] for a file that cannot be read.
    pub fn has_pose_net(&self, kind: CheckpointKind) -> Result<bool, Error> {
        let path = self.checkpoint_path(kind);
        Ok(!read_safetensors_under(&path, "pose.")?.tensors.is_empty())
    }

    /// The camera that a checkpoint's network was trained with, at the size of its images; `set` as for [`TrainConfig::for_set`]. If the
    /// run learns its camera, the camera at that step.
    ///
    /// # Errors
    /// As for [`Self::read_config`].
    pub fn camera_of(
        &self,
        state: &Checkpoint,
        set: Option<&str>,
    ) -> Result<Option<Intrinsics>, Error> {
        let config = self.read_config()?;
        let found = self.read_findings()?.camera_of(&config, set);
        let learned = state
            .focal_ratio
            .zip(found)
            .and_then(|(ratio, k)| config.camera_learned(ratio, (k.width, k.height)));
        Ok(learned.or(found))
    }

    /// The depth network's weights alone, and the state of training; nothing else of the file is read.
    ///
    /// # Errors
    /// [`Error::Checkpoint`] for a file of another version, [`Error::Network`] for one without a network.
    pub fn load_depth_weights(&self, kind: CheckpointKind) -> Result<(Weights, Checkpoint), Error> {
        let path = self.checkpoint_path(kind);
        let weights = read_safetensors_under(&path, "depth.")?;
        let state = Checkpoint::of(&path, &weights)?;
        Ok((weights, state))
    }
}

impl Checkpoint {
    /// Checks that the networks can predict; `path` is the checkpoint's file.
    ///
    /// # Errors
    /// [`Error::EncodersOnly`].
    pub fn require_trained(&self, path: &Path) -> Result<(), Error> {
        if self.encoders_only {
            let path = path.to_owned();
            return Err(Error::EncodersOnly { path });
        }
        Ok(())
    }

    /// The checkpoint's state as metadata of its file.
    #[must_use]
    pub fn metadata(&self) -> BTreeMap<String, String> {
        let mut all = BTreeMap::new();
        let mut note = |key: &str, value: String| all.insert(key.to_owned(), value);
        note("format_version", CHECKPOINT_VERSION.to_string());
        note("program_version", env!("CARGO_PKG_VERSION").into());
        note("step", self.step.to_string());
        note("skipped", self.skipped.to_string());
        if let Some(best) = self.best_validation {
            // All bits, so that the comparison continues exactly after a resume.
            note(BEST, format!("{:016x}", best.to_bits()));
        }
        if self.encoders_only {
            note(TRAINED, ENCODERS.into());
        }
        if let Some(ratio) = self.focal_ratio {
            note(FOCAL, ratio.to_string());
        }
        all
    }

    /// The checkpoint's state from the metadata of its file.
    ///
    /// # Errors
    /// [`Error::Checkpoint`] for a file of another version, [`Error::Foreign`] for one of another program.
    pub fn of(path: &Path, file: &Weights) -> Result<Self, Error> {
        let version = Self::number(path, file, "format_version")?;
        if version != CHECKPOINT_VERSION as usize {
            return Err(Error::Checkpoint {
                path: path.to_owned(),
                found: version,
            });
        }
        Ok(Self {
            step: Self::number(path, file, "step")?,
            skipped: Self::number(path, file, "skipped")?,
            best_validation: file
                .metadata
                .get(BEST)
                .and_then(|t| u64::from_str_radix(t, 16).ok())
                .map(f64::from_bits),
            encoders_only: file.metadata.get(TRAINED).is_some_and(|t| t == ENCODERS),
            focal_ratio: file.metadata.get(FOCAL).and_then(|t| t.parse().ok()),
        })
    }

    /// A number in a file's metadata.
    ///
    /// # Errors
    /// [`Error::Foreign`] if it is missing.
    pub fn number(path: &Path, file: &Weights, key: &str) -> Result<usize, Error> {
        let text = file.metadata.get(key);
        text.and_then(|t| t.parse().ok())
            .ok_or_else(|| Error::Foreign {
                path: path.to_owned(),
                key: key.to_owned(),
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Preset;

    /// A run without the table `[findings]`, from an older version: it is read as is, and rewritten without loss.
    #[test]
    fn an_older_run_keeps_its_camera() {
        let at = tempfile::tempdir().unwrap();
        let folder = RunFolder::create(&at.path().join("run")).unwrap();
        let mut config = Preset::Tiny.config();
        config.pose_net.metres_per_unit = 0.8;
        let camera =
            "[camera]\nfx = 230.4\nfy = 230.4\ncx = 159.5\ncy = 47.5\nwidth = 320\nheight = 96\n";
        let text = format!("{}\n{camera}", config.to_toml().unwrap());
        std::fs::write(folder.config_path(), text).unwrap();
        let found = folder.read_findings().unwrap();
        assert_eq!(found.camera.map(|k| k.fx), Some(230.4));
        assert_eq!(folder.read_config().unwrap(), config);

        // As a resumed run does.
        folder
            .write_config(&folder.read_settings().unwrap(), &found)
            .unwrap();
        let text = std::fs::read_to_string(folder.config_path()).unwrap();
        assert!(text.contains("[findings.camera]"), "{text}");
        assert_eq!(folder.read_findings().unwrap(), found);
        assert_eq!(folder.read_config().unwrap(), config);
    }
}
