//! The standard deviation of depth, in targets and in the tracker's gate.

use crate::common::blocks::{camera, scene};
use deepfusion_geometry::{DepthMap, Se3};
use deepfusion_perception::{Error, Perception, PerceptionConfig, Stamp, Surroundings, Target};

fn stamp(time_s: f64) -> Option<Stamp> {
    Some(Stamp {
        time_s,
        world_from_cam: Se3::identity(),
    })
}

/// A standard deviation of `share` of each depth.
fn sigma(depth: &DepthMap, share: f32) -> DepthMap {
    let mut sigma = depth.clone();
    sigma.data.iter_mut().for_each(|z| *z *= share);
    sigma
}

fn only(seen: &Surroundings) -> &Target {
    assert_eq!(seen.targets.len(), 1, "{:?}", seen.targets);
    &seen.targets[0]
}

/// A car whose front is at this distance.
fn car(front_m: f64) -> DepthMap {
    scene(&[([-2.6, front_m], [-0.8, front_m + 4.2], 1.5)]).0
}

/// A target's standard deviation is that of its pixels, in a single image and when tracked. Without the pixels' values it has none.
#[test]
fn a_target_has_the_standard_deviation_of_its_distance() {
    let (depth, k) = (car(14.0), camera());
    let mut deviation = sigma(&depth, 0.07);
    // Pixels outside the car, and those without a value, have no effect.
    for (s, z) in deviation.data.iter_mut().zip(&depth.data) {
        if !(13.5..19.0).contains(z) {
            *s = 50.0;
        }
    }
    let middle = 100 * depth.width + 260;
    deviation.data[middle] = f32::NAN;
    for time in [None, stamp(0.0)] {
        let mut perception = Perception::new(PerceptionConfig::default());
        let seen = perception.detect_with_sigma(&depth, Some(&deviation), &k, time, &[]);
        let seen = seen.unwrap();
        let target = only(&seen);
        let share = target.sigma_m.unwrap() / target.distance_m;
        assert!((share - 0.07).abs() < 1e-4, "{share}");
        let unsaid = perception.detect(&depth, &k, stamp(0.1)).unwrap();
        assert!(unsaid.targets.iter().all(|t| t.sigma_m.is_none()));
    }
}

/// A car that has stood for a second and jumps by three metres is another car with exact depth, but the same car with depth that is
/// accurate to a tenth.
#[test]
fn uncertain_targets_may_be_matched_farther_away() {
    let k = camera();
    let (before, after) = (car(18.0), car(21.2));
    let ids = |share: f32| {
        let mut perception = Perception::new(PerceptionConfig::default());
        let ids = (0..11).map(|frame| {
            let depth = if frame < 10 { &before } else { &after };
            let time = stamp(0.1 * f64::from(frame));
            let deviation = sigma(depth, share);
            let seen = perception.detect_with_sigma(depth, Some(&deviation), &k, time, &[]);
            let targets = seen.unwrap().targets;
            targets.iter().find(|t| t.pixels > 0).unwrap().id
        });
        ids.collect::<Vec<_>>()
    };
    for (share, same) in [(0.1, true), (0.001, false)] {
        let ids = ids(share);
        assert!(ids[..10].iter().all(|id| *id == ids[0]), "{ids:?}");
        assert_eq!(ids[10] == ids[0], same, "{share}: {ids:?}");
    }
}

#[test]
fn a_sigma_of_another_size_is_refused() {
    let (depth, k) = (car(14.0), camera());
    let small = DepthMap::empty(64, 24);
    let error = Perception::new(PerceptionConfig::default())
        .detect_with_sigma(&depth, Some(&small), &k, None, &[])
        .unwrap_err();
    assert!(
        matches!(
            error,
            Error::Size {
                found: (64, 24),
                ..
            }
        ),
        "{error}"
    );
}
