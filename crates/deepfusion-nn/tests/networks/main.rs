//! The networks beside PyTorch's, and their weights in files. One binary: linking Burn takes far longer
//! than running all of it.

mod against_pytorch;
mod common;
mod training_step;
mod weight_files;
