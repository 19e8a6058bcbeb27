//! The targets of one depth image of a street, and of a drive with tracking.

#![allow(missing_docs)]

use criterion::{Criterion, criterion_group, criterion_main};
use deepfusion_perception::{Perception, PerceptionConfig, Stamp};
use deepfusion_sim::{SimConfig, Simulation};

fn targets(criterion: &mut Criterion) {
    let simulation = Simulation::new(&SimConfig {
        seed: 5,
        frames: 20,
        moving_cars: 6,
        ..SimConfig::default()
    })
    .expect("a plain street");
    let k = simulation.intrinsics();
    let frames: Vec<_> = (0..20).map(|i| simulation.frame(i)).collect();
    let mut group = criterion.benchmark_group("targets");
    for (name, config) in [
        ("true depth, 640x192", PerceptionConfig::default()),
        (
            "predicted depth's settings, 640x192",
            PerceptionConfig::predicted(),
        ),
    ] {
        let mut perception = Perception::new(config);
        let (mut i, mut time_s) = (0, 0.0);
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                i = (i + 1) % frames.len();
                time_s += 0.1;
                let stamp = Stamp {
                    time_s,
                    world_from_cam: frames[i].world_from_cam,
                };
                perception.look(&frames[i].depth, &k, Some(stamp))
            });
        });
    }
    group.finish();
}

criterion_group!(benches, targets);
criterion_main!(benches);
