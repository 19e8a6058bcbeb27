//! Reads pose files: one pose per line, as a fixed number of columns.

use crate::{Error, PoseField, PoseProblem, Result};
use deepfusion_geometry::Se3;
use nalgebra::{Matrix3, Vector3};
use std::path::Path;

/// Largest deviation from the identity of the product of a printed rotation and its transpose.
const ORTHONORMAL: f64 = 1e-2;

/// Whether a matrix is a rotation, up to the rounding in files.
pub(crate) fn is_rotation(matrix: &Matrix3<f64>) -> bool {
    (matrix.transpose() * matrix - Matrix3::identity()).norm() <= ORTHONORMAL
        && matrix.determinant() > 0.0
}

/// A rigid transform from the upper three rows of its matrix, row by row, in metres; `None` if its matrix is not a rotation.
pub(crate) fn motion_of_rows(numbers: &[f64]) -> Option<Se3> {
    let at = |row: usize, column: usize| numbers.get(4 * row + column).copied().unwrap_or(f64::NAN);
    let rotation = Matrix3::from_fn(at);
    let place = Vector3::new(at(0, 3), at(1, 3), at(2, 3));
    let is_motion = is_rotation(&rotation) && place.iter().all(|p| p.is_finite());
    is_motion.then(|| Se3::from_parts(&rotation, place))
}

/// The lines of a pose file, each with `columns` finite numbers, and their line numbers, counted from 1. Empty lines are skipped.
///
/// # Errors
/// [`Error::File`]; [`Error::Pose`] with line and column.
pub(crate) fn rows_of_numbers(path: &Path, columns: usize) -> Result<Vec<(usize, Vec<f64>)>> {
    let bytes = std::fs::read(path).map_err(|e| Error::file(path, e))?;
    let text = String::from_utf8_lossy(&bytes);
    let mut rows = Vec::new();
    for (i, line) in text.lines().enumerate() {
        if line.trim().is_empty() {
            continue;
        }
        let bad = |field: PoseField, problem: PoseProblem| Error::Pose {
            path: path.to_owned(),
            line: i + 1,
            field,
            problem,
        };
        let mut numbers = Vec::with_capacity(columns);
        for (column, word) in line.split_whitespace().enumerate() {
            let number = word.parse::<f64>().ok().filter(|n| n.is_finite());
            numbers.push(number.ok_or_else(|| {
                let (number, text) = (column + 1, word.chars().take(40).collect());
                let field = PoseField::Value {
                    number,
                    of: columns,
                };
                bad(field, PoseProblem::NotANumber { text })
            })?);
        }
        if numbers.len() != columns {
            let problem = PoseProblem::Length {
                found: numbers.len(),
                expected: columns,
            };
            return Err(bad(PoseField::Pose, problem));
        }
        rows.push((i + 1, numbers));
    }
    Ok(rows)
}

/// Reads poses with their frame numbers: if `numbered`, the first number of each line, otherwise the line's number, counted from 0. A
/// pose has 12 `columns`, or 16 with the matrix' last row.
///
/// # Errors
/// Those of [`rows_of_numbers`], and [`Error::Pose`] for an invalid frame number or matrix.
pub(crate) fn read_poses(path: &Path, numbered: bool, columns: usize) -> Result<Vec<(u64, Se3)>> {
    let first = usize::from(numbered);
    let rows = rows_of_numbers(path, columns + first)?;
    let pose = |(row, (line, numbers)): (usize, (usize, Vec<f64>))| {
        let bad = |field: PoseField, problem: PoseProblem| Error::Pose {
            path: path.to_owned(),
            line,
            field,
            problem,
        };
        let number = match numbers.first() {
            Some(number) if numbered => {
                let whole = number.fract() == 0.0 && (0.0..1e15).contains(number);
                if !whole {
                    let problem = PoseProblem::NotAFrame { value: *number };
                    return Err(bad(PoseField::Frame, problem));
                }
                *number as u64
            }
            _ => row as u64,
        };
        let pose = motion_of_rows(&numbers[first..]);
        let pose = pose.ok_or_else(|| bad(PoseField::Pose, PoseProblem::NoRotation))?;
        Ok((number, pose))
    };
    rows.into_iter().enumerate().map(pose).collect()
}
