//! The targets of one depth image of a street, and of a drive with tracking.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a benchmark panics if it cannot run"
)]
#![allow(missing_docs)]

use criterion::{Criterion, criterion_group, criterion_main};
use deepfusion_geometry::Intrinsics;
use deepfusion_perception::{Perception, PerceptionConfig, Stamp};
use deepfusion_sim::{Scene, SimConfig, SimFrame, Simulation};

/// The camera and the frames of a short drive.
fn drive(scene: Scene) -> (Intrinsics, Vec<SimFrame>) {
    let simulation = Simulation::new(&SimConfig {
        scene,
        seed: 5,
        frames: 20,
        moving_cars: 6,
        ..SimConfig::default()
    })
    .expect("a plain drive");
    let frames = (0..20).map(|i| simulation.frame(i)).collect();
    (simulation.intrinsics(), frames)
}

fn targets(criterion: &mut Criterion) {
    let street = drive(Scene::Urban);
    let garage = drive(Scene::Garage);
    let mut group = criterion.benchmark_group("targets");
    for (name, (k, frames), config) in [
        ("true depth, 640x192", &street, PerceptionConfig::default()),
        (
            "predicted depth's settings, 640x192",
            &street,
            PerceptionConfig::predicted(),
        ),
        (
            "rows of cars in a garage, 640x192",
            &garage,
            PerceptionConfig {
                parking_rows: true,
                ..PerceptionConfig::default()
            },
        ),
    ] {
        let mut perception = Perception::new(config);
        let (mut i, mut time_s) = (0, 0.0);
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                i = (i + 1) % frames.len();
                time_s += 0.1;
                if i == 0 {
                    // The drive starts again: nothing remembered is in view.
                    perception.reset();
                }
                let stamp = Stamp {
                    time_s,
                    world_from_cam: frames[i].world_from_cam,
                };
                perception.detect(&frames[i].depth, k, Some(stamp))
            });
        });
    }
    group.finish();
}

criterion_group!(benches, targets);
criterion_main!(benches);
