//! R-MSFM's published files. Only their layout is used here: the names of the tensors, their meaning, and the size stored beside them.

use burn::tensor::Device;

use super::monodepth2::{input_size, load_pose, rename};
use super::torchvision::apply_half;
use super::{Imported, Monodepth2Files, Weights, apply, read};
use crate::{ArchitectureProblem, DepthNet, DepthNetConfig, Error};

/// Whether the tensors have the names of R-MSFM's `depth.pth`.
pub(super) fn is_r_msfm(depth: &Weights) -> bool {
    depth.tensors.contains_key("convX11.1.weight")
}

/// Reads R-MSFM's `encoder.pth` and `depth.pth`, and Monodepth2's `pose_encoder.pth` and `pose.pth` if they exist.
///
/// # Errors
/// As [`read`] and [`apply`]; [`Error::UnknownArchitecture`] for other files, and for R-MSFMX, whose encoder is a ResNet-50.
pub fn load_r_msfm(files: &Monodepth2Files, device: &Device) -> Result<Imported, Error> {
    let decoder = read(&files.depth)?;
    let iterations = detect(&decoder)?;
    let depth_config = DepthNetConfig {
        // The published networks start their refinement in the middle of the disparity range.
        initial_depth_m: None,
        ..DepthNetConfig::r_msfm(iterations)
    };
    let mut depth_net = DepthNet::new(&depth_config, device)?;
    if let Some(net) = &mut depth_net.r_msfm {
        let encoder = read(&files.encoder)?.under("encoder.");
        net.encoder = apply_half(net.encoder.clone(), encoder)?;
        let decoder = rename(decoder, decoder_name)?;
        // The encoder is part of the same network.
        let own = super::collect(&net.encoder).with_prefix("encoder.");
        *net = apply(net.clone(), &decoder.merged(own))?;
    }
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

/// Number of refinements of the network with these weights.
fn detect(decoder: &Weights) -> Result<usize, Error> {
    let unknown = |reason| Error::UnknownArchitecture {
        origin: decoder.origin.clone(),
        reason,
    };
    if !is_r_msfm(decoder) {
        return Err(unknown(ArchitectureProblem::NotOfKind {
            network: "R-MSFM",
            lacks: "convX11.1.weight",
            first: decoder.first_name().to_owned(),
        }));
    }
    let middle = decoder.tensors.get("convX21.1.weight");
    match middle.and_then(|tensor| tensor.shape.get(1).copied()) {
        Some(64) => {}
        channels => return Err(unknown(ArchitectureProblem::RMsfm { channels })),
    }
    Ok(if decoder.tensors.contains_key("convX12.0.weight") {
        6
    } else {
        3
    })
}

/// Prefixes of names: theirs and ours.
const PARTS: [(&str, &str); 25] = [
    ("convX31.1.", "features.coarse."),
    ("convX21.1.", "features.middle."),
    ("convX11.1.", "features.fine_reduce."),
    ("convX11.4.", "features.fine."),
    ("convX32.0.", "features.context.0.across."),
    ("convX32.2.", "features.context.0.down."),
    ("convX22.0.", "features.context.1.across."),
    ("convX22.2.", "features.context.1.down."),
    ("convX12.0.", "features.context.2.across."),
    ("convX12.2.", "features.context.2.down."),
    ("gruc.convz1.", "gru.across.update."),
    ("gruc.convr1.", "gru.across.reset."),
    ("gruc.convq1.", "gru.across.candidate."),
    ("gruc.convz2.", "gru.down.update."),
    ("gruc.convr2.", "gru.down.reset."),
    ("gruc.convq2.", "gru.down.candidate."),
    ("update_block.encoder.convc1.conv.conv.", "update.state_1."),
    ("update_block.encoder.convc2.conv.conv.", "update.state_2."),
    ("update_block.encoder.convf1.1.", "update.disparity_1."),
    ("update_block.encoder.convf2.1.", "update.disparity_2."),
    ("update_block.encoder.conv.conv.conv.", "update.join."),
    ("update_block.flow_head.covd1.1.", "update.change_1."),
    ("update_block.flow_head.covd2.1.", "update.change_2."),
    ("update_block.mask.1.", "weights.reduce."),
    ("update_block.mask.3.", "weights.expand."),
];

/// Our name for a tensor of `depth.pth`.
fn decoder_name(name: &str) -> Option<String> {
    PARTS.iter().find_map(|(theirs, ours)| {
        let rest = name.strip_prefix(theirs)?;
        Some(format!("{ours}{rest}"))
    })
}
