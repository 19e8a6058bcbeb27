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
    /// Inference engine.
    #[arg(long, value_parser = names::engine(), default_value_t)]
    pub engine: Engine,
    /// Precision of the fused engine.
    #[arg(long, value_parser = names::precision(), default_value = "f32")]
    pub precision: Precision,
    /// ONNX Runtime library for `--engine ort` [default: ORT_DYLIB_PATH, or the first one found].
    #[arg(long, value_name = "FILE")]
    pub ort_lib: Option<PathBuf>,
    /// Device to compute on; with several GPUs add an index, such as cuda:1.
    #[arg(long, value_parser = device(), default_value_t)]
    pub device: ComputeDevice,
    /// Data set whose metric scale to use, for a run trained on several.
    #[arg(long = "data-set", alias = "set", value_name = "NAME")]
    pub set: Option<String>,
}

impl EngineArgs {
    /// The default engine on a device.
    pub(crate) fn on(device: ComputeDevice) -> Self {
        Self {
            engine: Engine::default(),
            precision: Precision::default(),
            ort_lib: None,
            device,
            set: None,
        }
    }

    /// The settings as the library takes them, without the data set, which belongs to the network.
    pub(crate) fn settings(&self) -> EngineSettings {
        EngineSettings {
            engine: self.engine,
            precision: self.precision,
            ort_library: self.ort_lib.clone(),
            device: self.device,
        }
    }
}
