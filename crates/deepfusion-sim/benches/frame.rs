//! One frame at 640×192 and one scan, on all cores, and views of the endless mode, on one core:
//! `cargo bench -p deepfusion-sim`.

use criterion::Criterion;
use deepfusion_sim::{Endless, EndlessConfig, SimConfig, Simulation};
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
    // Frames from the whole drive, so that the result does not depend on a single place.
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

fn views(c: &mut Criterion) {
    let mut group = c.benchmark_group("endless");
    group.sample_size(20);
    for (width, height) in [(320, 96), (640, 192)] {
        let config = EndlessConfig {
            width,
            height,
            views_per_world: 1000,
            ..EndlessConfig::default()
        };
        let Ok(endless) = Endless::new(config) else {
            return;
        };
        // Build every world before measuring.
        for index in 0..16 {
            let _ = endless.view(index);
        }
        let mut number = 0;
        group.bench_function(format!("view {width}x{height}"), |b| {
            b.iter(|| {
                number = (number + 1) % 1000;
                black_box(endless.view(number))
            });
        });
    }
    let config = EndlessConfig {
        width: 16,
        height: 16,
        worlds_at_once: 1,
        views_per_world: 1,
        ..EndlessConfig::default()
    };
    let Ok(endless) = Endless::new(config) else {
        return;
    };
    // Every view is of a new world and has few pixels.
    let mut number = 0;
    group.bench_function("world", |b| {
        b.iter(|| {
            number += 1;
            black_box(endless.view(number))
        });
    });
    group.finish();
}

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    frames(&mut criterion);
    views(&mut criterion);
    criterion.final_summary();
}
