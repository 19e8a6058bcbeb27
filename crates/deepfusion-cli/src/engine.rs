//! What runs a trained network: the choice made on the command line.

use deepfusion_infer::Precision;
use deepfusion_model::weights::Weights;
use deepfusion_model::{Int8Calibration, TrainConfig};
use deepfusion_runtime::{DepthEstimator, DepthRunner, FusedRunner, ModelSource, OrtRunner};

use crate::allocator;
use crate::cli::{Engine, EngineArgs};
use crate::devices::Backend;
use crate::error::CliError;
use crate::failure::Result;

/// Loads a network with the engine asked for.
pub(crate) fn load(model: &ModelSource, args: &EngineArgs) -> Result<DepthEstimator> {
    let network = model.load(args.set.as_deref())?;
    let int8 = match args.precision {
        Precision::Int8 => network
            .int8
            .clone()
            .map_err(deepfusion_runtime::Error::from)?,
        _ => None,
    };
    let args = args.clone();
    DepthEstimator::of(network, move |config, weights| {
        runner(&args, config, weights, int8.as_ref())
    })
}

/// The engine asked for, with a network of this configuration and these weights, and what it was calibrated to.
pub(crate) fn runner(
    args: &EngineArgs,
    config: &TrainConfig,
    weights: Weights,
    int8: Option<&Int8Calibration>,
) -> Result<Box<dyn DepthRunner>> {
    let on_cpu = args.device.backend == Backend::Cpu;
    let engine = match args.engine {
        Engine::Auto if on_cpu => Engine::Fused,
        Engine::Auto => Engine::Burn,
        chosen => chosen,
    };
    if engine != Engine::Burn && !on_cpu {
        return Err(CliError::OnlyOnCpu.into());
    }
    if engine != Engine::Fused && args.precision != Precision::F32 {
        return Err(CliError::OnlyFused.into());
    }
    if engine != Engine::Ort && args.ort_lib.is_some() {
        return Err(CliError::OnlyOrt.into());
    }
    Ok(match engine {
        Engine::Burn | Engine::Auto => in_burn(args, config, &weights)?,
        Engine::Fused => {
            let packed = || FusedRunner::with_calibration(config, weights, args.precision, int8);
            Box::new(allocator::without_hoarding(packed)?)
        }
        Engine::Ort => Box::new(OrtRunner::new(args.ort_lib.as_deref(), config, weights)?),
    })
}

/// The network as it is trained.
#[cfg(feature = "train")]
fn in_burn(
    args: &EngineArgs,
    config: &TrainConfig,
    weights: &Weights,
) -> Result<Box<dyn DepthRunner>> {
    use crate::devices;
    use deepfusion_train::BurnRunner;

    allocator::keep_memory();
    let device = devices::open(args.device)?;
    Ok(Box::new(BurnRunner::new(config, weights, &device)?))
}

#[cfg(not(feature = "train"))]
fn in_burn(_: &EngineArgs, _: &TrainConfig, _: &Weights) -> Result<Box<dyn DepthRunner>> {
    Err(CliError::BuiltWithoutTraining {
        what: "--engine burn, or another device than the processor,",
    }
    .into())
}
