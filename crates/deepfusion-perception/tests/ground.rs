//! Roads that are not level.

use deepfusion_geometry::{DepthMap, Intrinsics};
use deepfusion_perception::{Ground, PerceptionConfig, Rays};

const CAMERA: Intrinsics = Intrinsics {
    fx: 370.0,
    fy: 370.0,
    cx: 320.0,
    cy: 90.0,
    width: 640,
    height: 192,
};

/// Depth of a road with height `height(forward)` relative to the camera's foot, seen from `camera_m` above its start by a camera pitched up
/// by `pitch`, with a wall on the left that must not be taken for ground.
fn road(height: impl Fn(f64) -> f64, camera_m: f64, pitch: f64) -> DepthMap {
    let mut map = DepthMap::empty(640, 192);
    let (sin, cos) = f64::sin_cos(pitch);
    for v in 0..192 {
        for u in 0..640 {
            let (x, y) = (
                (u as f64 - CAMERA.cx) / CAMERA.fx,
                (v as f64 - CAMERA.cy) / CAMERA.fy,
            );
            // The ray in level axes: forward and down per metre of depth.
            let (forward, down) = (cos + sin * y, cos * y - sin);
            let hit = (5..6000).map(|i| f64::from(i) * 0.01).find(|z| {
                let wall = x * z < -6.0;
                wall || down * z > camera_m - height(forward * z)
            });
            map.data[v * 640 + u] = hit.unwrap_or(0.0) as f32;
        }
    }
    map
}

fn find(depth: &DepthMap) -> Ground {
    let config = PerceptionConfig::default();
    Ground::find(&depth.data, &Rays::of(&CAMERA), None, &config).unwrap()
}

/// The estimated height of road points at distances ahead of the camera.
fn heights(ground: &Ground, height: impl Fn(f64) -> f64, camera_m: f64, pitch: f64) -> Vec<f32> {
    let (sin, cos) = f64::sin_cos(pitch);
    [6.0, 12.0, 20.0, 30.0]
        .into_iter()
        .map(|forward: f64| {
            let down = camera_m - height(forward);
            let p = [1.0, cos * down + sin * forward, cos * forward - sin * down];
            ground.locate(p.map(|c| c as f32))[2]
        })
        .collect()
}

#[test]
fn a_level_road_under_a_pitched_camera() {
    for pitch in [-0.1, 0.0, 0.1] {
        let ground = find(&road(|_| 0.0, 1.5, pitch));
        assert!((ground.camera_height_m - 1.5).abs() < 0.02, "{ground:?}");
        let off = heights(&ground, |_| 0.0, 1.5, pitch);
        assert!(off.iter().all(|h| h.abs() < 0.05), "{off:?}");
        assert!(ground.support > 0.9, "{ground:?}");
    }
}

#[test]
fn a_road_that_begins_to_climb_or_to_fall() {
    for slope in [0.06, -0.04] {
        let height = |forward: f64| slope * (forward - 12.0).max(0.0);
        let ground = find(&road(height, 1.65, 0.0));
        let off = heights(&ground, height, 1.65, 0.0);
        // A plane alone would be half a metre off at 30 m.
        assert!(off.iter().all(|h| h.abs() < 0.15), "{slope}: {off:?}");
    }
}

#[test]
fn axes_are_orthonormal_and_points_round_trip() {
    let ground = Ground::plane([0.05, -1.0, 0.08], 1.4);
    let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    for (a, b, expected) in [
        (ground.up, ground.up, 1.0),
        (ground.forward, ground.forward, 1.0),
        (ground.right, ground.right, 1.0),
        (ground.up, ground.forward, 0.0),
        (ground.right, ground.forward, 0.0),
        (ground.up, ground.right, 0.0),
    ] {
        assert!((dot(a, b) - expected).abs() < 1e-6);
    }
    assert!(ground.right[0] > 0.9 && ground.forward[2] > 0.9);
    let place = [2.0, 17.0, 0.7];
    let back = ground.locate(ground.place(place));
    assert!(
        place.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-4),
        "{back:?}"
    );
}
