use crate::{Adam, Error, Model, TrainConfig};
use burn::tensor::Device;
use deepfusion_nn::weights::{self, Weights};
use std::path::{Path, PathBuf};

/// The version of the checkpoint's layout; files of another version are refused.
pub const CHECKPOINT_VERSION: u32 = 1;

/// Metadata: the lowest value that `best` was chosen by. Files of before are without it: what was chosen by then held
/// terms that depth cannot change, and is not to be compared with.
const BEST: &str = "best_selection";
/// Metadata: what of the networks was ever trained, where that is not all.
const TRAINED: &str = "trained";
const ENCODERS: &str = "encoders";

/// Which checkpoint of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CheckpointKind {
    /// Everything needed to go on.
    Last,
    /// The networks at the lowest held-out loss that depth can change.
    Best,
}

impl CheckpointKind {
    /// Its name: the file's without the ending.
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

/// Where training stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Checkpoint {
    /// Steps done, skipped ones included.
    pub step: usize,
    /// The lowest value so far that `best` is chosen by.
    pub best_validation: Option<f64>,
    /// Steps skipped for a gradient that was not finite.
    pub skipped: usize,
    /// Whether only the encoders were ever trained: imported ImageNet weights.
    pub encoders_only: bool,
}

/// A run's folder: `config.toml`, `last.safetensors`, `best.safetensors`, logs and panels.
#[derive(Debug, Clone)]
pub struct RunFolder {
    path: PathBuf,
}

impl RunFolder {
    /// An empty folder for a new run.
    ///
    /// # Errors
    /// [`Error::RunExists`] where a run already is; [`Error::Io`].
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

    /// A folder that holds a run, or a checkpoint file in one; the latter also says which checkpoint.
    ///
    /// # Errors
    /// [`Error::Checkpoint`] when there is no run.
    pub fn open(path: &Path) -> Result<(Self, Option<CheckpointKind>), Error> {
        let (folder, kind) = match path.file_name().and_then(|n| n.to_str()) {
            Some("last.safetensors") => (path.parent(), Some(CheckpointKind::Last)),
            Some("best.safetensors") => (path.parent(), Some(CheckpointKind::Best)),
            _ => (Some(path), None),
        };
        let folder = folder.unwrap_or(Path::new("."));
        if !folder.join("config.toml").is_file() {
            let reason = if folder.exists() {
                "this is no run: it has no config.toml"
            } else {
                "no such run"
            };
            return Err(Error::Checkpoint {
                path: path.to_owned(),
                reason: reason.into(),
                remedy: "give the folder that `train`, `demo` or `weights import` wrote".into(),
            });
        }
        let folder = Self {
            path: folder.to_owned(),
        };
        Ok((folder, kind))
    }

    /// The folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The configuration file.
    #[must_use]
    pub fn config_path(&self) -> PathBuf {
        self.path.join("config.toml")
    }

    /// A checkpoint's file.
    #[must_use]
    pub fn checkpoint_path(&self, kind: CheckpointKind) -> PathBuf {
        self.path.join(kind.file())
    }

    /// The checkpoint that the folder as a whole means: the best where there is one, else the last.
    #[must_use]
    pub fn preferred(&self) -> CheckpointKind {
        if self.checkpoint_path(CheckpointKind::Best).exists() {
            CheckpointKind::Best
        } else {
            CheckpointKind::Last
        }
    }

    /// Writes the configuration.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write_config(&self, config: &TrainConfig) -> Result<(), Error> {
        let text = config.to_toml()?;
        let path = self.config_path();
        deepfusion_data::write_atomically::<Error>(&path, |file| {
            std::io::Write::write_all(file, text.as_bytes())
                .map_err(|e| Error::io(&path, "write", e))
        })
    }

    /// Reads the configuration.
    ///
    /// # Errors
    /// As [`TrainConfig::read`].
    pub fn read_config(&self) -> Result<TrainConfig, Error> {
        TrainConfig::read(&self.config_path())
    }

    /// Writes a checkpoint; it replaces the one before only when it is complete.
    ///
    /// # Errors
    /// [`Error::Network`] naming the file.
    pub fn save(
        &self,
        kind: CheckpointKind,
        model: &Model,
        adam: Option<&Adam>,
        state: &Checkpoint,
    ) -> Result<PathBuf, Error> {
        let mut all = weights::collect(&model.depth_net).with_prefix("depth.");
        all = all.merged(weights::collect(&model.pose_net).with_prefix("pose."));
        // Training alone needs it, but whoever starts from `best` trains.
        if let Some(decoder) = &model.flow_decoder {
            all = all.merged(weights::collect(decoder).with_prefix("flow."));
        }
        if let Some(adam) = adam {
            all = all.merged(adam.state().with_prefix("adam."));
            all.metadata
                .insert("adam_steps".into(), adam.steps().to_string());
        }
        let mut note = |key: &str, value: String| all.metadata.insert(key.into(), value);
        note("format_version", CHECKPOINT_VERSION.to_string());
        note("program_version", env!("CARGO_PKG_VERSION").into());
        note("step", state.step.to_string());
        note("skipped", state.skipped.to_string());
        if let Some(best) = state.best_validation {
            // All digits: the comparison must go on exactly.
            note(BEST, format!("{:016x}", best.to_bits()));
        }
        if state.encoders_only {
            note(TRAINED, ENCODERS.into());
        }
        let path = self.checkpoint_path(kind);
        weights::write_safetensors(&path, &all)?;
        Ok(path)
    }

    /// The networks, the optimiser where it was saved, and where training stood.
    ///
    /// # Errors
    /// [`Error::Checkpoint`] for a file of another version, or one that training cannot go on from because it lacks the
    /// flow decoder; [`Error::Network`] for one of another architecture or with other moments than its
    /// parameters', naming the first tensor that differs.
    pub fn load(
        &self,
        kind: CheckpointKind,
        config: &TrainConfig,
        device: &Device,
    ) -> Result<(Model, Option<Adam>, Checkpoint), Error> {
        let path = self.checkpoint_path(kind);
        let all = weights::read(&path)?;
        let state = Checkpoint::of(&path, &all)?;
        let named = |prefix: &str| -> Weights { all.under(prefix) };
        let mut model = Model::new(config, device)?;
        model.depth_net = weights::apply(model.depth_net, &named("depth."))?;
        model.pose_net = weights::apply(model.pose_net, &named("pose."))?;
        let new_decoder = take_flow_decoder(&mut model, &named("flow."))?;
        if !all.metadata.contains_key("adam_steps") {
            return Ok((model, None, state));
        }
        if new_decoder {
            return Err(Error::Checkpoint {
                path,
                reason: "it has no flow decoder, and this configuration trains one".into(),
                remedy: "start a new run from these weights with --init".into(),
            });
        }
        let steps = number(&path, &all, "adam_steps")?;
        let steps = u32::try_from(steps).unwrap_or(u32::MAX);
        let adam = Adam::restore(named("adam."), steps, &model)?;
        Ok((model, Some(adam), state))
    }

    /// The networks of a new run that starts from this one's, and what of them starts anew, because the checkpoint
    /// does not have it. From one whose encoders alone were ever trained, the encoders alone are taken: the rest of
    /// the network may then be another.
    ///
    /// # Errors
    /// [`Error::Checkpoint`] for a file of another version, [`Error::Network`] for one of another architecture, naming
    /// the first tensor that differs.
    pub fn load_networks(
        &self,
        kind: CheckpointKind,
        config: &TrainConfig,
        device: &Device,
    ) -> Result<(Model, Vec<&'static str>), Error> {
        let path = self.checkpoint_path(kind);
        let named = |prefix: &str| weights::read_under(&path, prefix);
        let depth = named("depth.")?;
        let encoders_only = Checkpoint::of(&path, &depth)?.encoders_only;
        let pose = named("pose.")?;
        let mut model = Model::new(config, device)?;
        if encoders_only {
            let (depth, pose) = (depth.under("encoder."), pose.under("encoder."));
            model.depth_net.encoder = weights::apply(model.depth_net.encoder, &depth)?;
            model.pose_net.encoder = weights::apply(model.pose_net.encoder, &pose)?;
            return Ok((model, vec!["everything but the encoders"]));
        }
        let (depth_net, new_head) = model.depth_net.with_weights(&depth)?;
        model.depth_net = depth_net;
        model.pose_net = weights::apply(model.pose_net, &pose)?;
        let new_decoder = take_flow_decoder(&mut model, &named("flow.")?)?;
        let new = [
            new_decoder.then_some("the flow decoder"),
            new_head.then_some("the head for uncertainty"),
        ];
        Ok((model, new.into_iter().flatten().collect()))
    }

    /// Where training stood at a checkpoint; its tensors are not read.
    ///
    /// # Errors
    /// [`Error::Checkpoint`] for a file of another version, [`Error::Network`] for one that cannot be read.
    pub fn read_state(&self, kind: CheckpointKind) -> Result<Checkpoint, Error> {
        let path = self.checkpoint_path(kind);
        Checkpoint::of(&path, &weights::read_under(&path, "no tensor's name")?)
    }

    /// The depth network's weights alone, and where training stood: nothing else of the file is read.
    ///
    /// # Errors
    /// [`Error::Checkpoint`] for a file of another version, [`Error::Network`] for one without a network.
    pub fn load_depth_weights(&self, kind: CheckpointKind) -> Result<(Weights, Checkpoint), Error> {
        let path = self.checkpoint_path(kind);
        let weights = weights::read_under(&path, "depth.")?;
        let state = Checkpoint::of(&path, &weights)?;
        Ok((weights, state))
    }
}

/// Gives the model the flow decoder of a checkpoint. Says whether its own, a new one, stays for want of it.
fn take_flow_decoder(model: &mut Model, saved: &Weights) -> Result<bool, Error> {
    let Some(decoder) = model.flow_decoder.take() else {
        return Ok(false);
    };
    let missing = saved.tensors.is_empty();
    model.flow_decoder = Some(match missing {
        true => decoder,
        false => weights::apply(decoder, saved)?,
    });
    Ok(missing)
}

impl Checkpoint {
    /// What a file's metadata say.
    fn of(path: &Path, file: &Weights) -> Result<Self, Error> {
        let version = number(path, file, "format_version")?;
        if version != CHECKPOINT_VERSION as usize {
            return Err(Error::Checkpoint {
                path: path.to_owned(),
                reason: format!(
                    "checkpoint format {version}, this program reads {CHECKPOINT_VERSION}"
                ),
                remedy: "use the version of the program that wrote it".into(),
            });
        }
        Ok(Self {
            step: number(path, file, "step")?,
            skipped: number(path, file, "skipped")?,
            best_validation: file
                .metadata
                .get(BEST)
                .and_then(|t| u64::from_str_radix(t, 16).ok())
                .map(f64::from_bits),
            encoders_only: file.metadata.get(TRAINED).is_some_and(|t| t == ENCODERS),
        })
    }
}

/// A number among a file's metadata.
fn number(path: &Path, file: &Weights, key: &str) -> Result<usize, Error> {
    let text = file.metadata.get(key);
    text.and_then(|t| t.parse().ok())
        .ok_or_else(|| Error::Checkpoint {
            path: path.to_owned(),
            reason: format!("no checkpoint of this program: `{key}` is missing from its metadata"),
            remedy: "`weights import` reads weights of other programs".into(),
        })
}
