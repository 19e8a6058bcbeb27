//! Lite-Mono's published files. Only their layout is used here: the names of the tensors, their meaning, and the size stored beside them.

use std::cmp::Ordering;

use burn::tensor::Device;

use super::monodepth2::{input_size, load_pose, rename};
use super::{Imported, Monodepth2Files, Weights, apply, read};
use crate::{ArchitectureProblem, DepthNet, DepthNetConfig, Error, LiteMonoConfig, LiteMonoSize};

/// Whether the tensors have the names of Lite-Mono's `encoder.pth`.
pub(super) fn is_lite_mono(encoder: &Weights) -> bool {
    encoder.tensors.contains_key("stem2.0.conv.weight")
}

/// Reads Lite-Mono's `encoder.pth` and `depth.pth`, and Monodepth2's `pose_encoder.pth` and `pose.pth` if they exist. The network is
/// recognised by the number of its blocks and their widths. Weights do not reveal dilations: those published for the size in `encoder.pth`
/// are used, or for 640×192 if it has no size.
///
/// # Errors
/// As [`read`] and [`apply`]; [`Error::UnknownArchitecture`] if the encoder is not one of the published ones.
pub fn load_lite_mono(files: &Monodepth2Files, device: &Device) -> Result<Imported, Error> {
    let encoder = tensors_alone(read(&files.encoder)?);
    let size = detect(&encoder)?;
    let input_size = input_size(&files.encoder);
    let mut depth_config = DepthNetConfig {
        initial_depth_m: None,
        ..DepthNetConfig::lite_mono(size)
    };
    if input_size.is_some_and(|size| size.width > 640) {
        let large = LiteMonoConfig::new(size).for_large_images();
        depth_config.lite_mono = Some(large);
    }
    let decoder = tensors_alone(read(&files.depth)?);
    let mut depth_net = DepthNet::new(&depth_config, device)?;
    if let Some(net) = &mut depth_net.lite_mono {
        let blocks = LiteMonoConfig::new(size).dilations.map(|rates| rates.len());
        let encoder = rename(encoder, |name| encoder_name(name, blocks))?;
        let encoder = as_convolutions(encoder);
        net.encoder = apply(net.encoder.clone(), &encoder)?;
        net.decoder = apply(net.decoder.clone(), &rename(decoder, decoder_name)?)?;
    }
    let pose = match &files.pose {
        None => None,
        Some((encoder, decoder)) => Some(load_pose(encoder, decoder, device)?),
    };
    Ok(Imported {
        depth_config,
        depth_net,
        pose,
        input_size,
    })
}

/// Removes a profiler's (thop) counters, which are in the published files, and the layer norms of the dilated blocks, which no computation
/// reads.
fn tensors_alone(weights: Weights) -> Weights {
    let of_dilated = |name: &str| {
        let block = name.rsplit_once(".norm.").map(|(block, _)| block);
        block.is_some_and(|block| {
            let dilated = format!("{block}.ddwconv.conv.weight");
            weights.tensors.contains_key(&dilated)
        })
    };
    let counted = |name: &str| {
        let last = name.rsplit('.').next();
        matches!(last, Some("total_ops" | "total_params"))
    };
    let read: Vec<String> = weights
        .tensors
        .keys()
        .filter(|name| !counted(name) && !of_dilated(name))
        .cloned()
        .collect();
    weights.renamed(|name| read.iter().any(|n| n == name).then(|| name.to_owned()))
}

/// The published network that has these weights.
fn detect(encoder: &Weights) -> Result<LiteMonoSize, Error> {
    let unknown = |reason| Error::UnknownArchitecture {
        origin: encoder.origin.clone(),
        reason,
    };
    if !is_lite_mono(encoder) {
        return Err(unknown(ArchitectureProblem::NotOfKind {
            network: "Lite-Mono",
            lacks: "stem2.0.conv.weight",
            first: encoder.first_name().to_owned(),
        }));
    }
    let halving = [
        "stem2.0.conv.weight",
        "downsample_layers.1.0.conv.weight",
        "downsample_layers.2.0.conv.weight",
    ];
    let width = |name: &str| {
        let tensor = encoder.tensors.get(name);
        tensor.and_then(|t| t.shape.first().copied()).unwrap_or(0)
    };
    let blocks: [usize; 3] = std::array::from_fn(|stage| {
        let name = |block: usize| format!("stages.{stage}.{block}.ddwconv.conv.weight");
        (0..)
            .take_while(|block| encoder.tensors.contains_key(&name(*block)))
            .count()
    });
    let widths = halving.map(width);
    let fits = |size: &LiteMonoSize| {
        let config = LiteMonoConfig::new(*size);
        config.widths == widths && config.dilations.map(|rates| rates.len()) == blocks
    };
    LiteMonoSize::ALL
        .into_iter()
        .find(fits)
        .ok_or_else(|| unknown(ArchitectureProblem::LiteMono { widths, blocks }))
}

/// Reshapes linear layers to 1×1 convolutions, and the heads' factors to a vector.
fn as_convolutions(mut weights: Weights) -> Weights {
    for (name, tensor) in &mut weights.tensors {
        if name.ends_with(".temperature") {
            tensor.shape.truncate(1);
        } else if tensor.shape.len() == 2 {
            tensor.shape.extend([1, 1]);
        }
    }
    weights
}

/// Our name for a tensor of `encoder.pth`, whose stages have these numbers of dilated blocks.
fn encoder_name(name: &str, blocks: [usize; 3]) -> Option<String> {
    if name == "stem2.0.conv.weight" {
        return Some("reduce.0.weight".into());
    }
    if let Some(rest) = name.strip_prefix("downsample_layers.") {
        let (level, rest) = rest.split_once('.')?;
        let (layer, part) = rest.split_once('.')?;
        return match (level, layer) {
            ("0", _) => {
                let part = part.strip_prefix("bn_gelu.").unwrap_or(part);
                Some(format!("stem.{layer}.{part}"))
            }
            (_, "0") => Some(format!("reduce.{level}.{}", part.strip_prefix("conv.")?)),
            _ => None,
        };
    }
    let (stage, rest) = name.strip_prefix("stages.")?.split_once('.')?;
    let (block, part) = rest.split_once('.')?;
    let (count, block) = (
        blocks.get(stage.parse::<usize>().ok()?)?,
        block.parse().ok()?,
    );
    let part = PARTS.iter().find_map(|(theirs, ours)| {
        let rest = part.strip_prefix(theirs)?;
        Some(format!("{ours}{rest}"))
    })?;
    match count.cmp(&block) {
        Ordering::Greater => Some(format!("stages.{stage}.dilated.{block}.{part}")),
        // The block with attention is the last of its stage.
        Ordering::Equal => Some(format!("stages.{stage}.global.{part}")),
        Ordering::Less => None,
    }
}

/// Prefixes of names within a block: theirs and ours.
const PARTS: [(&str, &str); 12] = [
    ("ddwconv.conv.", "depthwise."),
    ("bn1.", "bn."),
    ("pwconv1.", "bottleneck.expand."),
    ("pwconv2.", "bottleneck.project."),
    ("pos_embd.token_projection.", "position."),
    ("norm_xca.", "attention_norm."),
    ("xca.qkv.", "attention.qkv."),
    ("xca.proj.", "attention.project."),
    ("xca.temperature", "attention.temperature"),
    ("gamma_xca", "attention_scale"),
    ("gamma", "scale"),
    ("norm.", "norm."),
];

/// Our name for a tensor of `depth.pth`. Its module list has, in the order of construction, two blocks per stage, coarse to fine (0…5),
/// then the heads of scales 0…2 (6…8).
fn decoder_name(name: &str) -> Option<String> {
    let (index, rest) = name.strip_prefix("decoder.")?.split_once('.')?;
    let index: usize = index.parse().ok()?;
    if index < 6 {
        let rest = rest.strip_prefix("conv.conv.")?;
        let part = ["reduce", "fuse"][index % 2];
        Some(format!("stages.{}.{part}.{rest}", index / 2))
    } else {
        let rest = rest.strip_prefix("conv.")?;
        Some(format!("heads.{}.{rest}", index - 6))
    }
}
