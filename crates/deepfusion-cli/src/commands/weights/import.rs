use std::path::{Path, PathBuf};

use burn::tensor::Device;
use deepfusion_nn::weights::{
    Monodepth2Files, Pose, detect_resnet, is_lite_mono, is_r_msfm, load_lite_mono, load_monodepth2,
    load_r_msfm, load_torchvision_resnet, read,
};
use deepfusion_nn::{
    DepthNet, DepthNetConfig, InputSize, LiteMonoSize, PoseNet, PoseNetConfig, ResNetDepth,
};
use deepfusion_train::{
    Checkpoint, CheckpointKind, Checkpoints, Model, Preset, RunFolder, TrainConfig, TrainFindings,
};

use crate::failure::Result;
use crate::output;
use crate::progress::say;

/// `deepfusion weights import`.
pub(crate) fn run(files: &[PathBuf], out: &Path) -> Result<()> {
    let device = Device::flex();
    let encoders_only = matches!(files, [file] if !file.is_dir());
    let (config, model) = match files {
        [file] if encoders_only => from_resnet(file, &device)?,
        [folder] => from_files(&Monodepth2Files::in_folder(folder), &device)?,
        files => from_files(&named(files), &device)?,
    };
    let folder = RunFolder::create(&output::run_folder(Some(out), "weights")?)?;
    folder.write_config(&config, &TrainFindings::default())?;
    let state = Checkpoint {
        step: 0,
        best_validation: None,
        skipped: 0,
        encoders_only,
        focal_ratio: None,
    };
    let path = folder.save(CheckpointKind::Last, &model, None, &state)?;
    say("imported; the scale of imported weights is not metric until they are trained with speeds");
    output::print(&format!("{}\n", path.display()))
}

/// Files in Monodepth2's layout, which Lite-Mono and R-MSFM share, among those given, by their names.
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

/// A depth network with its pose network, in whichever of the layouts' files.
struct Imported {
    /// Whose settings it goes on with.
    preset: Preset,
    depth_config: DepthNetConfig,
    depth_net: DepthNet,
    pose: Option<Pose>,
    input_size: Option<InputSize>,
}

fn imported(files: &Monodepth2Files, device: &Device) -> Result<Imported> {
    if is_lite_mono(&read(&files.encoder)?) {
        let found = load_lite_mono(files, device)?;
        return Ok(Imported {
            preset: match found.size {
                LiteMonoSize::Full => Preset::LiteMono,
                LiteMonoSize::Small => Preset::LiteMonoSmall,
                LiteMonoSize::Tiny => Preset::LiteMonoTiny,
                LiteMonoSize::EightM => Preset::LiteMono8m,
            },
            depth_config: found.depth_config,
            depth_net: found.depth_net,
            pose: found.pose,
            input_size: found.input_size,
        });
    }
    if is_r_msfm(&read(&files.depth)?) {
        let found = load_r_msfm(files, device)?;
        return Ok(Imported {
            preset: if found.iterations == 3 {
                Preset::RMsfm3
            } else {
                Preset::RMsfm6
            },
            depth_config: found.depth_config,
            depth_net: found.depth_net,
            pose: found.pose,
            input_size: found.input_size,
        });
    }
    let found = load_monodepth2(files, device)?;
    Ok(Imported {
        preset: match found.depth_config.encoder.depth {
            ResNetDepth::ResNet50 => Preset::Monodepth2R50,
            _ => Preset::Monodepth2,
        },
        depth_config: found.depth_config,
        depth_net: found.depth_net,
        pose: found.pose,
        input_size: found.input_size,
    })
}

fn from_files(files: &Monodepth2Files, device: &Device) -> Result<(TrainConfig, Model)> {
    let imported = imported(files, device)?;
    let mut config = imported.preset.config();
    config.depth_net = imported.depth_config;
    if let Some(size) = imported.input_size {
        config.size = size;
    }
    let pose_net = match imported.pose {
        Some((pose_config, pose_net)) => {
            config.pose_net = pose_config;
            pose_net
        }
        None => {
            config.pose_net = PoseNetConfig::monodepth2(config.depth_net.encoder.depth);
            PoseNet::new(&config.pose_net, device)?
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
