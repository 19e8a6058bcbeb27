//! A camera as a calibration file for other programs.

use deepfusion_geometry::{Distortion, Intrinsics};
use std::fmt::Write as _;

/// A camera as ROS `camera_info` YAML, which [`crate::CameraCalibration::read`], ROS and most tools read. The model is `equidistant` for a
/// fisheye lens, `rational_polynomial` if eight coefficients are needed, otherwise `plumb_bob`. Each of `comments` becomes a line at the
/// top.
#[must_use]
pub fn camera_info_yaml(
    name: &str,
    camera: &Intrinsics,
    lens: &Distortion,
    comments: &[String],
) -> String {
    let [k1, k2, k3] = lens.radial;
    let [p1, p2] = lens.tangential;
    let [k4, k5, k6] = lens.rational;
    let (model, coefficients) = match lens.fisheye {
        Some(k) => ("equidistant", k.to_vec()),
        None if lens.rational == [0.0; 3] => ("plumb_bob", vec![k1, k2, p1, p2, k3]),
        None => ("rational_polynomial", vec![k1, k2, p1, p2, k3, k4, k5, k6]),
    };
    let mut text = String::new();
    for line in comments.iter().flat_map(|r| r.lines()) {
        let _ = writeln!(text, "# {line}");
    }
    let (fx, fy, cx, cy) = (camera.fx, camera.fy, camera.cx, camera.cy);
    // Make the name safe inside quotes, whatever characters it has.
    let name: String = name
        .chars()
        .map(|c| if c.is_alphanumeric() { c } else { '_' })
        .collect();
    let _ = write!(
        text,
        "image_width: {}\nimage_height: {}\ncamera_name: \"{name}\"\ndistortion_model: {model}\n",
        camera.width, camera.height
    );
    let mut matrix = |field: &str, rows: usize, data: &[f64]| {
        let cols = data.len() / rows;
        let data: Vec<String> = data.iter().map(f64::to_string).collect();
        let data = data.join(", ");
        let _ = write!(
            text,
            "{field}:\n  rows: {rows}\n  cols: {cols}\n  data: [{data}]\n"
        );
    };
    matrix(
        "camera_matrix",
        3,
        &[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
    );
    matrix("distortion_coefficients", 1, &coefficients);
    let one = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    matrix("rectification_matrix", 3, &one);
    matrix(
        "projection_matrix",
        3,
        &[fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    );
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CameraCalibration;
    use proptest::prelude::*;

    proptest! {
        /// The file is read back with all digits.
        #[test]
        fn a_written_calibration_is_read_back(
            pinhole in proptest::array::uniform4(50.0..500.0f64), k in proptest::collection::vec(-0.5..0.5f64, 8), kind in 0..4usize,
        ) {
            let camera = Intrinsics::from_numbers(pinhole, (640, 480));
            let lens = match kind {
                0 => Distortion::from_fisheye(&k[..4]).unwrap(),
                1 => Distortion::from_opencv(&k[..5]).unwrap(),
                2 => Distortion::from_opencv(&k).unwrap(),
                _ => Distortion::default(),
            };
            prop_assume!(camera.implausible().is_none());
            let folder = tempfile::tempdir().unwrap();
            let file = folder.path().join("camera.yaml");
            let comments = ["two\nlines: [".to_owned(), "and: another".to_owned()];
            std::fs::write(&file, camera_info_yaml("my: \"camera\"", &camera, &lens, &comments)).unwrap();
            let read = CameraCalibration::read(&file, (1, 1)).unwrap();
            prop_assert_eq!(read.intrinsics, camera);
            prop_assert_eq!(read.distortion, lens);
            prop_assert!(read.size_in_file);
        }
    }
}
