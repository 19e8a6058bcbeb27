//! `deepfusion bench`: what a network costs, and how fast every stage around it is.

mod modules;

use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use deepfusion_data::{RgbImage, decode_rgb, resize_rgb, to_network_input};
use deepfusion_geometry::cloud::PointCloud;
use deepfusion_geometry::{DepthMap, Intrinsics, Se3};
use deepfusion_hint::count_of;
use deepfusion_jobs::bulk::pipeline::{self, Threads};
use deepfusion_model::weights::Weights;
use deepfusion_model::{Preset, TrainConfig};
use deepfusion_perception::{Perception, PerceptionConfig, Stamp};
use deepfusion_render::{DepthScale, depth_picture};
use deepfusion_runtime::{DepthRunner, ModelSource, Precision};
use deepfusion_sim::{SimConfig, Simulation};
use image::codecs::jpeg::JpegEncoder;
use serde::Serialize;

use self::modules::{Module, Modules};
use crate::cli::BenchArgs;
use crate::failure::Result;
use crate::model;
use crate::{devices, engine, output};

/// The picture that is decoded and resized, a simulated street: a KITTI frame's size.
const PICTURE: (u32, u32) = (1242, 375);

/// Frames a second are measured over this many images for every repeat of a stage.
const IMAGES_PER_REPEAT: usize = 3;

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

#[derive(Debug, Default, Serialize)]
struct Stages {
    decode: f64,
    resize: f64,
    network: f64,
    depth: f64,
    cloud: f64,
    targets: f64,
    colour: f64,
}

/// `deepfusion bench`.
pub(super) fn run(args: &BenchArgs) -> Result<()> {
    let (name, config, mut runner) = network(args)?;
    let modules = Modules::new(&config);
    let table = modules.table();
    let repeats = args.repeats.max(1);
    let bench = Bench::new(&config)?;
    let stages = bench.stages(&mut *runner, repeats)?;
    let profile_ms = if args.profile {
        bench.profile(&mut *runner, repeats)?
    } else {
        Vec::new()
    };
    let report = Report {
        engine: runner.name(),
        device: args.engine.device.to_string(),
        network: name,
        size: [config.size.width, config.size.height],
        parameters: modules.parameters(),
        multiply_adds: modules.multiply_adds(),
        modules: modules.into_list(),
        latency_ms: stages.sum(),
        fps: bench.overlapped_fps(&mut *runner, repeats)?,
        peak_rss_mb: peak_rss_mb(),
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
        PICTURE.0,
        PICTURE.1,
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
        (Some(model), ..) => Some(ModelSource::named(model)?),
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
    let int8 = (args.engine.precision == Precision::Int8)
        .then(|| deepfusion_jobs::int8::on_a_street(&config, &weights))
        .transpose()?;
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

impl Stages {
    fn sum(&self) -> f64 {
        self.decode
            + self.resize
            + self.network
            + self.depth
            + self.cloud
            + self.targets
            + self.colour
    }
}

/// What the stages work on.
struct Bench {
    jpeg: Vec<u8>,
    k: Intrinsics,
    /// The picture's true depth at the network's size: a network with random weights sees no targets.
    truth: DepthMap,
}

impl Bench {
    fn new(config: &TrainConfig) -> Result<Self> {
        let street = Simulation::new(&SimConfig {
            frames: 1,
            width: PICTURE.0,
            height: PICTURE.1,
            ..SimConfig::default()
        })?;
        let frame = street.frame(0);
        let mut jpeg = Vec::new();
        JpegEncoder::new_with_quality(&mut jpeg, 92).encode_image(&frame.rgb)?;
        let (width, height) = (config.size.width as u32, config.size.height as u32);
        Ok(Self {
            jpeg,
            k: street.intrinsics().resized(width, height),
            truth: frame.depth.nearest(width as usize, height as usize),
        })
    }

    fn decode(&self) -> Result<RgbImage> {
        Ok(decode_rgb(&self.jpeg, Path::new("the bench's picture"))?)
    }

    fn resize(&self, picture: &RgbImage) -> Vec<f32> {
        let whole = [0, 0, picture.width(), picture.height()];
        to_network_input(picture, whole, self.k.width, self.k.height)
    }

    fn depth(&self, disparity: &[f32]) -> DepthMap {
        DepthMap {
            width: self.k.width as usize,
            height: self.k.height as usize,
            data: disparity.iter().map(|d| d.recip()).collect(),
        }
    }

    fn cloud(&self, depth: &DepthMap, small: &RgbImage) -> Result<PointCloud> {
        Ok(PointCloud::from_depth(depth, &self.k, Some(small), 80.0)?)
    }

    /// Each stage alone.
    fn stages(&self, runner: &mut dyn DepthRunner, repeats: usize) -> Result<Stages> {
        let picture = self.decode()?;
        let small = resize_rgb(&picture, self.k.width, self.k.height);
        let input = self.resize(&picture);
        let disparity = runner.disparity(&input)?;
        let depth = self.depth(&disparity);
        Ok(Stages {
            decode: median(repeats, || self.decode())?,
            resize: median(repeats, || Ok(self.resize(&picture)))?,
            network: median(repeats, || Ok(runner.disparity(&input)?))?,
            depth: median(repeats, || Ok(self.depth(&disparity)))?,
            cloud: median(repeats, || self.cloud(&depth, &small))?,
            targets: self.targets(repeats)?,
            colour: median(repeats, || {
                Ok(depth_picture(&depth, &DepthScale::default()))
            })?,
        })
    }

    /// Ground, boxes and tracks of a picture that is seen again and again.
    fn targets(&self, repeats: usize) -> Result<f64> {
        let mut perception = Perception::new(PerceptionConfig {
            parking_rows: true,
            ..PerceptionConfig::default()
        });
        let mut time_s = 0.0;
        median(repeats, || {
            time_s += 0.1;
            let stamp = Stamp {
                time_s,
                world_from_cam: Se3::identity(),
            };
            Ok(perception.detect(&self.truth, &self.k, Some(stamp))?)
        })
    }

    /// The least each step of the network took.
    fn profile(&self, runner: &mut dyn DepthRunner, repeats: usize) -> Result<Vec<(String, f64)>> {
        let input = self.resize(&self.decode()?);
        let mut least: Vec<(String, f64)> = Vec::new();
        for _ in 0..repeats {
            let Some(steps) = runner.profile(&input) else {
                tracing::warn!("only the fused engine can time its steps");
                break;
            };
            let steps = steps
                .into_iter()
                .map(|(name, t)| (name, t.as_secs_f64() * 1e3));
            if least.is_empty() {
                least = steps.collect();
                continue;
            }
            for ((_, least), (_, ms)) in least.iter_mut().zip(steps) {
                *least = least.min(ms);
            }
        }
        Ok(least)
    }

    /// Images a second through all stages at once, from the JPEG to cloud and coloured depth in memory.
    fn overlapped_fps(&self, runner: &mut dyn DepthRunner, repeats: usize) -> Result<f64> {
        let small = resize_rgb(&self.decode()?, self.k.width, self.k.height);
        let failure = Mutex::new(None);
        let keep = |error| {
            failure
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .get_or_insert(error);
        };
        let before = |_| match self.decode() {
            Ok(picture) => Some(self.resize(&picture)),
            Err(error) => {
                keep(error);
                None
            }
        };
        let after = |_, disparity: Result<Vec<f32>>| {
            let depth = match disparity {
                Ok(disparity) => self.depth(&disparity),
                Err(error) => return keep(error),
            };
            match self.cloud(&depth, &small) {
                Ok(cloud) => drop(std::hint::black_box(cloud)),
                Err(error) => keep(error),
            }
            std::hint::black_box(depth_picture(&depth, &DepthScale::default()));
        };
        let images = repeats * IMAGES_PER_REPEAT;
        let threads = Threads::for_this_machine();
        let start = Instant::now();
        let network = |input: Vec<f32>| Ok(runner.disparity(&input)?);
        pipeline::run(images, threads, &|| false, &before, network, &after);
        let seconds = start.elapsed().as_secs_f64();
        match failure.into_inner().unwrap_or_else(PoisonError::into_inner) {
            Some(error) => Err(error),
            None => Ok(images as f64 / seconds),
        }
    }
}

/// Median time of `work` in milliseconds, after one run that is not counted.
fn median<T>(repeats: usize, mut work: impl FnMut() -> Result<T>) -> Result<f64> {
    work()?;
    let mut times = Vec::with_capacity(repeats);
    for _ in 0..repeats {
        let start = Instant::now();
        std::hint::black_box(work()?);
        times.push(start.elapsed().as_secs_f64() * 1e3);
    }
    times.sort_by(f64::total_cmp);
    Ok(times[times.len() / 2])
}

/// The most memory this process ever had, where the system reports it (Linux).
pub(super) fn peak_rss_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    let kib: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib / 1024.0)
}
