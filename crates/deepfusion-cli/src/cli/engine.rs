use std::path::PathBuf;

use clap::{Args, ValueEnum};
use deepfusion_infer::Precision;

use super::device::device;
use super::names;
use crate::devices::ComputeDevice;

/// What runs a trained network, and where.
#[derive(Debug, Clone, Args)]
pub(crate) struct EngineArgs {
    /// What runs the network.
    #[arg(long, value_enum, default_value_t)]
    pub engine: Engine,
    /// In which numbers the fused engine computes.
    #[arg(long, value_parser = names::precision(), default_value = "f32")]
    pub precision: Precision,
    /// The ONNX Runtime library of `--engine ort` [default: found].
    #[arg(long, value_name = "FILE")]
    pub ort_lib: Option<PathBuf>,
    /// Where to compute; one of several GPUs by its index, as cuda:1.
    #[arg(long, value_parser = device(), default_value_t)]
    pub device: ComputeDevice,
    /// The data set whose metric scale to use, for a run trained on several.
    #[arg(long = "data-set", alias = "set", value_name = "NAME")]
    pub set: Option<String>,
}

impl EngineArgs {
    /// What is chosen without a word, on a device.
    pub(crate) fn on(device: ComputeDevice) -> Self {
        Self {
            engine: Engine::default(),
            precision: Precision::default(),
            ort_lib: None,
            device,
            set: None,
        }
    }
}

/// What runs the network.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub(crate) enum Engine {
    /// `fused` on the processor, `burn` on any other device.
    #[default]
    Auto,
    /// The network as it is trained.
    Burn,
    /// This program's own engine for processors.
    Fused,
    /// ONNX Runtime, a library of your own.
    Ort,
}
