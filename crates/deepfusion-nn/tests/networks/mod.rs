//! The networks and their operations against PyTorch, and weights in files. They are one binary, since linking Burn takes far longer than
//! running all tests.

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
