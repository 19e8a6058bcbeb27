//! Metric disparity of 640×192 to a coloured cloud: `cargo bench -p deepfusion-geometry`. `benches/peers/cloud_numpy.py` does the same with
//! NumPy, on the same numbers.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a benchmark panics if it cannot run"
)]

use criterion::{Criterion, criterion_main};
use deepfusion_geometry::cloud::PointCloud;
use deepfusion_geometry::{DepthMap, Intrinsics};
use std::hint::black_box;

const WIDTH: usize = 640;
const HEIGHT: usize = 192;
const MAX_DEPTH_M: f32 = 80.0;

fn camera() -> Intrinsics {
    Intrinsics {
        fx: 0.58 * WIDTH as f64,
        fy: 1.92 * HEIGHT as f64,
        cx: 319.5,
        cy: 95.5,
        width: WIDTH as u32,
        height: HEIGHT as u32,
    }
}

/// A street's disparities: a ground plane below the horizon, noise beyond 80 m (no points) above it.
fn disparity() -> Vec<f32> {
    (0..WIDTH * HEIGHT)
        .map(|i| {
            let (x, y) = ((i % WIDTH) as f32, (i / WIDTH) as f32);
            let ground = ((y - 80.0) / (1.65 * 369.0)).max(0.0);
            ground + 0.011 + 0.004 * (x * 0.37).sin() * (y * 0.53).cos()
        })
        .collect()
}

fn cloud(criterion: &mut Criterion) {
    let (k, disparity) = (camera(), disparity());
    let rgb: Vec<u8> = (0..WIDTH * HEIGHT * 3).map(|i| (i * 7) as u8).collect();
    let depth = DepthMap {
        width: WIDTH,
        height: HEIGHT,
        data: disparity.iter().map(|d| 1.0 / d).collect(),
    };
    let make = || PointCloud::from_disparity(black_box(&disparity), &k, Some(&rgb), MAX_DEPTH_M);
    println!("{} points", make().expect("the sizes agree").len());
    criterion.bench_function("disparity to coloured cloud", |b| b.iter(make));
    criterion.bench_function("depth to coloured cloud", |b| {
        b.iter(|| PointCloud::from_depth(black_box(&depth), &k, Some(&rgb), MAX_DEPTH_M));
    });
}

// The macro generates a public function that cannot be documented.
#[allow(missing_docs)]
mod group {
    use super::{Criterion, cloud};
    use criterion::criterion_group;
    use std::time::Duration;

    criterion_group! {
        name = clouds;
        config = Criterion::default().sample_size(40).warm_up_time(Duration::from_millis(300))
            .measurement_time(Duration::from_secs(2));
        targets = cloud
    }
}
use group::clouds;
criterion_main!(clouds);
