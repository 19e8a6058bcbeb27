//! What runs a trained network: the choice made on the command line.

use std::sync::{Arc, Mutex, PoisonError};

use anyhow::Result;
use deepfusion_infer::Precision;
use deepfusion_nn::depth_graph;
use deepfusion_nn::weights::Weights;
use deepfusion_onnx::runtime::OrtEngine;
use deepfusion_onnx::{DepthModel, write};
use deepfusion_train::{
    BurnRunner, DepthRunner, Error, FusedRunner, NetworkOutput, Predictor, TrainConfig,
};

use crate::allocator;
use crate::cli::{DeviceChoice, EngineArgs, EngineChoice, PrecisionChoice};
use crate::commands::device;
use crate::error::CliError;
use crate::model::ModelSource;

/// Loads a network with the engine asked for.
pub fn load(model: &ModelSource, args: &EngineArgs) -> Result<Predictor> {
    let network = model.load(args.set.as_deref())?;
    let args = args.clone();
    Predictor::of(network, move |config, weights| {
        runner(&args, config, weights)
    })
}

/// The engine asked for, with a network of this configuration and these weights.
pub fn runner(
    args: &EngineArgs,
    config: &TrainConfig,
    weights: Weights,
) -> Result<Arc<dyn DepthRunner>> {
    let on_cpu = args.device == DeviceChoice::Cpu;
    let engine = match args.engine {
        EngineChoice::Auto if on_cpu => EngineChoice::Fused,
        EngineChoice::Auto => EngineChoice::Burn,
        chosen => chosen,
    };
    if engine != EngineChoice::Burn && !on_cpu {
        return Err(CliError::OnlyOnCpu.into());
    }
    if engine != EngineChoice::Fused && args.precision != PrecisionChoice::F32 {
        return Err(CliError::OnlyFused.into());
    }
    if engine != EngineChoice::Ort && args.ort_lib.is_some() {
        return Err(CliError::OnlyOrt.into());
    }
    Ok(match engine {
        EngineChoice::Burn | EngineChoice::Auto => {
            allocator::keep_memory();
            Arc::new(BurnRunner::new(
                config,
                &weights,
                &device::open(args.device)?,
            )?)
        }
        EngineChoice::Fused => {
            let precision = match args.precision {
                PrecisionChoice::F32 => Precision::F32,
                PrecisionChoice::Bf16 => Precision::Bf16,
            };
            let packed = || FusedRunner::new(config, weights, precision);
            Arc::new(allocator::without_hoarding(packed)?)
        }
        EngineChoice::Ort => Arc::new(OrtRunner::new(args, config, weights)?),
    })
}

/// The network as an ONNX model in the user's ONNX Runtime.
#[derive(Debug)]
struct OrtRunner {
    engine: Mutex<OrtEngine>,
    pixels: usize,
}

impl OrtRunner {
    fn new(args: &EngineArgs, config: &TrainConfig, weights: Weights) -> Result<Self> {
        let bytes = write(&DepthModel {
            graph: depth_graph(&config.depth_net, weights)?,
            range: config.depth_net.range,
            width: config.size.width,
            height: config.size.height,
            trained_with: None,
        })?;
        let threads = rayon::current_num_threads();
        let engine = OrtEngine::load(args.ort_lib.as_deref(), &bytes, threads)?;
        Ok(Self {
            engine: Mutex::new(engine),
            pixels: config.size.width * config.size.height,
        })
    }
}

impl DepthRunner for OrtRunner {
    fn name(&self) -> &'static str {
        "ort"
    }

    /// An exported model gives depth alone.
    fn tells_uncertainty(&self) -> bool {
        false
    }

    fn run(&self, image: &[f32]) -> Result<NetworkOutput, Error> {
        // The model takes bytes, and an image's values are bytes / 255.
        let byte = |i: usize| (image[i % 3 * self.pixels + i / 3] * 255.0).round() as u8;
        let rgb: Vec<u8> = (0..3 * self.pixels).map(byte).collect();
        let mut disparity = vec![0.0; self.pixels];
        let mut engine = self.engine.lock().unwrap_or_else(PoisonError::into_inner);
        match engine.run(&rgb, &mut disparity) {
            Ok(()) => Ok(NetworkOutput {
                disparity,
                log_scale: None,
            }),
            Err(error) => Err(Error::engine("ort", &error)),
        }
    }
}
