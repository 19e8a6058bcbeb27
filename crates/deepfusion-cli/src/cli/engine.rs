use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::DeviceChoice;

/// What runs a trained network, and where.
#[derive(Debug, Clone, Args)]
pub struct EngineArgs {
    /// What runs the network.
    #[arg(long, value_enum, default_value_t)]
    pub engine: EngineChoice,
    /// In which numbers the fused engine computes.
    #[arg(long, value_enum, default_value_t)]
    pub precision: PrecisionChoice,
    /// The ONNX Runtime library of `--engine ort` [default: found].
    #[arg(long, value_name = "FILE")]
    pub ort_lib: Option<PathBuf>,
    /// Where to compute.
    #[arg(long, value_enum, default_value_t)]
    pub device: DeviceChoice,
    /// Which of the data sets that the run learned from its metres are of, where it learned several.
    #[arg(long = "data-set", alias = "set", value_name = "NAME")]
    pub set: Option<String>,
}

impl EngineArgs {
    /// What is chosen without a word, on a device.
    pub fn on(device: DeviceChoice) -> Self {
        Self {
            engine: EngineChoice::default(),
            precision: PrecisionChoice::default(),
            ort_lib: None,
            device,
            set: None,
        }
    }
}

/// What runs the network.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum EngineChoice {
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

/// In which numbers a network computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum PrecisionChoice {
    /// 32-bit floats.
    #[default]
    F32,
    /// Eight bits of mantissa: faster on processors with AMX or AVX512-BF16, a little less exact.
    Bf16,
}
