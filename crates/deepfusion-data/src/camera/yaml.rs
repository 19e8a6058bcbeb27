//! Reads calibration YAML of OpenCV, ROS and Kalibr.

use super::numbers::Numbers;
use crate::CalibrationFileProblem;
use deepfusion_geometry::Distortion;
use serde::Deserialize;
use std::collections::BTreeMap;

/// Longest file that is parsed, in bytes; a calibration has some hundred.
const LONGEST: usize = 1 << 20;

/// Names of the Kannala-Brandt fisheye model: in ROS and Kalibr, and in OpenCV.
pub(crate) const FISHEYE: [&str; 2] = ["equidistant", "fisheye"];

/// Keys of OpenCV's and ROS's files, in the spellings of their tools.
#[derive(Debug, Default, Deserialize)]
struct Flat {
    #[serde(alias = "width", alias = "Image_width")]
    image_width: Option<u32>,
    #[serde(alias = "height", alias = "Image_height")]
    image_height: Option<u32>,
    #[serde(
        alias = "Camera_Matrix",
        alias = "cameraMatrix",
        alias = "K",
        alias = "k"
    )]
    camera_matrix: Option<Matrix>,
    #[serde(
        alias = "Distortion_Coefficients",
        alias = "distCoeffs",
        alias = "dist_coeffs",
        alias = "D",
        alias = "d"
    )]
    distortion_coefficients: Option<Matrix>,
    #[serde(alias = "distortionModel")]
    distortion_model: Option<String>,
    camera_model: Option<String>,
    fisheye_model: Option<u32>,
}

/// A matrix, as a plain list or with rows, columns and data.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
enum Matrix {
    Sized {
        rows: Option<u32>,
        cols: Option<u32>,
        data: Vec<f64>,
    },
    Nested(Vec<Vec<f64>>),
    List(Vec<f64>),
}

/// One camera of Kalibr's camchain.
#[derive(Debug, Deserialize)]
struct Kalibr {
    camera_model: String,
    intrinsics: Vec<f64>,
    distortion_model: String,
    distortion_coeffs: Vec<f64>,
    resolution: Option<[u32; 2]>,
}

/// Reads any of the three formats.
pub(super) fn parse(text: &str) -> Result<Numbers, CalibrationFileProblem> {
    if text.len() > LONGEST {
        return Err(CalibrationFileProblem::TooLong);
    }
    let text = plain(text);
    let bad = |e: serde_saphyr::Error| CalibrationFileProblem::Yaml(Box::new(e));
    if text.lines().any(|l| l.trim_end() == "cam0:") {
        let chain: BTreeMap<String, Kalibr> = serde_saphyr::from_str(&text).map_err(bad)?;
        let first = chain.into_iter().next();
        let (_, camera) = first.ok_or(CalibrationFileProblem::NoCamera)?;
        return kalibr(camera);
    }
    flat(serde_saphyr::from_str(&text).map_err(bad)?)
}

/// The text without what is not standard YAML: OpenCV begins files with `%YAML:1.0`, and tags matrices with its own type.
fn plain(text: &str) -> String {
    let lines = text
        .lines()
        .filter(|l| !l.starts_with("%YAML") && l.trim() != "---");
    let lines = lines.map(|l| l.replace("!!opencv-matrix", ""));
    lines.collect::<Vec<_>>().join("\n")
}

fn flat(file: Flat) -> Result<Numbers, CalibrationFileProblem> {
    let model = file.distortion_model.as_deref().unwrap_or("plumb_bob");
    let fisheye = FISHEYE.contains(&model) || file.fisheye_model == Some(1);
    let known = [
        "plumb_bob",
        "rational_polynomial",
        "radtan",
        "radial-tangential",
        "none",
        "",
    ];
    if !(fisheye || known.contains(&model)) {
        return Err(model_refused(model));
    }
    if let Some(other) = file.camera_model.as_deref().filter(|m| *m != "pinhole") {
        return Err(model_refused(other));
    }
    let matrix = file.camera_matrix.ok_or(CalibrationFileProblem::NoMatrix)?;
    let k = matrix.values("camera_matrix")?;
    let [fx, skew, cx, zero, fy, cy, 0.0, 0.0, 1.0] = k[..] else {
        return Err(CalibrationFileProblem::Matrix);
    };
    if skew != 0.0 || zero != 0.0 {
        return Err(CalibrationFileProblem::Skew);
    }
    let coefficients = match file.distortion_coefficients {
        Some(matrix) => matrix.values("distortion_coefficients")?,
        None => Vec::new(),
    };
    let size = file.image_width.zip(file.image_height);
    // A size of 0 in a message means unknown.
    Ok(numbers(
        [fx, fy, cx, cy],
        lens(&coefficients, fisheye)?,
        size.filter(|s| s.0 > 0 && s.1 > 0),
    ))
}

fn kalibr(camera: Kalibr) -> Result<Numbers, CalibrationFileProblem> {
    if camera.camera_model != "pinhole" {
        return Err(model_refused(&camera.camera_model));
    }
    let model = camera.distortion_model.as_str();
    let fisheye = FISHEYE.contains(&model);
    if !(fisheye || ["radtan", "none"].contains(&model)) {
        return Err(model_refused(model));
    }
    let [fx, fy, cx, cy] = camera.intrinsics[..] else {
        let found = camera.intrinsics.len();
        return Err(CalibrationFileProblem::Intrinsics { found });
    };
    let size = camera.resolution.map(|[w, h]| (w, h));
    let lens = lens(&camera.distortion_coeffs, fisheye)?;
    Ok(numbers([fx, fy, cx, cy], lens, size))
}

fn lens(coefficients: &[f64], fisheye: bool) -> Result<Distortion, CalibrationFileProblem> {
    Ok(if fisheye {
        Distortion::from_fisheye(coefficients)?
    } else {
        Distortion::from_opencv(coefficients)?
    })
}

fn numbers(pinhole: [f64; 4], distortion: Distortion, size: Option<(u32, u32)>) -> Numbers {
    Numbers {
        pinhole,
        distortion,
        size,
    }
}

fn model_refused(model: &str) -> CalibrationFileProblem {
    let name = model.chars().take(40).collect();
    CalibrationFileProblem::Model { name }
}

impl Matrix {
    fn values(self, field: &'static str) -> Result<Vec<f64>, CalibrationFileProblem> {
        match self {
            Self::List(data) => Ok(data),
            Self::Nested(rows) => Ok(rows.concat()),
            Self::Sized { rows, cols, data } => {
                let expected = rows.zip(cols).map(|(r, c)| u64::from(r) * u64::from(c));
                match expected {
                    Some(expected) if expected != data.len() as u64 => {
                        Err(CalibrationFileProblem::MatrixSize {
                            field,
                            found: data.len(),
                            expected,
                        })
                    }
                    _ => Ok(data),
                }
            }
        }
    }
}

#[cfg(test)]
#[path = "yaml_tests.rs"]
mod tests;
