//! Files of poses: a line each, of a number of columns of numbers.

use crate::{Error, Result};
use deepfusion_geometry::Se3;
use nalgebra::{Matrix3, Vector3};
use std::path::Path;

/// How far the product of a printed rotation and its transpose may be from the identity.
const ORTHONORMAL: f64 = 1e-2;

/// Whether a matrix is a rotation, up to the digits that files have.
pub(crate) fn is_rotation(matrix: &Matrix3<f64>) -> bool {
    (matrix.transpose() * matrix - Matrix3::identity()).norm() <= ORTHONORMAL
        && matrix.determinant() > 0.0
}

/// A motion from the upper three rows of its matrix, row by row, in metres.
///
/// # Errors
/// That it is none, in words.
pub(crate) fn motion_of_rows(numbers: &[f64]) -> std::result::Result<Se3, String> {
    let at = |row: usize, column: usize| numbers.get(4 * row + column).copied().unwrap_or(f64::NAN);
    let rotation = Matrix3::from_fn(at);
    let place = Vector3::new(at(0, 3), at(1, 3), at(2, 3));
    if !is_rotation(&rotation) || !place.iter().all(|p| p.is_finite()) {
        return Err("its rotation is none".into());
    }
    Ok(Se3::from_parts(&rotation, place))
}

/// The lines of a file of poses, each of `columns` finite numbers; with the line's number, counted from 1. Empty lines are skipped.
///
/// # Errors
/// [`Error::NoSuchPath`], [`Error::File`]; [`Error::Pose`] with line and column.
pub(crate) fn rows_of_numbers(path: &Path, columns: usize) -> Result<Vec<(usize, Vec<f64>)>> {
    let bytes = std::fs::read(path).map_err(|e| Error::file(path, e))?;
    let text = String::from_utf8_lossy(&bytes);
    let mut rows = Vec::new();
    for (i, line) in text.lines().enumerate() {
        if line.trim().is_empty() {
            continue;
        }
        let bad = |field: String, problem: String| Error::Pose {
            path: path.to_owned(),
            line: i + 1,
            field,
            problem,
        };
        let mut numbers = Vec::with_capacity(columns);
        for (column, word) in line.split_whitespace().enumerate() {
            let number = word.parse::<f64>().ok().filter(|n| n.is_finite());
            let shown: String = word.chars().take(40).collect();
            numbers.push(number.ok_or_else(|| {
                bad(
                    format!("value {} of {columns}", column + 1),
                    format!("'{shown}' is not a finite number"),
                )
            })?);
        }
        if numbers.len() != columns {
            let problem = format!("{} numbers, expected {columns}", numbers.len());
            return Err(bad("pose".into(), problem));
        }
        rows.push((i + 1, numbers));
    }
    Ok(rows)
}

/// Poses with a frame's number before each, if `numbered`; else the number is the line's, counted from 0. `columns` of a
/// pose: 12, or 16 with the matrix' last row.
///
/// # Errors
/// As [`rows_of_numbers`], and [`Error::Pose`] for what is no frame's number or no motion.
pub(crate) fn read_poses(path: &Path, numbered: bool, columns: usize) -> Result<Vec<(u64, Se3)>> {
    let first = usize::from(numbered);
    let rows = rows_of_numbers(path, columns + first)?;
    let pose = |(row, (line, numbers)): (usize, (usize, Vec<f64>))| {
        let bad = |field: &str, problem: String| Error::Pose {
            path: path.to_owned(),
            line,
            field: field.to_owned(),
            problem,
        };
        let number = match numbers.first() {
            Some(number) if numbered => {
                let whole = number.fract() == 0.0 && (0.0..1e15).contains(number);
                if !whole {
                    return Err(bad("value 1", format!("{number} is not a frame's number")));
                }
                *number as u64
            }
            _ => row as u64,
        };
        let pose = motion_of_rows(&numbers[first..]).map_err(|problem| bad("pose", problem))?;
        Ok((number, pose))
    };
    rows.into_iter().enumerate().map(pose).collect()
}
