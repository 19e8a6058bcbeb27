//! The usual files of SfMLearner's DispNet, `dispnet_model_best.pth.tar`. Only their layout is used here: the names of the tensors and
//! their meaning.

use std::path::Path;

use burn::tensor::Device;
use deepfusion_geometry::DepthRange;

use super::monodepth2::rename;
use super::{Imported, Weights, apply, read};
use crate::{ArchitectureProblem, DepthNet, DepthNetConfig, Error};
use deepfusion_model::{DISP_NET_DISPARITY, DISP_NET_LEVELS};

/// Whether the tensors have the names of DispNet's file.
#[must_use]
pub fn is_disp_net(weights: &Weights) -> bool {
    weights.tensors.contains_key("predict_disp1.0.weight")
}

/// Reads `dispnet_model_best.pth.tar`. Its disparity, 10·σ + 0.01 in its own unit, is converted to a depth range.
///
/// # Errors
/// As [`read`] and [`apply`]; [`Error::UnknownArchitecture`] for other files.
pub fn load_disp_net(file: &Path, device: &Device) -> Result<Imported, Error> {
    let weights = read(file)?;
    if !is_disp_net(&weights) {
        return Err(Error::UnknownArchitecture {
            reason: ArchitectureProblem::NotOfKind {
                network: "DispNet",
                lacks: "predict_disp1.0.weight",
                first: weights.first_name().to_owned(),
            },
            origin: weights.origin,
        });
    }
    let [factor, summand] = DISP_NET_DISPARITY;
    let depth_config = DepthNetConfig {
        range: DepthRange {
            min_m: 1.0 / (factor + summand),
            max_m: 1.0 / summand,
        },
        initial_depth_m: None,
        ..DepthNetConfig::disp_net()
    };
    let mut depth_net = DepthNet::new(&depth_config, device)?;
    let weights = rename(weights, own_name)?;
    depth_net.disp_net = depth_net
        .disp_net
        .map(|net| apply(net, &weights))
        .transpose()?;
    Ok(Imported {
        depth_config,
        depth_net,
        pose: None,
        input_size: None,
    })
}

/// Our name for a tensor of the file: `conv1` to `conv7` halve, `upconv7` to `upconv1` enlarge, `iconv7` to `iconv1` join.
fn own_name(name: &str) -> Option<String> {
    let (layer, rest) = name.split_once('.')?;
    let (index, rest) = rest.split_once('.')?;
    let part = layer.trim_end_matches(|c: char| c.is_ascii_digit());
    let level: usize = layer[part.len()..].parse().ok()?;
    let level = (1..=DISP_NET_LEVELS).contains(&level).then_some(level)?;
    let finest = level - 1;
    let stage = DISP_NET_LEVELS - level;
    Some(match (part, index) {
        ("conv", "0") => format!("encoder.{finest}.halve.{rest}"),
        ("conv", "2") => format!("encoder.{finest}.keep.{rest}"),
        ("upconv", "0") => format!("decoder.{stage}.enlarge.{rest}"),
        ("iconv", "0") => format!("decoder.{stage}.join.{rest}"),
        ("predict_disp", "0") => format!("heads.{finest}.{rest}"),
        _ => return None,
    })
}
