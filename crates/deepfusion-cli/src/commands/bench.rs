//! `deepfusion bench`: the cost of a network, and the speed of every stage around it.

use deepfusion_jobs::bench::BenchRequest;
use deepfusion_model::weights::Weights;
use deepfusion_model::{Preset, TrainConfig};
use deepfusion_runtime::{DepthRunner, Precision};

use crate::cli::BenchArgs;
use crate::failure::Result;
use crate::model;
use crate::{engine, output};

/// `deepfusion bench`.
pub(super) fn run(args: &BenchArgs) -> Result<()> {
    let (name, config, mut runner) = network(args)?;
    let request = BenchRequest {
        network: &name,
        config: &config,
        device: &args.engine.device.to_string(),
        repeats: args.repeats,
        profile: args.profile,
    };
    let report = request.measure(&mut *runner)?;
    if args.profile && report.profile_ms.is_empty() {
        tracing::warn!("--profile: only the fused engine can time its steps");
    }
    if args.json {
        return output::print_json(&report);
    }
    output::print(&report.to_string())
}

/// The network asked for: its name, its configuration and what runs it.
fn network(args: &BenchArgs) -> Result<(String, TrainConfig, Box<dyn DepthRunner>)> {
    let model = match (&args.model, args.preset, args.size) {
        (Some(model), ..) => Some(model::named(model)?),
        (None, None, None) => model::embedded_default()?,
        // `--preset` or `--size`: not the embedded network.
        (None, ..) => None,
    };
    if let Some(model) = model {
        let estimator = engine::load(&model, &args.engine)?;
        let config = estimator.config().clone();
        let name = model.given().display().to_string();
        return Ok((name, config, estimator.into_runner()));
    }
    let preset = args.preset.unwrap_or(Preset::Tiny);
    let mut config = preset.config();
    if let Some(size) = args.size {
        config.size.width = size.width as usize;
        config.size.height = size.height as usize;
    }
    config.validate()?;
    let weights = first_weights(&config)?;
    let int8 = if args.engine.precision == Precision::Int8 {
        Some(deepfusion_jobs::int8::on_a_street(&config, &weights)?)
    } else {
        None
    };
    let runner = engine::runner(&args.engine, &config, weights, int8.as_ref())?;
    Ok((preset.to_string(), config, runner))
}

/// The weights of a preset's network before its first step.
#[cfg(feature = "train")]
fn first_weights(config: &TrainConfig) -> Result<Weights> {
    Ok(deepfusion_jobs::bench::first_weights(config)?)
}

#[cfg(not(feature = "train"))]
fn first_weights(_: &TrainConfig) -> Result<Weights> {
    let what = "--preset";
    Err(crate::error::CliError::BuiltWithoutTraining { what }.into())
}
