use super::*;
use proptest::prelude::*;

/// As written by `cv2.FileStorage` of OpenCV 4.
const OPENCV: &str = "%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 5.3591573396163199e+02, 0., 3.4228315473308373e+02, 0.,
       5.3591573396163199e+02, 2.3557082909788173e+02, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -2.6637260909660682e-01, -3.8588898922304653e-02,
       1.7831947042852964e-03, -2.8122100441115472e-04,
       2.3839153080878486e-01 ]
avg_reprojection_error: 3.9259109564815858e-01
";

const FISHEYE_OPENCV: &str = "%YAML:1.0
---
fisheye_model: 1
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 350., 0., 3.205e+02, 0., 351., 2.405e+02, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 4
   cols: 1
   dt: d
   data: [ 1.0e-02, -2.0e-02, 3.0e-02, -4.0e-03 ]
";

/// As written by ROS's camera_calibration.
const ROS: &str = "image_width: 2448
image_height: 2050
camera_name: prosilica
camera_matrix:
  rows: 3
  cols: 3
  data: [4827.94, 0, 1223.5, 0, 4835.62, 1024.5, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.41527, 0.31874, -0.00197, 0.00071, 0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
";

/// As written by Kalibr.
const KALIBR: &str = "cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.2834, 0.0739, 0.00019, 1.76e-05]
  distortion_model: radtan
  intrinsics: [458.654, 457.296, 367.215, 248.375]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
  T_cam_imu:
  - [0.01, -0.99, 0.0, 0.02]
  - [0.99, 0.01, -0.02, -0.06]
  - [0.02, 0.0, 0.99, -0.01]
  - [0.0, 0.0, 0.0, 1.0]
cam1:
  camera_model: pinhole
  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]
  distortion_model: radtan
  intrinsics: [1.0, 1.0, 1.0, 1.0]
  resolution: [752, 480]
  rostopic: /cam1/image_raw
";

#[test]
fn opencv_is_read() {
    let numbers = parse(OPENCV).unwrap();
    assert_eq!(numbers.pinhole[2], 342.28315473308373);
    assert_eq!(numbers.size, Some((640, 480)));
    assert_eq!(numbers.distortion.radial[2], 0.23839153080878486);
    assert_eq!(numbers.distortion.tangential[0], 0.0017831947042852964);
}

#[test]
fn ros_is_read() {
    let numbers = parse(ROS).unwrap();
    assert_eq!(numbers.pinhole, [4827.94, 4835.62, 1223.5, 1024.5]);
    assert_eq!(numbers.distortion.tangential, [-0.00197, 0.00071]);
    // A printed message.
    let message = "header: {seq: 1}\nheight: 480\nwidth: 640\ndistortion_model: \"plumb_bob\"\n\
        D: [0.1, 0.2, 0.3, 0.4, 0.5]\nK: [500.0, 0.0, 320.0, 0.0, 501.0, 240.0, 0.0, 0.0, 1.0]\nbinning_x: 0\n---\n";
    let numbers = parse(message).unwrap();
    assert_eq!(
        (numbers.pinhole[1], numbers.size),
        (501.0, Some((640, 480)))
    );
}

#[test]
fn kalibrs_first_camera_is_read() {
    let numbers = parse(KALIBR).unwrap();
    assert_eq!(numbers.pinhole, [458.654, 457.296, 367.215, 248.375]);
    assert_eq!(numbers.distortion.radial, [-0.2834, 0.0739, 0.0]);
    assert_eq!(numbers.size, Some((752, 480)));
}

#[test]
fn fisheye_lenses_are_read() {
    let kalibr = parse(&KALIBR.replacen("radtan", "equidistant", 1)).unwrap();
    assert_eq!(
        kalibr.distortion.fisheye,
        Some([-0.2834, 0.0739, 0.00019, 1.76e-05])
    );
    assert_eq!(kalibr.distortion.radial, [0.0; 3]);
    // As written by OpenCV's sample program for calibration of fisheye lenses.
    let opencv = parse(FISHEYE_OPENCV).unwrap();
    assert_eq!(opencv.distortion.fisheye, Some([0.01, -0.02, 0.03, -0.004]));
    assert_eq!(opencv.pinhole, [350.0, 351.0, 320.5, 240.5]);
    let ros = ROS.replace("plumb_bob", "equidistant");
    let ros = ros
        .replace("cols: 5", "cols: 4")
        .replace(", 0.00071, 0]", ", 0.00071]");
    let ros = parse(&ros).unwrap();
    assert_eq!(
        ros.distortion.fisheye,
        Some([-0.41527, 0.31874, -0.00197, 0.00071])
    );
    // Five coefficients belong to another lens model.
    let refusal = parse(&ROS.replace("plumb_bob", "fisheye")).unwrap_err();
    assert!(refusal.to_string().contains("5 coefficients"), "{refusal}");
}

#[test]
fn errors_name_unsupported_lens_models() {
    for (text, model) in [
        (KALIBR.replacen("radtan", "fov", 1), "fov"),
        (KALIBR.replacen("pinhole", "omni", 1), "omni"),
        (ROS.replace("plumb_bob", "division"), "division"),
    ] {
        let refusal = parse(&text).unwrap_err();
        assert_eq!(
            refusal.to_string(),
            format!("the lens model '{model}' is not supported")
        );
        assert!(refusal.hint().contains("radtan"));
    }
}

#[test]
fn errors_name_the_field() {
    for (text, problem) in [
        (
            OPENCV.replace("camera_matrix", "matrix"),
            "no camera_matrix",
        ),
        (
            OPENCV.replace("rows: 5", "rows: 4"),
            "its rows and cols make 4",
        ),
        (ROS.replace("4827.94, 0,", "4827.94, 2,"), "skew"),
        (ROS.replace("[4827.94, 0, ", "["), "rows and cols make 9"),
        (KALIBR.replacen("458.654, ", "", 1), "3 numbers"),
        ("[1, 2".to_owned(), "not the YAML"),
    ] {
        let found = parse(&text).unwrap_err().to_string();
        assert!(found.contains(problem), "{found}");
    }
}

proptest! {
    #[test]
    fn garbage_never_panics(text in ".{0,120}") {
        let _ = parse(&text);
    }

    #[test]
    fn half_a_file_never_panics(end in 0usize..1000) {
        for whole in [OPENCV, ROS, KALIBR] {
            let cut: String = whole.chars().take(end).collect();
            let _ = parse(&cut);
        }
    }
}
