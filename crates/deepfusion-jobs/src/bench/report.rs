//! All that is measured of a network, as lines and as JSON.

use std::fmt;

use deepfusion_hint::count_of;
use deepfusion_model::TrainConfig;
use deepfusion_runtime::DepthRunner;
use serde::Serialize;

use super::{IMAGES_PER_REPEAT, ModuleCosts, PICTURE_SIZE, Stages, StreetBench};
use crate::devices::megabytes;
use crate::{Result, machine};

/// What a network costs, and how fast every stage around it is: lines for people, JSON for scripts.
#[derive(Debug, Serialize)]
pub struct BenchReport {
    /// The engine that runs it.
    pub engine: &'static str,
    /// The device that it runs on.
    pub device: String,
    /// The network's name.
    pub network: String,
    /// Width and height of its input.
    pub size: [usize; 2],
    /// Number of parameters that the depth network learns.
    pub parameters: u64,
    /// Multiply-adds in the depth network's convolutions, for one image.
    pub multiply_adds: u64,
    /// Median time of each stage.
    pub stages_ms: Stages,
    /// Time for one image from decoding to colour, one stage after another.
    pub latency_ms: f64,
    /// Frames per second of all stages, overlapped as in a bulk run.
    pub fps: f64,
    /// The process's peak memory.
    pub peak_rss_mb: Option<f64>,
    /// The peak memory on the device.
    pub peak_device_mb: Option<f64>,
    /// What each part of the networks costs.
    pub modules: ModuleCosts,
    /// The shortest time of each step of the network in milliseconds, if requested and known.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub profile_ms: Vec<(String, f64)>,
    /// How often every stage was run.
    #[serde(skip)]
    pub repeats: usize,
}

/// A network to measure.
#[derive(Debug, Clone, Copy)]
pub struct BenchRequest<'a> {
    /// The network's name.
    pub network: &'a str,
    /// The network's configuration.
    pub config: &'a TrainConfig,
    /// Name of the device that it runs on.
    pub device: &'a str,
    /// How often every stage is run, at least once.
    pub repeats: usize,
    /// Whether the network's steps are timed too, if the engine can.
    pub profile: bool,
}

impl BenchRequest<'_> {
    /// Measures the network on `runner`.
    ///
    /// # Errors
    /// A street that cannot be simulated or encoded; an error of the network's engine.
    pub fn measure(self, runner: &mut dyn DepthRunner) -> Result<BenchReport> {
        let (config, repeats) = (self.config, self.repeats.max(1));
        let modules = ModuleCosts::new(config);
        let depth = modules.depth_network();
        let bench = StreetBench::new(config)?;
        let stages = bench.stages(runner, repeats)?;
        let profile_ms = if self.profile {
            bench.profile(runner, repeats)?
        } else {
            Vec::new()
        };
        Ok(BenchReport {
            engine: runner.name(),
            device: self.device.to_owned(),
            network: self.network.to_owned(),
            size: [config.size.width, config.size.height],
            parameters: depth.parameters,
            multiply_adds: depth.multiply_adds,
            modules,
            latency_ms: stages.sum(),
            fps: bench.overlapped_fps(runner, repeats)?,
            peak_rss_mb: machine::peak_rss_mb(),
            peak_device_mb: runner.peak_device_bytes().map(megabytes),
            profile_ms,
            stages_ms: stages,
            repeats,
        })
    }
}

impl fmt::Display for BenchReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let s = &self.stages_ms;
        let mut memory = self
            .peak_rss_mb
            .map_or("?".into(), |m| format!("{m:.0} MB"));
        if let Some(on_device) = self.peak_device_mb {
            memory = format!("{memory}, {on_device:.0} MB on the device");
        }
        write!(
            f,
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
             {:.1} frames a second, the stages of {} overlapped; peak memory {memory}\n\
             \n{}",
            self.network,
            self.size[0],
            self.size[1],
            self.parameters as f64 / 1e6,
            self.multiply_adds as f64 / 1e9,
            self.engine,
            self.device,
            count_of(self.repeats, "run"),
            s.decode,
            PICTURE_SIZE.0,
            PICTURE_SIZE.1,
            s.resize,
            s.network,
            s.depth,
            s.cloud,
            s.targets,
            s.colour,
            self.latency_ms,
            self.fps,
            count_of(self.repeats * IMAGES_PER_REPEAT, "image"),
            self.modules,
        )?;
        write_profile(f, &self.profile_ms)
    }
}

/// The steps in order, a line each with its share of the time.
fn write_profile(f: &mut fmt::Formatter<'_>, steps: &[(String, f64)]) -> fmt::Result {
    let total: f64 = steps.iter().map(|(_, ms)| ms).sum();
    steps
        .iter()
        .try_for_each(|(name, ms)| writeln!(f, "{ms:8.2} {:5.1} %   {name}", 100.0 * ms / total))
}
