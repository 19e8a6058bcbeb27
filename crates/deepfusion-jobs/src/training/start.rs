//! What a new run starts from: the requested network, its configuration's `init`, or an embedded network.

use std::fmt;
use std::path::{Path, PathBuf};

use deepfusion_model::weights::{Weights, read_bytes};
use deepfusion_model::{
    CheckpointKind, DepthNetConfig, Error as ModelError, RunFolder, TrainConfig, TrainFindings,
};
use deepfusion_nn::weights::load_torchvision_resnet;
use deepfusion_runtime::{
    Error as RuntimeError, ModelSource, embedded, embedded_names, embedded_unless_run,
    hidden_by_run,
};
use deepfusion_train::{Checkpoints, Device, Error as TrainError, Model};
use deepfusion_weights::Shipped;

use super::{OtherMeaning, pose_unit};
use crate::held_out::is_run;
use crate::{Error, Result};

/// The weights of a new run before its first step.
#[derive(Debug)]
pub enum Start {
    /// Random weights, by the seed.
    Nothing,
    /// Random weights, by the seed: an embedded network was wanted, but none matches the configuration.
    NoneFits,
    /// A run's weights, or an ImageNet encoder's.
    Path(PathBuf),
    /// A packed network's weights; `path` is `None` for an embedded one.
    Packed {
        /// The network.
        network: Box<Shipped>,
        /// Path of its file.
        path: Option<PathBuf>,
    },
}

/// What a new run starts from, as it is reported.
#[derive(Debug)]
#[non_exhaustive]
pub enum StartReport<'a> {
    /// An embedded network was wanted, but none matches the configuration.
    NoneFits,
    /// A packed network.
    Packed {
        /// The network.
        network: &'a Shipped,
        /// Path of its file; `None` for an embedded network.
        path: Option<&'a Path>,
        /// Parts that start with random weights.
        new: Vec<&'static str>,
    },
    /// A run's checkpoint.
    Run {
        /// Path of its file.
        checkpoint: PathBuf,
        /// Parts that start with random weights.
        new: Vec<&'static str>,
    },
    /// A warning about the weights that are reported next.
    OtherMeaning(OtherMeaning),
}

impl fmt::Display for StartReport<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let new = match self {
            Self::NoneFits => {
                return f.write_str(
                    "starts from random weights: no embedded network has this configuration's layers and depth range",
                );
            }
            Self::Packed {
                network,
                path: None,
                new,
            } => {
                let card = &network.card;
                let (name, date) = (&card.name, &card.date);
                write!(f, "starts from the embedded network `{name}` of {date}")?;
                new
            }
            Self::Packed {
                path: Some(path),
                new,
                ..
            } => {
                write!(f, "starts from {}", path.display())?;
                new
            }
            Self::Run { checkpoint, new } => {
                write!(f, "starts from {}", checkpoint.display())?;
                new
            }
            Self::OtherMeaning(warning) => return write!(f, "{warning}"),
        };
        match new.as_slice() {
            [] => Ok(()),
            parts => write!(f, "; new: {}", parts.join(", ")),
        }
    }
}

/// The configuration of a mean of several networks, which was not trained itself: its settings are those of the first network, so training
/// with them repeats that network's training.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct SettingsOfMean {
    /// The first network.
    pub first: PathBuf,
    /// Number of averaged networks.
    pub networks: usize,
    /// The mean's own folder, if the file is its `config.toml` and its weights exist.
    pub folder: Option<PathBuf>,
}

impl SettingsOfMean {
    /// Finds out whether a configuration read from a file belongs to a mean. It does not if it starts from another network than the first
    /// network's run did: the user has then chosen the start.
    ///
    /// # Errors
    /// As [`TrainFindings::read`].
    pub fn of(file: &Path, config: &TrainConfig) -> Result<Option<Self>> {
        let averaged = TrainFindings::read(file)?.averaged;
        let Some(first) = averaged.first() else {
            return Ok(None);
        };
        let first_run = RunFolder::open(&first.path).and_then(|(run, _)| run.read_settings());
        let is_chosen =
            config.init.is_some() && first_run.is_ok_and(|run| start_of(&run) != start_of(config));
        Ok((!is_chosen).then(|| Self {
            first: first.path.clone(),
            networks: averaged.len(),
            folder: run_around(file),
        }))
    }
}

/// What a configuration starts from, independent of the folder that it was written in.
fn start_of(config: &TrainConfig) -> (Option<PathBuf>, Option<String>) {
    let mut config = config.clone();
    config.make_absolute();
    (config.init, config.init_sha256)
}

/// The run that a file is the configuration of, if the run's weights exist.
fn run_around(file: &Path) -> Option<PathBuf> {
    let folder = file.parent()?;
    let folder = if folder == Path::new("") {
        Path::new(".")
    } else {
        folder
    };
    let (run, _) = RunFolder::open(folder).ok()?;
    let is_its = run.config_path().file_name() == file.file_name();
    let has_weights = run.checkpoint_path(run.preferred()).is_file();
    (is_its && has_weights).then(|| folder.to_owned())
}

impl fmt::Display for SettingsOfMean {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "this configuration belongs to a mean of {} networks: it has the settings of the first, {}, and would repeat its training",
            self.networks,
            self.first.display()
        )
    }
}

impl Start {
    /// Whether a requested start is the word `none`: no network.
    #[must_use]
    pub fn is_none(init: &Path) -> bool {
        init == Path::new("none")
    }

    /// The requested start, or the one named in the configuration, or, with `by_default`, the embedded network that matches the
    /// configuration. A configuration read from a file without a start means random weights: a run repeated from its config.toml starts as
    /// it did, whatever is embedded. A name that is both a run's folder and an embedded network's is a warning ([`tracing::warn`]).
    ///
    /// # Errors
    /// [`RuntimeError::NoSuchModel`] for a network that neither exists nor is embedded; [`Error::OtherStart`] if a configuration started
    /// from other weights with the same name; an error of [`Shipped::read`].
    pub fn of(asked: Option<&Path>, config: &TrainConfig, by_default: bool) -> Result<Self> {
        if let Some(init) = asked {
            return Self::named(init);
        }
        let Some(init) = &config.init else {
            return if by_default {
                Self::embedded_for(config)
            } else {
                Ok(Self::Nothing)
            };
        };
        let Some(expected) = &config.init_sha256 else {
            return Self::named(init);
        };
        let Some(network) = embedded(init)? else {
            return Err(RuntimeError::NoSuchModel {
                model: init.clone(),
                known: embedded_names(),
            }
            .into());
        };
        if network.card.sha256 != *expected {
            return Err(Error::OtherStart {
                name: network.card.name,
                found: network.card.sha256,
                expected: expected.clone(),
            });
        }
        let path = None;
        Ok(Self::Packed { network, path })
    }

    /// A start from a network that was found.
    #[must_use]
    pub fn from_source(source: &ModelSource) -> Self {
        match source {
            ModelSource::Run { folder, kind, .. } => Self::Path(folder.checkpoint_path(*kind)),
            ModelSource::Packed { given, network } => Self::Packed {
                network: network.clone(),
                path: Shipped::is_at(given).then(|| given.clone()),
            },
        }
    }

    fn named(init: &Path) -> Result<Self> {
        if Self::is_none(init) {
            return Ok(Self::Nothing);
        }
        if Shipped::is_at(init) {
            let network = Box::new(Shipped::read(init)?);
            let path = Some(init.to_owned());
            return Ok(Self::Packed { network, path });
        }
        if let Some(network) = embedded_unless_run(init)? {
            let path = None;
            return Ok(Self::Packed { network, path });
        }
        if init.exists() {
            if let Some(hidden) = hidden_by_run(init) {
                tracing::warn!("{hidden}");
            }
            return Ok(Self::Path(init.to_owned()));
        }
        Err(RuntimeError::NoSuchModel {
            model: init.to_owned(),
            known: embedded_names(),
        }
        .into())
    }

    /// The embedded network with the same layers and range of depths: [`Self::NoneFits`] if none matches, and [`Self::Nothing`] in a build
    /// without embedded networks, where a message would be pointless.
    ///
    /// # Errors
    /// An embedded network that cannot be read.
    pub fn embedded_for(config: &TrainConfig) -> Result<Self> {
        let networks = deepfusion_weights::all()?;
        for network in &networks {
            let of_its_run = unpacked_config(network)?.depth_net;
            if same_layers(&of_its_run, &config.depth_net) {
                return Ok(Self::Packed {
                    network: Box::new(network.clone()),
                    path: None,
                });
            }
        }
        Ok(if networks.is_empty() {
            Self::Nothing
        } else {
            Self::NoneFits
        })
    }

    /// Records the start in a run's configuration, so that the run can be repeated, and fills in open units of translation from the PoseNet
    /// that it starts from.
    ///
    /// # Errors
    /// As [`RunFolder::read_config`] and [`RunFolder::read_state`], for the run that it starts from.
    pub fn record_in(&self, config: &mut TrainConfig) -> Result<()> {
        (config.init, config.init_sha256) = match self {
            Self::Nothing | Self::NoneFits => (None, None),
            Self::Path(path) => (Some(path.clone()), None),
            Self::Packed {
                path: Some(path), ..
            } => (Some(path.clone()), None),
            Self::Packed {
                network,
                path: None,
            } => {
                let card = &network.card;
                (Some(card.name.clone().into()), Some(card.sha256.clone()))
            }
        };
        self.take_focal_length(config)?;
        if let Self::Path(path) = self
            && let Some((folder, kind)) = run_of(path)?
            && !folder.read_state(kind)?.encoders_only
            && folder.has_pose_net(kind)?
        {
            pose_unit::inherit(&folder.read_config()?, config);
        }
        Ok(())
    }

    /// Takes over the focal length that a network's metres belong to, unless another one is requested.
    fn take_focal_length(&self, config: &mut TrainConfig) -> Result<()> {
        if config.canonical_focal_px.is_some() {
            return Ok(());
        }
        config.canonical_focal_px = match self {
            Self::Nothing | Self::NoneFits => None,
            Self::Packed { network, .. } => unpacked_config(network)?.canonical_focal_px,
            Self::Path(path) => match run_of(path)? {
                Some((folder, _)) => folder.read_config()?.canonical_focal_px,
                None => None,
            },
        };
        Ok(())
    }

    /// The model with the weights to start from; `report` is called with warnings about them, then with what they are.
    ///
    /// # Errors
    /// As [`Checkpoints::load_networks`]; [`TrainError::Model`] for weights of another architecture.
    pub fn initialise(
        &self,
        mut model: Model,
        device: &Device,
        report: &mut dyn FnMut(StartReport),
    ) -> Result<Model, TrainError> {
        match self {
            Self::Nothing => Ok(model),
            Self::NoneFits => {
                report(StartReport::NoneFits);
                Ok(model)
            }
            Self::Packed { network, path } => {
                let theirs = unpacked_config(network)?;
                for warning in OtherMeaning::all(&theirs, model.config(), true) {
                    report(StartReport::OtherMeaning(warning));
                }
                let weights = unpacked_weights(network)?;
                let (depth_net, new_head) = model.depth_net.with_weights(&weights)?;
                model.depth_net = depth_net;
                let pose_net = model.pose_net.is_some().then_some("PoseNet");
                let mut new: Vec<_> = pose_net.into_iter().collect();
                new.extend(new_head.then_some("the uncertainty head"));
                let path = path.as_deref();
                report(StartReport::Packed { network, path, new });
                Ok(model)
            }
            Self::Path(path) => {
                let Some((folder, kind)) = run_of(path)? else {
                    model.depth_net = model.depth_net.with_torchvision_encoder(path)?;
                    if let Some(pose_net) = &mut model.pose_net {
                        let encoder = pose_net.encoder.clone();
                        pose_net.encoder = load_torchvision_resnet(encoder, path)?;
                    }
                    return Ok(model);
                };
                let learned = !folder.read_state(kind)?.encoders_only;
                let theirs = folder.read_config()?;
                for warning in OtherMeaning::all(&theirs, model.config(), learned) {
                    report(StartReport::OtherMeaning(warning));
                }
                if model.pose_net.is_some()
                    && learned
                    && folder.has_pose_net(kind)?
                    && let Some(warning) = OtherMeaning::of_pose_net(&theirs, model.config())
                {
                    report(StartReport::OtherMeaning(warning));
                }
                let device = device.clone().autodiff();
                let (model, new) = folder.load_networks(kind, model.config(), &device)?;
                let checkpoint = folder.checkpoint_path(kind);
                report(StartReport::Run { checkpoint, new });
                Ok(model)
            }
        }
    }
}

/// The configuration of a packed network's run. Its PoseNet's units do not matter here, whatever the data set.
fn unpacked_config(network: &Shipped) -> Result<TrainConfig, ModelError> {
    let origin = || network.card.name.clone().into();
    let read = TrainConfig::from_run_table(network.card.config.clone());
    let (config, _) = read.map_err(|e| ModelError::ConfigFile {
        path: origin(),
        reason: e.into(),
    })?;
    Ok(config)
}

/// A packed network's tensors.
fn unpacked_weights(network: &Shipped) -> Result<Weights, ModelError> {
    let origin = &network.card.name;
    Ok(read_bytes(origin, &network.bytes)?)
}

/// Whether two networks can share weights with the same meaning.
fn same_layers(a: &DepthNetConfig, b: &DepthNetConfig) -> bool {
    a.of_the_weights() == b.of_the_weights()
}

/// The run and checkpoint that a path stands for; `None` for other weights.
fn run_of(path: &Path) -> Result<Option<(RunFolder, CheckpointKind)>, ModelError> {
    if !is_run(path) {
        return Ok(None);
    }
    let (folder, kind) = RunFolder::open(path)?;
    let kind = kind.unwrap_or_else(|| folder.preferred());
    Ok(Some((folder, kind)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_hint::Hint as _;
    use deepfusion_model::{AveragedNetwork, Preset};

    /// Which presets could start from which: `light` has the embedded network's layers; Monodepth2's has the same tensors, but other
    /// depths.
    #[test]
    fn layers_and_range_decide_which_presets_match() {
        let net = |preset: Preset| preset.config().depth_net;
        for a in Preset::ALL {
            for b in Preset::ALL {
                assert_eq!(same_layers(&net(a), &net(b)), a == b, "{a}, {b}");
            }
        }
        let mut other = net(Preset::Light);
        other.initial_depth_m = None;
        assert!(same_layers(&other, &net(Preset::Light)));
        other.range.max_m = 60.0;
        assert!(!same_layers(&other, &net(Preset::Light)));
        // R-MSFM always refines from that depth.
        let mut refined = net(Preset::RMsfm3);
        refined.initial_depth_m = Some(33.0);
        assert!(!same_layers(&refined, &net(Preset::RMsfm3)));
        let mut config = Preset::Light.config();
        config.with("attention").unwrap();
        assert!(!same_layers(&config.depth_net, &net(Preset::Light)));
    }

    #[test]
    fn settings_of_a_mean_are_distinguished_from_those_of_a_run() {
        let folder = tempfile::tempdir().unwrap();
        let run = RunFolder::create(folder.path()).unwrap();
        let part = |path: &str| AveragedNetwork {
            path: path.into(),
            sha256: None,
            share: 0.5,
        };
        let averaged = vec![part("/first/best.safetensors"), part("/second")];
        let mean = TrainFindings {
            averaged,
            ..TrainFindings::default()
        };
        let config = Preset::Tiny.config();
        for (findings, of_mean) in [(mean, true), (TrainFindings::default(), false)] {
            run.write_config(&config, &findings).unwrap();
            let found = SettingsOfMean::of(&run.config_path(), &config).unwrap();
            let text = found.map(|mean| mean.to_string()).unwrap_or_default();
            for part in ["mean of 2 networks", "/first/best.safetensors"] {
                assert_eq!(text.contains(part), of_mean, "{text}");
            }
        }
    }

    /// The folder of a mean is known while its configuration is beside its weights; a start that the first network did not have was chosen
    /// by the user.
    #[test]
    fn settings_of_a_mean_name_its_folder_unless_a_start_was_chosen() {
        let at = tempfile::tempdir().unwrap();
        let at = at.path();
        let first = RunFolder::create(&at.join("first")).unwrap();
        let mut config = Preset::Tiny.config();
        config.init = Some(at.join("street"));
        first
            .write_config(&config, &TrainFindings::default())
            .unwrap();
        let findings = TrainFindings {
            averaged: vec![AveragedNetwork {
                path: first.checkpoint_path(CheckpointKind::Best),
                sha256: None,
                share: 1.0,
            }],
            ..TrainFindings::default()
        };
        let mean = RunFolder::create(&at.join("mean")).unwrap();
        mean.write_config(&config, &findings).unwrap();
        let file = mean.config_path();
        let folder = |file: &Path, config: &TrainConfig| {
            let found = SettingsOfMean::of(file, config).unwrap();
            found.map(|mean| mean.folder)
        };
        assert_eq!(folder(&file, &config), Some(None), "no weights");
        std::fs::write(mean.checkpoint_path(CheckpointKind::Last), b"").unwrap();
        assert_eq!(folder(&file, &config), Some(Some(at.join("mean"))));
        for copy in [at.join("mean/copy.toml"), at.join("copy.toml")] {
            std::fs::copy(&file, &copy).unwrap();
            assert_eq!(folder(&copy, &config), Some(None), "{}", copy.display());
        }
        config.init = Some(at.join("mean"));
        assert_eq!(folder(&file, &config), None);
        config.init = None;
        assert!(folder(&file, &config).is_some());
    }

    #[test]
    fn an_unknown_network_is_an_error_that_lists_the_embedded_ones() {
        let error = Start::named(Path::new("no-such-network")).unwrap_err();
        assert!(error.to_string().contains("no-such-network"), "{error}");
        let hint = error.hint().unwrap();
        assert!(hint.contains("folder"), "{hint}");
        for name in embedded_names() {
            assert!(hint.contains(name), "{hint}");
        }
        assert!(matches!(
            Start::named(Path::new("none")).unwrap(),
            Start::Nothing
        ));
    }

    /// Repeating a run reports that the network it started from is not embedded, or is another one.
    #[test]
    fn weights_other_than_a_run_started_from_are_refused() {
        let mut config = Preset::Light.config();
        let start = Start::of(None, &config, false).unwrap();
        assert!(matches!(start, Start::Nothing));
        for name in embedded_names().into_iter().chain(["no-such-network"]) {
            (config.init, config.init_sha256) = (Some(name.into()), Some("ab".repeat(32)));
            let error = Start::of(None, &config, false).unwrap_err();
            assert!(error.to_string().contains(name), "{error}");
        }
        let start = Start::of(Some(Path::new("none")), &config, false).unwrap();
        assert!(matches!(start, Start::Nothing));
        start.record_in(&mut config).unwrap();
        assert_eq!((config.init, config.init_sha256), (None, None));
    }
}
