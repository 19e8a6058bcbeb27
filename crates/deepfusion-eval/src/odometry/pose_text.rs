//! Parses and writes the lines of pose files.

use super::{PoseFormat, PoseLineProblem};
use deepfusion_geometry::{Se3, kitti_line};
use nalgebra::{Matrix3, Vector3};
use std::fmt::Write as _;

/// Largest accepted distance of R·Rᵀ from the identity (Frobenius norm), and of a quaternion's length from 1. Files have six digits or
/// single precision; the usual mistake, a scaled matrix, is off by much more.
const ROTATION_TOLERANCE: f64 = 1e-2;

/// The content of a line.
pub(super) struct Line {
    pub(super) format: PoseFormat,
    pub(super) pose: Se3,
    pub(super) time_s: Option<f64>,
}

/// Reads a line in the format of the lines before it. The first line's format follows from its number of columns.
pub(super) fn parse_line(line: &str, before: Option<PoseFormat>) -> Result<Line, PoseLineProblem> {
    let values = line
        .split([' ', '\t', ','])
        .filter(|word| !word.is_empty())
        .map(number)
        .collect::<Result<Vec<f64>, PoseLineProblem>>()?;
    let format = match (values.len(), before) {
        (12, None | Some(PoseFormat::Kitti)) => PoseFormat::Kitti,
        (8, None | Some(PoseFormat::Tum)) => PoseFormat::Tum,
        (found, None) => return Err(PoseLineProblem::Columns { found }),
        (found, Some(PoseFormat::Kitti)) => {
            return Err(PoseLineProblem::OtherColumns { found, before: 12 });
        }
        (found, Some(PoseFormat::Tum)) => {
            return Err(PoseLineProblem::OtherColumns { found, before: 8 });
        }
    };
    match format {
        PoseFormat::Kitti => Ok(Line {
            format,
            pose: from_rows(&values)?,
            time_s: None,
        }),
        PoseFormat::Tum => Ok(Line {
            format,
            pose: from_quaternion(&values[1..])?,
            time_s: Some(values[0]),
        }),
    }
}

fn number(word: &str) -> Result<f64, PoseLineProblem> {
    let value: f64 = word.parse().map_err(|_| PoseLineProblem::NotANumber {
        text: word.chars().take(40).collect(),
    })?;
    if value.is_finite() {
        Ok(value)
    } else {
        Err(PoseLineProblem::NotFinite { value })
    }
}

fn from_rows(v: &[f64]) -> Result<Se3, PoseLineProblem> {
    let rotation = Matrix3::new(v[0], v[1], v[2], v[4], v[5], v[6], v[8], v[9], v[10]);
    let off = (rotation * rotation.transpose() - Matrix3::identity()).norm();
    let determinant = rotation.determinant();
    if off > ROTATION_TOLERANCE || determinant < 0.0 {
        return Err(PoseLineProblem::Rotation { off, determinant });
    }
    Ok(Se3::from_parts(&rotation, Vector3::new(v[3], v[7], v[11])))
}

fn from_quaternion(v: &[f64]) -> Result<Se3, PoseLineProblem> {
    let length = v[3..7].iter().map(|q| q * q).sum::<f64>().sqrt();
    if (length - 1.0).abs() > ROTATION_TOLERANCE {
        return Err(PoseLineProblem::Quaternion { length });
    }
    Ok(Se3::from_quaternion(
        [v[6], v[3], v[4], v[5]],
        Vector3::new(v[0], v[1], v[2]),
    ))
}

/// Poses in KITTI's format: the upper three rows of `world_from_cam`, 12 numbers per line.
#[must_use]
pub fn kitti_text(poses: &[Se3]) -> String {
    let mut text = String::new();
    for pose in poses {
        text += &kitti_line(pose);
        text.push('\n');
    }
    text
}

/// Poses in TUM's format, with a comment that names the columns. If the slices differ in length, the longer one is cut.
#[must_use]
pub fn tum_text(poses: &[Se3], times_s: &[f64]) -> String {
    let mut text = String::from("# time_s tx ty tz qx qy qz qw\n");
    for (pose, time_s) in poses.iter().zip(times_s) {
        let (t, [w, x, y, z]) = (pose.translation(), quaternion(pose));
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "{time_s} {:.9} {:.9} {:.9} {x:.12} {y:.12} {z:.12} {w:.12}",
            t.x, t.y, t.z
        );
    }
    text
}

/// w, x, y, z of the rotation; of the two equivalent quaternions, the one with w ≥ 0.
fn quaternion(pose: &Se3) -> [f64; 4] {
    let wxyz = pose.quaternion();
    if wxyz[0] < 0.0 {
        wxyz.map(|q| -q)
    } else {
        wxyz
    }
}
