//! Weights: collected from a network, applied to a network, and imported from other programs' files.
//!
//! A tensor's name is its path in the module, `encoder.layer1.0.conv1.weight`; the encoders' paths are torchvision's names. PyTorch's
//! `.pth` files can be read. An import renames the tensors of another program's file to our names and then requires an exact fit: nothing
//! missing, nothing left over, every shape equal.

mod disp_net;
mod file;
mod imported;
mod lite_mono;
mod module;
mod monodepth2;
mod r_msfm;
mod torchvision;

pub use deepfusion_model::weights::{
    FormatProblem, WeightTensor, Weights, read_bytes, read_safetensors_under, write_safetensors,
};
pub use disp_net::{is_disp_net, load_disp_net};
pub use file::read;
pub use imported::{Imported, load_networks, load_whole};
pub use lite_mono::load_lite_mono;
pub use module::{apply, apply_but_for, collect};
pub use monodepth2::{Monodepth2Files, Pose, load_monodepth2};
pub use r_msfm::load_r_msfm;
pub use torchvision::{detect_resnet, load_torchvision_half, load_torchvision_resnet};
