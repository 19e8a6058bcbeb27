//! The engine that runs a trained network, as chosen on the command line.

use deepfusion_jobs::engine::Engine;
use deepfusion_model::weights::Weights;
use deepfusion_model::{Int8Calibration, TrainConfig};
use deepfusion_runtime::{DepthEstimator, DepthRunner, ModelSource};

use crate::allocator;
use crate::cli::EngineArgs;
#[cfg(feature = "train")]
use crate::devices;
use crate::failure::Result;

/// Loads a network with the chosen engine.
pub(crate) fn load(model: &ModelSource, args: &EngineArgs) -> Result<DepthEstimator> {
    let network = model.load(args.set.as_deref())?;
    let int8 = args.settings().calibration(&network)?;
    let args = args.clone();
    Ok(DepthEstimator::of(network, move |config, weights| {
        runner(&args, config, weights, int8.as_ref())
    })?)
}

/// The chosen engine, with a network of this configuration, these weights and this calibration.
pub(crate) fn runner(
    args: &EngineArgs,
    config: &TrainConfig,
    weights: Weights,
    int8: Option<&Int8Calibration>,
) -> deepfusion_jobs::Result<Box<dyn DepthRunner>> {
    let settings = args.settings();
    let engine = settings.chosen()?;
    if engine == Engine::Burn {
        allocator::keep_memory();
        // Prints the device's name before the network is built on it.
        #[cfg(feature = "train")]
        devices::open(args.device)?;
    }
    let packed = || settings.runner(config, weights, int8);
    Ok(match engine {
        Engine::Fused => allocator::without_hoarding(packed)?,
        _ => packed()?,
    })
}
