//! Invalid depth images.

use deepfusion_geometry::{DepthMap, Intrinsics, Se3};
use deepfusion_hint::Hint;
use deepfusion_perception::{Error, Perception, PerceptionConfig, Stamp};
use proptest::prelude::*;

fn camera(width: u32, height: u32) -> Intrinsics {
    Intrinsics {
        fx: f64::from(width) * 0.58,
        fy: f64::from(width) * 0.58,
        cx: f64::from(width) / 2.0,
        cy: f64::from(height) / 2.0,
        width,
        height,
    }
}

/// A road 1.6 m below the camera, and a wall 12 m away that is `wall` metres high.
fn road(k: &Intrinsics, wall: f64) -> DepthMap {
    let mut map = DepthMap::empty(k.width as usize, k.height as usize);
    for v in 0..map.height {
        let y = (v as f64 - k.cy) / k.fy;
        let ground = if y > 0.0 { 1.6 / y } else { f64::INFINITY };
        let stands = (1.6 - wall..1.6).contains(&(12.0 * y));
        let z = if stands { ground.min(12.0) } else { ground };
        if z < 70.0 {
            let width = map.width;
            map.data[v * width..(v + 1) * width].fill(z as f32);
        }
    }
    map
}

fn both(depth: &DepthMap, k: &Intrinsics) {
    let with_rows = PerceptionConfig {
        parking_rows: true,
        ..PerceptionConfig::predicted()
    };
    for config in [PerceptionConfig::default(), with_rows] {
        let mut perception = Perception::new(config);
        perception.detect(depth, k, None).unwrap();
        for time in 0..3 {
            let stamp = Stamp {
                time_s: f64::from(time) * 0.1,
                world_from_cam: Se3::identity(),
            };
            let seen = perception.detect(depth, k, Some(stamp)).unwrap();
            for target in &seen.targets {
                assert!(target.center_m.iter().all(|x| x.is_finite()), "{target:?}");
                assert!(target.size_m.iter().all(|x| *x > 0.0), "{target:?}");
                assert!((0.0..=1.0).contains(&target.confidence), "{target:?}");
            }
        }
    }
}

#[test]
fn nothing_sky_one_point_and_nan_give_no_targets() {
    let k = camera(64, 24);
    let empty = DepthMap::empty(64, 24);
    let mut one = empty.clone();
    one.data[20 * 64 + 30] = 7.0;
    let mut nan = empty.clone();
    nan.data.fill(f32::NAN);
    let mut infinite = empty.clone();
    infinite.data.fill(f32::INFINITY);
    let mut flat = empty.clone();
    flat.data.fill(5.0);
    for depth in [&empty, &one, &nan, &infinite, &flat] {
        both(depth, &k);
        let seen = Perception::new(PerceptionConfig::default()).detect(depth, &k, None);
        assert_eq!(seen.unwrap().targets, []);
    }
}

#[test]
fn a_million_pixels_and_a_single_one_are_processed() {
    let large = camera(1600, 640);
    both(&road(&large, 1.5), &large);
    let tiny = camera(1, 1);
    both(&DepthMap::empty(1, 1), &tiny);
}

#[test]
fn a_wall_across_the_road_is_no_target_and_the_road_is_found() {
    let k = camera(640, 192);
    let mut perception = Perception::new(PerceptionConfig::default());
    let seen = perception.detect(&road(&k, 2.2), &k, None).unwrap();
    let ground = seen.ground.unwrap();
    assert!((ground.camera_height_m - 1.6).abs() < 0.01, "{ground:?}");
    assert_eq!(seen.targets, []);
}

#[test]
fn wrong_sizes_and_cameras_are_errors_with_hints() {
    let mut perception = Perception::new(PerceptionConfig::default());
    let depth = DepthMap::empty(64, 24);
    let error = perception
        .detect(&depth, &camera(32, 24), None)
        .unwrap_err();
    assert!(matches!(error, Error::Size { .. }), "{error}");
    assert!(
        error.to_string().contains("64x24") && error.hint().is_some(),
        "{error}"
    );
    let mut short = depth.clone();
    short.data.pop();
    assert!(perception.detect(&short, &camera(64, 24), None).is_err());
    let wrong = Intrinsics {
        fx: f64::NAN,
        ..camera(64, 24)
    };
    let error = perception.detect(&depth, &wrong, None).unwrap_err();
    assert!(matches!(error, Error::Camera(_)), "{error}");
}

#[test]
fn a_clock_jump_restarts_tracking_without_reusing_ids() {
    let k = camera(640, 192);
    let mut depth = road(&k, 0.0);
    for v in 99..126 {
        for u in 300..358 {
            let cell = &mut depth.data[v * 640 + u];
            if *cell == 0.0 || *cell > 12.0 {
                *cell = 12.0;
            }
        }
    }
    let mut perception = Perception::new(PerceptionConfig::default());
    let mut ids = Vec::new();
    for time_s in [0.0, 0.1, 60.0, 10.0, 10.1] {
        let world_from_cam = Se3::identity();
        let stamp = Stamp {
            time_s,
            world_from_cam,
        };
        let seen = perception.detect(&depth, &k, Some(stamp)).unwrap();
        assert_eq!(seen.targets.len(), 1, "{:?}", seen.targets);
        ids.push(seen.targets[0].id);
    }
    assert_eq!(ids[0], ids[1]);
    assert_eq!(ids[3], ids[4]);
    assert!(ids[1] < ids[2] && ids[2] < ids[3], "{ids:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// Whatever the pixels contain, nothing panics and every target has a valid box.
    #[test]
    fn any_depth_gives_valid_boxes_or_none(
        width in 2u32..70, height in 2u32..40,
        seed in proptest::collection::vec(prop_oneof![
            Just(0.0f32), Just(f32::NAN), Just(-3.0), Just(1e30), 0.1f32..90.0, 5.0f32..8.0
        ], 200),
        on_road in any::<bool>(),
    ) {
        let k = camera(width, height);
        let mut depth = road(&k, 1.0);
        for (i, z) in depth.data.iter_mut().enumerate() {
            if !on_road || i % 3 == 0 {
                *z = seed[i * 7 % seed.len()];
            }
        }
        both(&depth, &k);
    }
}
