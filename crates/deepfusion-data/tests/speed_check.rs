//! Comparison of speeds with images: a rendered road with a known camera height, and real drives.

use crate::common;
use deepfusion_data::{Dataset, OpenOptions, SpeedWarning, speed_unit_warning};
use deepfusion_geometry::{Intrinsics, Se3};
use deepfusion_motion::{GreyImage, GroundPair, RoadTexture, implied_camera_height};
use nalgebra::Vector3;
use std::sync::Arc;

const HEIGHT_M: f64 = 1.65;

fn camera() -> Intrinsics {
    Intrinsics {
        fx: 140.0,
        fy: 140.0,
        cx: 119.5,
        cy: 33.0,
        width: 240,
        height: 73,
    }
}

/// Smooth noise on the plane, in [0, 1]: a value for each lattice point, blended between them.
fn noise(x: f64, z: f64) -> f64 {
    let lattice = |i: f64, j: f64| {
        let mut h = (i as i64 as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15)
            ^ (j as i64 as u64).wrapping_mul(0xC2B2_AE3D_27D4_EB4F);
        h = (h ^ (h >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        ((h ^ (h >> 32)) & 0xFFFF) as f64 / 65_535.0
    };
    let (i, j) = (x.floor(), z.floor());
    let (u, v) = (x - i, z - j);
    let row = |j: f64| lattice(i, j) * (1.0 - u) + lattice(i + 1.0, j) * u;
    row(j) * (1.0 - v) + row(j + 1.0) * v
}

/// The road in a level camera that has driven `travelled_m`; its texture has a grain of 0.15 and 0.6 m.
fn render(travelled_m: f64) -> GreyImage {
    let k = camera();
    let (width, height) = (k.width as usize, k.height as usize);
    let mut data = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let ray = k.back_project(x as f64, y as f64, 1.0);
            let value = if ray.y > 0.02 {
                let z = HEIGHT_M / ray.y;
                let (px, pz) = (ray.x * z, z + travelled_m);
                60.0 * noise(px / 0.6, pz / 0.6) + 40.0 * noise(px / 0.15, pz / 0.15)
            } else {
                200.0
            };
            data.push(value as f32);
        }
    }
    GreyImage {
        width,
        height,
        data,
    }
}

/// Pairs that are 0.5 m apart, with speeds for `factor` times that distance.
fn pairs(factor: f64) -> Vec<GroundPair> {
    let texture = |i: usize| Arc::new(RoadTexture::from(&render(0.5 * i as f64)));
    let pair = |i: usize| GroundPair {
        earlier: texture(i),
        later: texture(i + 1),
        intrinsics: camera(),
        seconds: 0.1,
        earlier_from_later: Se3::from_axis_angle(
            Vector3::zeros(),
            Vector3::new(0.0, 0.0, 0.5 * factor),
        ),
        down_in_cam: Vector3::y(),
    };
    (0..6).map(pair).collect()
}

#[test]
fn true_speeds_give_the_cameras_true_height() {
    let height = implied_camera_height(&pairs(1.0)).unwrap();
    assert!((height / HEIGHT_M - 1.0).abs() < 0.07, "{height}");
    assert_eq!(SpeedWarning::of_height(height, 6), None);
}

#[test]
fn a_wrong_unit_scales_the_height_and_is_named() {
    for (factor, unit) in [(3.6, "km/h"), (2.237, "mph")] {
        let height = implied_camera_height(&pairs(factor)).unwrap();
        assert!(
            (height / (HEIGHT_M * factor) - 1.0).abs() < 0.07,
            "{height}"
        );
        let warning = SpeedWarning::of_height(height, 6).unwrap();
        assert_eq!(warning.likely_unit(), Some(unit));
        let text = warning.to_string();
        assert!(text.contains(unit) && text.contains("too large"), "{text}");
    }
    let height = implied_camera_height(&pairs(1.0 / 3.6)).unwrap();
    let text = SpeedWarning::of_height(height, 6).unwrap().to_string();
    assert!(text.contains("too small"), "{text}");
}

#[test]
fn images_without_information_give_no_height() {
    let mut flat = pairs(1.0);
    for pair in &mut flat {
        let mut flat = render(0.0);
        flat.data.fill(90.0);
        let flat = Arc::new(RoadTexture::from(&flat));
        pair.earlier = flat.clone();
        pair.later = flat;
    }
    assert_eq!(implied_camera_height(&flat), None, "no texture");
    let mut unrelated = pairs(1.0);
    for (i, pair) in unrelated.iter_mut().enumerate() {
        pair.earlier = Arc::new(RoadTexture::from(&render(1000.0 * (i + 1) as f64)));
    }
    assert_eq!(implied_camera_height(&unrelated), None, "two places");
    let mut up = pairs(1.0);
    up.iter_mut().for_each(|p| p.down_in_cam = -Vector3::y());
    assert_eq!(
        implied_camera_height(&up),
        None,
        "a camera without a view of the road"
    );
    assert_eq!(implied_camera_height(&[]), None);
}

/// A still image, although the vehicle moves according to the speeds.
#[test]
fn a_frozen_image_gives_a_warning() {
    let mut frozen = pairs(1.0);
    frozen.iter_mut().for_each(|p| p.later = p.earlier.clone());
    let height = implied_camera_height(&frozen).unwrap();
    let text = SpeedWarning::of_height(height, 6).unwrap().to_string();
    assert!(text.contains("hardly moves"), "{text}");
}

/// Real drives give no warning, but do when their OXTS speeds are rewritten as km/h.
#[test]
fn only_real_drives_in_kmh_give_a_warning() {
    for drive in ["2011_09_26_drive_0005_sync", "2011_09_26_drive_0009_sync"] {
        let Some(folder) = common::real_data(&format!("kitti_raw/2011_09_26/{drive}")) else {
            return;
        };
        let true_speeds = Dataset::open(&folder, &OpenOptions::default()).unwrap();
        assert_eq!(
            speed_unit_warning(&true_speeds[0]).unwrap(),
            None,
            "{drive}"
        );

        let copy = tempfile::tempdir().unwrap();
        let in_kmh = common::copy_with_speeds(&folder, copy.path(), 3.6);
        let wrong = Dataset::open(&in_kmh, &OpenOptions::default()).unwrap();
        let warning = speed_unit_warning(&wrong[0]).unwrap().expect(drive);
        assert_eq!(warning.likely_unit(), Some("km/h"), "{warning}");
    }
}
