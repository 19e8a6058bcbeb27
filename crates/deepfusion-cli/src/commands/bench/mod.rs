//! `deepfusion bench`: what a network costs, and how fast every stage around it is.

mod modules;

use deepfusion_hint::count_of;
use deepfusion_jobs::bench::{IMAGES_PER_REPEAT, PICTURE_SIZE, Stages, StreetBench};
use deepfusion_jobs::machine;
use deepfusion_model::weights::Weights;
use deepfusion_model::{Preset, TrainConfig};
use deepfusion_runtime::{DepthRunner, Precision};
use serde::Serialize;

use self::modules::{Module, Modules};
use crate::cli::BenchArgs;
use crate::failure::Result;
use crate::model;
use crate::{devices, engine, output};

#[derive(Debug, Serialize)]
struct Report {
    engine: &'static str,
    device: String,
    network: String,
    size: [usize; 2],
    /// That the depth network learns.
    parameters: u64,
    /// In the depth network's convolutions, for one image.
    multiply_adds: u64,
    /// Median of each stage.
    stages_ms: Stages,
    /// From decode to colour, one after another.
    latency_ms: f64,
    /// Of all stages, overlapped as `predict` overlaps them.
    fps: f64,
    peak_rss_mb: Option<f64>,
    peak_device_mb: Option<f64>,
    /// What each part of the networks costs.
    modules: Vec<Module>,
    /// Least milliseconds of each step of the network, where asked for and known.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    profile_ms: Vec<(String, f64)>,
}

/// `deepfusion bench`.
pub(super) fn run(args: &BenchArgs) -> Result<()> {
    let (name, config, mut runner) = network(args)?;
    let modules = Modules::new(&config);
    let (whole, table) = (modules.whole(), modules.table());
    let repeats = args.repeats.max(1);
    let bench = StreetBench::new(&config)?;
    let stages = bench.stages(&mut *runner, repeats)?;
    let profile_ms = if args.profile {
        let profile = bench.profile(&mut *runner, repeats)?;
        if profile.is_empty() {
            tracing::warn!("only the fused engine can time its steps");
        }
        profile
    } else {
        Vec::new()
    };
    let report = Report {
        engine: runner.name(),
        device: args.engine.device.to_string(),
        network: name,
        size: [config.size.width, config.size.height],
        parameters: whole.parameters,
        multiply_adds: whole.multiply_adds,
        modules: modules.list(),
        latency_ms: stages.sum(),
        fps: bench.overlapped_fps(&mut *runner, repeats)?,
        peak_rss_mb: machine::peak_rss_mb(),
        peak_device_mb: runner.peak_device_bytes().map(devices::megabytes),
        profile_ms,
        stages_ms: stages,
    };
    if args.json {
        return output::print_json(&report);
    }
    let s = &report.stages_ms;
    let mut memory = report
        .peak_rss_mb
        .map_or("?".into(), |m| format!("{m:.0} MB"));
    if let Some(on_device) = report.peak_device_mb {
        memory = format!("{memory}, {on_device:.0} MB on the device");
    }
    output::print(&format!(
        "{} at {}x{}, {:.2} M parameters, {:.2} G multiply-adds, {} engine on {}\n\
         median of {}, ms\n\
         decode  {:8.2}   JPEG {}x{}\n\
         resize  {:8.2}   Lanczos, to a tensor\n\
         network {:8.2}\n\
         depth   {:8.2}   disparity to metres\n\
         cloud   {:8.2}   coloured points\n\
         targets {:8.2}   boxes and tracks from the picture's true depth\n\
         colour  {:8.2}   depth as a picture\n\
         all     {:8.2}   one after another: what an image waits\n\
         {:.1} frames a second, the stages of {} overlapped; peak memory {memory}\n",
        report.network,
        report.size[0],
        report.size[1],
        report.parameters as f64 / 1e6,
        report.multiply_adds as f64 / 1e9,
        report.engine,
        report.device,
        count_of(repeats, "run"),
        s.decode,
        PICTURE_SIZE.0,
        PICTURE_SIZE.1,
        s.resize,
        s.network,
        s.depth,
        s.cloud,
        s.targets,
        s.colour,
        report.latency_ms,
        report.fps,
        count_of(repeats * IMAGES_PER_REPEAT, "image"),
    ))?;
    output::print(&format!("\n{table}"))?;
    output::print(&profile_table(&report.profile_ms))
}

/// The steps in order, a line each with its share.
fn profile_table(steps: &[(String, f64)]) -> String {
    let total: f64 = steps.iter().map(|(_, ms)| ms).sum();
    let line =
        |(name, ms): &(String, f64)| format!("{ms:8.2} {:5.1} %   {name}\n", 100.0 * ms / total);
    steps.iter().map(line).collect()
}

/// The network asked for: its name, its configuration and what runs it.
fn network(args: &BenchArgs) -> Result<(String, TrainConfig, Box<dyn DepthRunner>)> {
    let model = match (&args.model, args.preset, args.size) {
        (Some(model), ..) => Some(model::named(model)?),
        (None, None, None) => model::embedded_default()?,
        // The size is a preset's.
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
    let device = burn::tensor::Device::flex();
    let net = deepfusion_nn::DepthNet::new(&config.depth_net, &device)?;
    Ok(deepfusion_nn::weights::collect(&net))
}

#[cfg(not(feature = "train"))]
fn first_weights(_: &TrainConfig) -> Result<Weights> {
    let what = "--preset";
    Err(crate::error::CliError::BuiltWithoutTraining { what }.into())
}
