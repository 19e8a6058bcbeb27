//! Networks of other programs, in any of the known file layouts.

use burn::tensor::Device;

use std::path::Path;

use super::disp_net::{is_disp_net, load_disp_net};
use super::lite_mono::{is_lite_mono, load_lite_mono};
use super::monodepth2::{Monodepth2Files, Pose, load_monodepth2};
use super::r_msfm::{is_r_msfm, load_r_msfm};
use super::read;
use crate::{DepthNet, DepthNetConfig, Error, InputSize};

/// Networks that were read from files.
#[derive(Debug)]
pub struct Imported {
    /// The depth network's configuration.
    pub depth_config: DepthNetConfig,
    /// The depth network.
    pub depth_net: DepthNet,
    /// The pose network and its configuration, if the files have one.
    pub pose: Option<Pose>,
    /// The image size of the training, if `encoder.pth` contains it.
    pub input_size: Option<InputSize>,
}

/// Reads a file with a whole depth network, which is DispNet's; `None` for other files.
///
/// # Errors
/// As [`load_disp_net`].
pub fn load_whole(file: &Path, device: &Device) -> Result<Option<Imported>, Error> {
    if is_disp_net(&read(file)?) {
        load_disp_net(file, device).map(Some)
    } else {
        Ok(None)
    }
}

/// Reads Lite-Mono's, R-MSFM's or Monodepth2's files, recognised by the names of their tensors.
///
/// # Errors
/// As [`load_lite_mono`], [`load_r_msfm`] and [`load_monodepth2`].
pub fn load_networks(files: &Monodepth2Files, device: &Device) -> Result<Imported, Error> {
    if is_lite_mono(&read(&files.encoder)?) {
        load_lite_mono(files, device)
    } else if is_r_msfm(&read(&files.depth)?) {
        load_r_msfm(files, device)
    } else {
        load_monodepth2(files, device)
    }
}
