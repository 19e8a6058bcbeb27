//! How fast a network is, and every stage around it: from a JPEG to depth, cloud, targets and colours.

mod modules;
mod report;

use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use deepfusion_data::{RgbImage, decode_rgb, resize_rgb, to_network_input};
use deepfusion_geometry::cloud::PointCloud;
use deepfusion_geometry::{DepthMap, Intrinsics, Se3};
use deepfusion_model::TrainConfig;
use deepfusion_perception::{Perception, PerceptionConfig, Stamp};
use deepfusion_render::{DepthScale, depth_picture};
use deepfusion_runtime::DepthRunner;
use deepfusion_sim::{SimConfig, Simulation};
use image::codecs::jpeg::JpegEncoder;
use serde::Serialize;

pub use self::modules::ModuleCosts;
pub use self::report::{BenchReport, BenchRequest};

use crate::Result;
use crate::bulk::pipeline::{self, Threads};

/// Size of the picture that is decoded and resized, a simulated street: a KITTI frame's size.
pub const PICTURE_SIZE: (u32, u32) = (1242, 375);

/// Frames per second are measured over this many images for every repeat of a stage.
pub const IMAGES_PER_REPEAT: usize = 3;

/// Milliseconds of each stage.
#[derive(Debug, Default, Clone, Copy, Serialize)]
pub struct Stages {
    /// Decoding the JPEG to pixels.
    pub decode: f64,
    /// Resizing to the network's input and converting to floats.
    pub resize: f64,
    /// The network.
    pub network: f64,
    /// Disparity to metres.
    pub depth: f64,
    /// Computing coloured points.
    pub cloud: f64,
    /// Finding boxes and tracks, in the picture's true depth.
    pub targets: f64,
    /// Drawing depth as a picture.
    pub colour: f64,
}

impl Stages {
    /// Time for one image, one stage after another.
    #[must_use]
    pub fn sum(&self) -> f64 {
        self.decode
            + self.resize
            + self.network
            + self.depth
            + self.cloud
            + self.targets
            + self.colour
    }
}

/// The input of the stages: a picture of a simulated street.
pub struct StreetBench {
    jpeg: Vec<u8>,
    k: Intrinsics,
    /// The picture's true depth at the network's size: a network with random weights finds no targets.
    truth: DepthMap,
}

impl StreetBench {
    /// A benchmark for a network of this configuration.
    ///
    /// # Errors
    /// A street that cannot be simulated or encoded.
    pub fn new(config: &TrainConfig) -> Result<Self> {
        let street = Simulation::new(&SimConfig {
            frames: 1,
            width: PICTURE_SIZE.0,
            height: PICTURE_SIZE.1,
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
        Ok(decode_rgb(
            &self.jpeg,
            Path::new("the benchmark's picture"),
        )?)
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

    /// The median time of each stage alone, over `repeats` runs.
    ///
    /// # Errors
    /// The error of the network's engine.
    pub fn stages(&self, runner: &mut dyn DepthRunner, repeats: usize) -> Result<Stages> {
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

    /// Finding ground, boxes and tracks in the same picture, again and again.
    fn targets(&self, repeats: usize) -> Result<f64> {
        let mut perception = Perception::new(PerceptionConfig::default().with_parking_rows());
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

    /// The shortest time of each step of the network, in milliseconds; empty if its engine cannot time them.
    ///
    /// # Errors
    /// A picture that cannot be decoded.
    pub fn profile(
        &self,
        runner: &mut dyn DepthRunner,
        repeats: usize,
    ) -> Result<Vec<(String, f64)>> {
        let input = self.resize(&self.decode()?);
        let mut least: Vec<(String, f64)> = Vec::new();
        for _ in 0..repeats {
            let Some(steps) = runner.profile(&input) else {
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

    /// Images per second through all stages at once, from the JPEG to cloud and coloured depth in memory.
    ///
    /// # Errors
    /// The first error of any stage.
    pub fn overlapped_fps(&self, runner: &mut dyn DepthRunner, repeats: usize) -> Result<f64> {
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

/// The weights of a configuration's depth network before its first step: how fast a network is does not depend on what it learned.
///
/// # Errors
/// A network that cannot be built.
#[cfg(feature = "train")]
pub fn first_weights(config: &TrainConfig) -> Result<deepfusion_model::weights::Weights> {
    let device = deepfusion_train::Device::flex();
    let net = deepfusion_nn::DepthNet::new(&config.depth_net, &device)?;
    Ok(deepfusion_nn::weights::collect(&net))
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
