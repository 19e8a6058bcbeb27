//! torchvision's ResNets.

use std::path::Path;

use super::{Weights, apply, read};
use crate::r_msfm::HalfResNet;
use crate::{ArchitectureProblem, Error, ResNet, ResNetDepth};

/// Reads ImageNet weights as published by torchvision (such as `resnet18-f37072fd.pth`, or the same tensors as `.safetensors`) into an
/// encoder. The classifier (`fc`) is left out. For an encoder of several frames the first convolution is repeated for each frame and
/// divided by their number, so that equal frames give the same activations as a single image.
///
/// # Errors
/// As [`read`] and [`apply`]; [`Error::UnknownArchitecture`] for weights that are not a ResNet's.
pub fn load_torchvision_resnet(encoder: ResNet, path: &Path) -> Result<ResNet, Error> {
    let weights = read(path)?;
    detect_resnet(&weights)?;
    apply_torchvision(encoder, weights)
}

/// As [`load_torchvision_resnet`], for the half of a ResNet-18 in R-MSFM: later layers are left out.
///
/// # Errors
/// As [`load_torchvision_resnet`].
pub fn load_torchvision_half(encoder: HalfResNet, path: &Path) -> Result<HalfResNet, Error> {
    let weights = read(path)?;
    detect_resnet(&weights)?;
    apply_half(encoder, weights)
}

/// [`load_torchvision_half`] on tensors already read, under torchvision's names.
pub(super) fn apply_half(encoder: HalfResNet, weights: Weights) -> Result<HalfResNet, Error> {
    let behind = |name: &str| {
        ["layer3.", "layer4.", "fc."]
            .iter()
            .any(|part| name.starts_with(part))
    };
    let weights = weights.renamed(|name| (!behind(name)).then(|| name.to_owned()));
    apply(encoder, &weights)
}

/// [`load_torchvision_resnet`] on tensors already read, under torchvision's names.
pub(super) fn apply_torchvision(encoder: ResNet, weights: Weights) -> Result<ResNet, Error> {
    let mut weights = weights.renamed(|name| (!name.starts_with("fc.")).then(|| name.to_owned()));
    let channels = encoder.conv1.weight.val().dims()[1];
    if let Some(conv1) = weights.tensors.get_mut("conv1.weight")
        && conv1.shape.len() == 4
        && conv1.shape[1] == 3
        && channels > 3
        && channels.is_multiple_of(3)
    {
        let frames = channels / 3;
        let per_filter = conv1.values.len() / conv1.shape[0].max(1);
        conv1.values = conv1
            .values
            .chunks_exact(per_filter.max(1))
            .flat_map(|filter| std::iter::repeat_n(filter, frames).flatten())
            .map(|value| value / frames as f32)
            .collect();
        conv1.shape[1] = channels;
    }
    apply(encoder, &weights)
}

/// The ResNet that has these weights, by torchvision's names.
///
/// # Errors
/// [`Error::UnknownArchitecture`] if the blocks match no known ResNet.
pub fn detect_resnet(weights: &Weights) -> Result<ResNetDepth, Error> {
    let blocks: [usize; 4] = std::array::from_fn(|layer| {
        (0..)
            .take_while(|block| {
                let name = format!("layer{}.{block}.conv1.weight", layer + 1);
                weights.tensors.contains_key(&name)
            })
            .count()
    });
    let bottleneck = weights.tensors.contains_key("layer1.0.conv3.weight");
    ResNetDepth::ALL
        .into_iter()
        .find(|depth| depth.blocks() == blocks && depth.is_bottleneck() == bottleneck)
        .ok_or_else(|| Error::UnknownArchitecture {
            origin: weights.origin.clone(),
            reason: if blocks == [0; 4] {
                ArchitectureProblem::NoResNet {
                    lacks: "layer1.0.conv1.weight",
                    first: weights.first_name().to_owned(),
                }
            } else {
                ArchitectureProblem::ResNet { blocks, bottleneck }
            },
        })
}
