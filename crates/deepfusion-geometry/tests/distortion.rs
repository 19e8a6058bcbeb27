//! Compares the lens model with OpenCV's, by `reference/distortion_opencv.py`.

use deepfusion_geometry::Distortion;
use nalgebra::Vector2;

/// OpenCV computes in double precision, too: points differ by the order of operations, 1e-15, and undistorted ones by where either
/// iteration stops, 1e-10.
#[test]
fn distorted_points_equal_opencvs() {
    let text = include_str!("reference/distortion_opencv.txt");
    let (mut lens, mut points) = (Distortion::default(), 0);
    for line in text.lines() {
        if let Some(rest) = line.strip_prefix("lens ") {
            let words = rest.split_whitespace().skip(1);
            let coefficients: Vec<f64> = words.map(|w| w.parse().unwrap()).collect();
            lens = Distortion::from_opencv(&coefficients).unwrap();
            continue;
        }
        let v: Vec<f64> = line
            .split_whitespace()
            .map(|w| w.parse().unwrap())
            .collect();
        let (ideal, seen) = (Vector2::new(v[0], v[1]), Vector2::new(v[2], v[3]));
        assert!((lens.distort(&ideal) - seen).norm() < 1e-13, "{line}");
        let back = lens.undistort(&seen).expect("OpenCV finds it too");
        assert!((back - ideal).norm() < 1e-9, "{line}");
        points += 1;
    }
    assert!(points > 60, "{points}");
}

/// `cv2.fisheye.distortPoints` computes in double precision, too: 1e-13. `undistortPoints` is left out: it stops at 1e-8.
#[test]
fn fisheye_points_equal_opencvs() {
    let text = include_str!("reference/fisheye_opencv.txt");
    let (mut lens, mut points) = (Distortion::default(), 0);
    for line in text.lines() {
        let numbers = |skip| -> Vec<f64> {
            let words = line.split_whitespace().skip(skip);
            words.map(|w| w.parse().unwrap()).collect()
        };
        if line.starts_with("lens ") {
            lens = Distortion::from_fisheye(&numbers(2)).unwrap();
            continue;
        }
        let v = numbers(0);
        let (ideal, seen) = (Vector2::new(v[0], v[1]), Vector2::new(v[2], v[3]));
        assert!((lens.distort(&ideal) - seen).norm() < 1e-13, "{line}");
        // And back, where tan magnifies the rounding error of a point far from the axis.
        let back = lens.undistort(&seen).expect("a ray in front of the camera");
        assert!(
            (back - ideal).norm() < 1e-12 * (1.0 + ideal.norm_squared()),
            "{line}"
        );
        points += 1;
    }
    assert!(points == 60, "{points}");
}
