//! The networks and their operations beside PyTorch's, and weights in files. One binary: linking Burn takes far longer
//! than running all of it.

mod against_pytorch;
mod common;
mod depth_network;
mod disp_net;
mod flow_decoder;
mod formula;
mod lite_mono;
mod operations;
mod r_msfm;
mod training_step;
mod weight_files;
