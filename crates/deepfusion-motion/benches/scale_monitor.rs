//! The scale monitor's work for each frame of a street: the frame's texture, and the costs of a pair of frames.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a benchmark panics if it cannot run"
)]
#![allow(missing_docs)]

use criterion::{Criterion, criterion_group, criterion_main};
use deepfusion_motion::{GreyImage, GroundPair, RoadTexture, ScaleMonitor, ScaleMonitorConfig};
use deepfusion_sim::{SimConfig, Simulation};
use nalgebra::Vector3;
use std::sync::Arc;

const FRAMES: usize = 21;
const SIZE: [u32; 2] = [320, 96];

fn monitor(criterion: &mut Criterion) {
    let simulation = Simulation::new(&SimConfig {
        seed: 5,
        frames: FRAMES,
        width: SIZE[0],
        height: SIZE[1],
        ..SimConfig::default()
    })
    .expect("a plain street");
    let [width, height] = SIZE.map(|size| size as usize);
    let images: Vec<GreyImage> = (0..FRAMES)
        .map(|frame| GreyImage {
            width,
            height,
            data: simulation
                .frame(frame)
                .rgb
                .pixels()
                .map(|p| f32::from(p[1]))
                .collect(),
        })
        .collect();
    let textures: Vec<_> = images
        .iter()
        .map(|image| Arc::new(RoadTexture::from(image)))
        .collect();
    let pairs: Vec<GroundPair> = (1..FRAMES)
        .map(|i| GroundPair {
            earlier: textures[i - 1].clone(),
            later: textures[i].clone(),
            intrinsics: simulation.intrinsics(),
            seconds: 0.1,
            earlier_from_later: simulation.world_from_cam(i - 1).inverse()
                * simulation.world_from_cam(i),
            down_in_cam: Vector3::y(),
        })
        .collect();
    let mut group = criterion.benchmark_group("scale monitor, 320x96");
    group.bench_function("texture", |bencher| {
        bencher.iter(|| RoadTexture::from(&images[0]));
    });
    let mut monitor = ScaleMonitor::new(ScaleMonitorConfig::default());
    let mut i = 0;
    group.bench_function("pair", |bencher| {
        bencher.iter(|| {
            i = (i + 1) % pairs.len();
            monitor.add(&pairs[i], None)
        });
    });
    group.finish();
}

criterion_group!(benches, monitor);
criterion_main!(benches);
