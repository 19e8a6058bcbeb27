//! Monodepth2's published files. Only their layout is used here: the names of the tensors, their meaning, and the two numbers stored beside
//! them.

use std::path::{Path, PathBuf};

use burn::store::pytorch_reader::{PickleValue, PytorchReader};
use burn::tensor::Device;

use super::torchvision::apply_torchvision;
use super::{Imported, Weights, apply, detect_resnet, read};
use crate::{DepthNet, DepthNetConfig, Error, InputSize, PoseNet, PoseNetConfig};

/// Paths of the four files.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Monodepth2Files {
    /// `encoder.pth`.
    pub encoder: PathBuf,
    /// `depth.pth`.
    pub depth: PathBuf,
    /// `pose_encoder.pth` and `pose.pth`; stereo-only models have none.
    pub pose: Option<(PathBuf, PathBuf)>,
}

impl Monodepth2Files {
    /// The files with their published names in `folder`, as `.safetensors` if there is no `.pth`.
    #[must_use]
    pub fn in_folder(folder: &Path) -> Self {
        let file = |stem: &str| {
            let other = folder.join(format!("{stem}.safetensors"));
            if other.exists() {
                other
            } else {
                folder.join(format!("{stem}.pth"))
            }
        };
        let pose = (file("pose_encoder"), file("pose"));
        Self {
            encoder: file("encoder"),
            depth: file("depth"),
            pose: (pose.0.exists() || pose.1.exists()).then_some(pose),
        }
    }
}

/// A pose network and its configuration.
pub type Pose = (PoseNetConfig, PoseNet);

/// Reads Monodepth2's `encoder.pth`, `depth.pth`, `pose_encoder.pth` and `pose.pth`. The ResNets are recognised by their blocks; the
/// configurations are those of the preset `monodepth2`.
///
/// # Errors
/// As [`read`] and [`apply`]; [`Error::UnknownArchitecture`] if the encoder is not a ResNet.
pub fn load_monodepth2(files: &Monodepth2Files, device: &Device) -> Result<Imported, Error> {
    let encoder = read_encoder(&files.encoder)?;
    let depth_config = DepthNetConfig::monodepth2(detect_resnet(&encoder)?);
    let decoder = read(&files.depth)?;
    let decoder = rename(decoder, depth_decoder_name)?;
    let mut depth_net = DepthNet::new(&depth_config, device)?;
    depth_net.encoder = depth_net
        .encoder
        .map(|net| apply_torchvision(net, encoder))
        .transpose()?;
    depth_net.decoder = depth_net
        .decoder
        .map(|net| apply(net, &decoder))
        .transpose()?;

    let pose = match &files.pose {
        None => None,
        Some((encoder, decoder)) => Some(load_pose(encoder, decoder, device)?),
    };
    Ok(Imported {
        depth_config,
        depth_net,
        pose,
        input_size: input_size(&files.encoder),
    })
}

pub(super) fn load_pose(encoder: &Path, decoder: &Path, device: &Device) -> Result<Pose, Error> {
    let encoder = read_encoder(encoder)?;
    let decoder = rename(read(decoder)?, pose_decoder_name)?;
    let mut config = PoseNetConfig::monodepth2(detect_resnet(&encoder)?);
    // Both are determined from the files: variants differ in the number of input frames and of output poses.
    if let Some(conv1) = encoder.tensors.get("conv1.weight")
        && conv1.shape.len() == 4
    {
        config.encoder.frames = conv1.shape[1] / 3;
    }
    if let Some(output) = decoder.tensors.get("output.weight") {
        config.poses = output.shape.first().map_or(0, |channels| channels / 6);
    }
    let mut net = PoseNet::new(&config, device)?;
    net.encoder = apply_torchvision(net.encoder, encoder)?;
    net.decoder = apply(net.decoder, &decoder)?;
    Ok((config, net))
}

/// Reads an encoder's file, in which torchvision's ResNet is called `encoder`.
fn read_encoder(path: &Path) -> Result<Weights, Error> {
    Ok(read(path)?.under("encoder."))
}

/// Renames every tensor; an error names the first that the network does not have.
pub(super) fn rename(
    weights: Weights,
    name_of: impl Fn(&str) -> Option<String>,
) -> Result<Weights, Error> {
    let unknown: Vec<_> = weights
        .tensors
        .iter()
        .filter(|(name, _)| name_of(name).is_none())
        .collect();
    if let Some((name, tensor)) = unknown.first() {
        return Err(Error::UnexpectedTensor {
            origin: weights.origin.clone(),
            name: (*name).clone(),
            found: tensor.shape.clone(),
            others: unknown.len() - 1,
        });
    }
    Ok(weights.renamed(name_of))
}

/// Our name for a tensor of `depth.pth`. Its module list has, in the order of construction, two blocks per stage, coarse to fine (0…9),
/// then the heads of scales 0…3 (10…13).
fn depth_decoder_name(name: &str) -> Option<String> {
    let (index, rest) = name.strip_prefix("decoder.")?.split_once('.')?;
    let index: usize = index.parse().ok()?;
    if index < 10 {
        let rest = rest.strip_prefix("conv.conv.")?;
        let part = if index.is_multiple_of(2) {
            "reduce"
        } else {
            "fuse"
        };
        Some(format!("stages.{}.{part}.{rest}", index / 2))
    } else {
        let rest = rest.strip_prefix("conv.")?;
        Some(format!("heads.{}.{rest}", index - 10))
    }
}

/// Our name for a tensor of `pose.pth`: squeeze, then three convolutions.
fn pose_decoder_name(name: &str) -> Option<String> {
    let (index, rest) = name.strip_prefix("net.")?.split_once('.')?;
    let part = match index {
        "0" => "squeeze",
        "1" => "conv1",
        "2" => "conv2",
        "3" => "output",
        _ => return None,
    };
    Some(format!("{part}.{rest}"))
}

/// `encoder.pth` has `height`, `width` and `use_stereo` beside its tensors.
pub(super) fn input_size(encoder: &Path) -> Option<InputSize> {
    let PickleValue::Dict(entries) = PytorchReader::read_pickle_data(encoder, None).ok()? else {
        return None;
    };
    let number = |key: &str| match entries.get(key) {
        Some(PickleValue::Int(value)) => usize::try_from(*value).ok(),
        _ => None,
    };
    InputSize::new(number("width")?, number("height")?).ok()
}
