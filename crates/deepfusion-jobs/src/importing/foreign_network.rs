//! Other projects' weights as a run: torchvision's ResNet, Monodepth2, Lite-Mono, R-MSFM, SfMLearner.

use std::path::{Path, PathBuf};

use deepfusion_model::{Preset, RunFolder, TrainConfig, TrainFindings};
use deepfusion_nn::weights::{
    Imported, Monodepth2Files, detect_resnet, load_networks, load_torchvision_resnet, load_whole,
    read,
};
use deepfusion_nn::{DepthNet, DepthNetConfig, PoseNet, PoseNetConfig};
use deepfusion_train::{Checkpoint, CheckpointKind, Checkpoints, Device, Model};

use crate::Result;

/// Other projects' weights, converted for a run.
#[derive(Debug)]
pub struct ForeignNetwork {
    config: TrainConfig,
    model: Model,
    /// Set for a ResNet: the depth network was never trained.
    encoders_only: bool,
}

impl ForeignNetwork {
    /// Reads one file of a ResNet or of SfMLearner's DispNet, or the files of another network, given by their folder or one by one.
    ///
    /// # Errors
    /// Weights that cannot be read, or that fit no known network.
    pub fn read(files: &[PathBuf]) -> Result<Self> {
        let device = Device::flex();
        let whole = match files {
            [file] if !file.is_dir() => load_whole(file, &device)?,
            _ => None,
        };
        let encoders_only = whole.is_none() && matches!(files, [file] if !file.is_dir());
        let (config, model) = match (whole, files) {
            (Some(network), _) => of_networks(network, &device)?,
            (None, [file]) if encoders_only => from_resnet(file, &device)?,
            (None, [folder]) => from_files(&Monodepth2Files::in_folder(folder), &device)?,
            (None, files) => from_files(&named(files), &device)?,
        };
        Ok(Self {
            config,
            model,
            encoders_only,
        })
    }

    /// Writes the network as a run into an empty folder, and returns the path of its checkpoint. Its scale is not metric until it is
    /// trained with speeds.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<PathBuf> {
        let folder = RunFolder::create(folder)?;
        folder.write_config(&self.config, &TrainFindings::default())?;
        let state = Checkpoint {
            step: 0,
            best_validation: None,
            skipped: 0,
            encoders_only: self.encoders_only,
            focal_ratio: None,
        };
        Ok(folder.save(CheckpointKind::Last, &self.model, None, &state)?)
    }
}

/// The files in Monodepth2's layout, which Lite-Mono and R-MSFM share, found among `files` by name.
fn named(files: &[PathBuf]) -> Monodepth2Files {
    let find = |name: &str| {
        let is = |p: &&PathBuf| p.file_stem().is_some_and(|stem| stem == name);
        files.iter().find(is).cloned()
    };
    Monodepth2Files {
        encoder: find("encoder").unwrap_or_else(|| PathBuf::from("encoder.pth")),
        depth: find("depth").unwrap_or_else(|| PathBuf::from("depth.pth")),
        pose: find("pose_encoder").zip(find("pose")),
    }
}

/// The preset whose settings further training uses: the one with the network's layers, among the presets that train as Monodepth2 does.
fn preset_of(net: &DepthNetConfig) -> Preset {
    let layers = |net: &DepthNetConfig| {
        let lite_mono = net.lite_mono.as_ref();
        let stages = lite_mono.map(|own| (own.widths, own.dilations.each_ref().map(Vec::len)));
        let (r_msfm, disp_net) = (net.r_msfm.clone(), net.disp_net.clone());
        (stages, r_msfm, disp_net, net.encoder.depth)
    };
    let family = Preset::ALL
        .into_iter()
        .skip_while(|preset| *preset != Preset::Monodepth2);
    let mut alike = family.filter(|preset| layers(&preset.config().depth_net) == layers(net));
    alike.next().unwrap_or(Preset::Monodepth2)
}

fn from_files(files: &Monodepth2Files, device: &Device) -> Result<(TrainConfig, Model)> {
    of_networks(load_networks(files, device)?, device)
}

/// A run's configuration and model for networks read from files.
fn of_networks(imported: Imported, device: &Device) -> Result<(TrainConfig, Model)> {
    let mut config = preset_of(&imported.depth_config).config();
    config.depth_net = imported.depth_config;
    if let Some(size) = imported.input_size {
        config.size = size;
    }
    let pose_net = match imported.pose {
        Some((pose_config, pose_net)) => {
            config.pose_net = pose_config;
            Some(pose_net)
        }
        // The checkpoint has no PoseNet, so a run that starts from it gets a new one, whose unit is determined by its own data.
        None => {
            config.pose_net = PoseNetConfig {
                explainability: config.pose_net.explainability,
                metres_per_unit: 0.0,
                ..PoseNetConfig::monodepth2(config.depth_net.encoder.depth)
            };
            None
        }
    };
    let model = Model::with_networks(&config, imported.depth_net, pose_net, device);
    Ok((config, model))
}

fn from_resnet(file: &Path, device: &Device) -> Result<(TrainConfig, Model)> {
    let depth = detect_resnet(&read(file)?)?;
    let mut config = Preset::Light.config();
    config.depth_net = DepthNetConfig::new(depth);
    config.pose_net = PoseNetConfig::new(depth);
    let mut depth_net = DepthNet::new(&config.depth_net, device)?;
    let mut pose_net = PoseNet::new(&config.pose_net, device)?;
    depth_net = depth_net.with_torchvision_encoder(file)?;
    pose_net.encoder = load_torchvision_resnet(pose_net.encoder, file)?;
    let model = Model::with_networks(&config, depth_net, pose_net, device);
    Ok((config, model))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::training::Start;
    use deepfusion_model::{CheckpointLacks, Error as ModelError};
    use deepfusion_train::{Error as TrainError, PosePredictor};

    /// A run that starts from a depth network alone gets a new PoseNet, whose unit is determined by its data; a run that starts from both
    /// keeps the imported unit.
    #[test]
    fn a_missing_pose_net_is_not_in_the_checkpoint() {
        let device = Device::flex();
        let at = tempfile::tempdir().unwrap();
        let mut depth_config = DepthNetConfig::monodepth2(deepfusion_nn::ResNetDepth::ResNet18);
        depth_config.encoder = depth_config.encoder.with_base_width(8);
        depth_config.decoder.widths = [16, 16, 8, 8, 8];
        let mut pose_config = PoseNetConfig::monodepth2(deepfusion_nn::ResNetDepth::ResNet18);
        pose_config.encoder = pose_config.encoder.with_base_width(8);
        for whole in [true, false] {
            let pose_net = PoseNet::new(&pose_config, &device).unwrap();
            let imported = Imported {
                depth_config: depth_config.clone(),
                depth_net: DepthNet::new(&depth_config, &device).unwrap(),
                pose: whole.then(|| (pose_config.clone(), pose_net)),
                input_size: None,
            };
            let (config, model) = of_networks(imported, &device).unwrap();
            let network = ForeignNetwork {
                config,
                model,
                encoders_only: false,
            };
            let path = at.path().join(whole.to_string());
            network.write(&path).unwrap();
            let (run, _) = RunFolder::open(&path).unwrap();
            assert_eq!(run.has_pose_net(CheckpointKind::Last).unwrap(), whole);
            let stored = run.read_config().unwrap();
            assert_eq!(stored.pose_net.metres_per_unit > 0.0, whole);

            let mut config = Preset::Monodepth2.config();
            Start::Path(path.clone()).record_in(&mut config).unwrap();
            let unit = if whole { 0.01 } else { 0.0 };
            assert_eq!(config.pose_net.metres_per_unit, unit);

            config.depth_net = depth_config.clone();
            config.pose_net = pose_config.clone();
            let (_, new) = run
                .load_networks(CheckpointKind::Last, &config, &device)
                .unwrap();
            assert_eq!(new.contains(&"PoseNet"), !whole, "{new:?}");

            let predictor = PosePredictor::load(&path, None, &device);
            let refused = matches!(predictor, Err(TrainError::NoPoseNet { .. }));
            assert_eq!(refused, !whole);
            let resumed = run.load(CheckpointKind::Last, &stored, &device);
            let lacks = ModelError::NotResumable {
                path: run.checkpoint_path(CheckpointKind::Last),
                reason: CheckpointLacks::PoseNet,
            };
            let found = resumed.err().map(|error| error.to_string());
            assert_eq!(found, (!whole).then(|| lacks.to_string()));
        }
    }

    #[test]
    fn the_preset_follows_from_the_layers() {
        let all = Preset::ALL.into_iter();
        let family: Vec<Preset> = all.skip_while(|p| *p != Preset::Monodepth2).collect();
        assert_eq!(family.len(), 9);
        for preset in family {
            // As an import leaves it.
            let mut net = preset.config().depth_net;
            net.initial_depth_m = None;
            assert_eq!(preset_of(&net), preset);
        }
        let net = DepthNetConfig::monodepth2(deepfusion_nn::ResNetDepth::ResNet34);
        assert_eq!(preset_of(&net), Preset::Monodepth2);
    }
}
