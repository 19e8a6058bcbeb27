use std::time::Instant;

use anyhow::Result;
use burn::tensor::{Device, Tensor, TensorData};
use deepfusion_cloud::PointCloud;
use deepfusion_data::{RgbImage, resize_rgb, to_chw};
use deepfusion_geometry::{DepthMap, Intrinsics};
use deepfusion_nn::DepthNet;
use deepfusion_render::{DepthScale, depth_picture};
use deepfusion_train::TrainConfig;
use image::codecs::jpeg::JpegEncoder;
use serde::Serialize;

use super::{device, train::preset};
use crate::cli::{BenchArgs, PresetChoice};
use crate::output;

/// The picture that is decoded and resized: a KITTI frame's size.
const PICTURE: (u32, u32) = (1242, 375);

#[derive(Debug, Serialize)]
struct Report {
    engine: &'static str,
    device: &'static str,
    network: String,
    size: [usize; 2],
    parameters: usize,
    /// Median of each stage.
    stages_ms: Stages,
    /// Of decode to cloud, one after another.
    fps: f64,
    peak_rss_mb: Option<f64>,
    peak_device_mb: Option<f64>,
}

#[derive(Debug, Default, Serialize)]
struct Stages {
    decode: f64,
    resize: f64,
    network: f64,
    depth: f64,
    cloud: f64,
    colour: f64,
}

/// `deepfusion bench`.
pub fn run(args: &BenchArgs) -> Result<()> {
    let device = device::open(args.device)?;
    let (name, config, net) = match &args.model {
        Some(path) => {
            let (config, net) = deepfusion_train::load_depth_net(path, &device)?;
            let name = path.display().to_string();
            (name, config, net)
        }
        None => {
            let preset = preset(args.preset.unwrap_or(PresetChoice::Tiny));
            let mut config = preset.config();
            if let Some(size) = args.size {
                config.size.width = size.width as usize;
                config.size.height = size.height as usize;
            }
            config.validate()?;
            let net = config.depth_net.init(&device)?;
            (preset.to_string(), config, net)
        }
    };
    let stages = measure(&config, &net, &device, args.repeats.max(1))?;
    let total = stages.decode + stages.resize + stages.network + stages.depth + stages.cloud;
    let report = Report {
        engine: "burn",
        device: device::name(args.device),
        network: name,
        size: [config.size.width, config.size.height],
        parameters: deepfusion_nn::weights::collect(&net).value_count(),
        fps: 1e3 / total,
        peak_rss_mb: peak_rss_mb(),
        peak_device_mb: None,
        stages_ms: stages,
    };
    if args.json {
        return output::print_json(&report);
    }
    let s = &report.stages_ms;
    let memory = report
        .peak_rss_mb
        .map_or("?".into(), |m| format!("{m:.0} MB"));
    output::print(&format!(
        "{} at {}x{}, {:.2} M parameters, {} engine on {}\n\
         median of {} runs, ms\n\
         decode  {:8.2}   JPEG {}x{}\n\
         resize  {:8.2}   Lanczos, to a tensor\n\
         network {:8.2}\n\
         depth   {:8.2}   disparity to metres\n\
         cloud   {:8.2}   coloured points\n\
         colour  {:8.2}   depth as a picture\n\
         {:.1} frames a second from decode to cloud, peak memory {memory}\n",
        report.network,
        report.size[0],
        report.size[1],
        report.parameters as f64 / 1e6,
        report.engine,
        report.device,
        args.repeats,
        s.decode,
        PICTURE.0,
        PICTURE.1,
        s.resize,
        s.network,
        s.depth,
        s.cloud,
        s.colour,
        report.fps,
    ))
}

fn measure(
    config: &TrainConfig,
    net: &DepthNet,
    device: &Device,
    repeats: usize,
) -> Result<Stages> {
    let (w, h) = (config.size.width, config.size.height);
    let picture = RgbImage::from_fn(PICTURE.0, PICTURE.1, |x, y| {
        image::Rgb([(x * 7 + y * 3) as u8, (x ^ y) as u8, (y * 5) as u8])
    });
    let mut jpeg = Vec::new();
    JpegEncoder::new_with_quality(&mut jpeg, 92).encode_image(&picture)?;
    let decode = median(repeats, || {
        image::load_from_memory(&jpeg).map(|i| i.to_rgb8())
    })?;
    let resize = median(repeats, || {
        Ok::<_, anyhow::Error>(to_chw(&resize_rgb(&picture, w as u32, h as u32)))
    })?;
    let small = resize_rgb(&picture, w as u32, h as u32);
    let input = to_chw(&small);
    let range = config.depth_net.range;
    let mut sigmoid = Vec::new();
    let network = median(repeats, || {
        let x = Tensor::from_data(TensorData::new(input.clone(), [1, 3, h, w]), device);
        let finest = net.forward(x).swap_remove(0);
        sigmoid = finest.into_data().iter::<f32>().collect();
        Ok::<_, anyhow::Error>(())
    })?;
    let mut depth = DepthMap::empty(w, h);
    let to_metres = median(repeats, || {
        for (to, s) in depth.data.iter_mut().zip(&sigmoid) {
            *to = range.depth_m(f64::from(*s)) as f32;
        }
        Ok::<_, anyhow::Error>(())
    })?;
    let k = Intrinsics {
        fx: 0.58 * w as f64,
        fy: 1.92 * h as f64,
        cx: w as f64 / 2.0,
        cy: h as f64 / 2.0,
        width: w as u32,
        height: h as u32,
    };
    let cloud = median(repeats, || {
        PointCloud::from_depth(&depth, &k, Some(small.as_raw()), 80.0)
    })?;
    let colour = median(repeats, || {
        Ok::<_, anyhow::Error>(depth_picture(&depth, &DepthScale::default()))
    })?;
    Ok(Stages {
        decode,
        resize,
        network,
        depth: to_metres,
        cloud,
        colour,
    })
}

/// Median time of `work` in milliseconds, after one run that is not counted.
fn median<T, E>(repeats: usize, mut work: impl FnMut() -> Result<T, E>) -> Result<f64, E> {
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

/// The most memory this process ever had, where the system tells (Linux).
pub fn peak_rss_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    let kib: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib / 1024.0)
}
