//! One frame at 640×192 and one scan, on all cores: `cargo bench -p deepfusion-sim`.

use criterion::Criterion;
use deepfusion_sim::{SimConfig, Simulation};
use std::hint::black_box;

fn frames(c: &mut Criterion) {
    let config = SimConfig {
        frames: 64,
        moving_cars: 4,
        ..SimConfig::default()
    };
    let Ok(simulation) = Simulation::new(&config) else {
        return;
    };
    let mut group = c.benchmark_group("simulator");
    group.sample_size(20);
    // Frames all along the drive, so that no one place decides.
    let mut number = 0;
    let mut next = move || {
        number = (number + 13) % 64;
        number
    };
    group.bench_function("frame 640x192", |b| {
        b.iter(|| black_box(simulation.frame(next())));
    });
    group.bench_function("velodyne scan", |b| {
        b.iter(|| black_box(simulation.velodyne(32)));
    });
    group.bench_function("street of 64 frames", |b| {
        b.iter(|| black_box(Simulation::new(&config).is_ok()));
    });
    group.finish();
}

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    frames(&mut criterion);
    criterion.final_summary();
}
