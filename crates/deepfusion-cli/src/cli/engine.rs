use std::path::PathBuf;

use clap::Args;
use deepfusion_infer::Precision;
use deepfusion_jobs::engine::{Engine, EngineSettings};

use super::device::device;
use super::names;
use crate::devices::ComputeDevice;

/// What runs a trained network, and where.
#[derive(Debug, Clone, Args)]
pub(crate) struct EngineArgs {
    /// What runs the network.
    #[arg(long, value_parser = names::engine(), default_value_t)]
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

    /// The same as the library takes it; which data set is meant is the network's matter.
    pub(crate) fn settings(&self) -> EngineSettings {
        EngineSettings {
            engine: self.engine,
            precision: self.precision,
            ort_library: self.ort_lib.clone(),
            device: self.device,
        }
    }
}
