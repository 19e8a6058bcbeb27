//! The satellite-fused poses of a segment, from earth-centred to local axes.

use super::npy::Table;
use crate::error::{ArrayProblem, Error, Result, TimesArray};
use deepfusion_geometry::{Se3, StampedPose, Trajectory};
use nalgebra::{Matrix3, Vector3};
use std::path::Path;

/// e² of the WGS 84 ellipsoid, the square of its eccentricity.
const ECCENTRICITY_SQUARED: f64 = 6.694_379_990_14e-3;

/// Reads `frame_times`, `frame_positions` and `frame_orientations`; empty if the folder is absent.
pub(super) fn read(folder: &Path) -> Result<(Trajectory, Vec<f64>)> {
    if !folder.exists() {
        return Ok((Trajectory::default(), Vec::new()));
    }
    let times = Table::read(&folder.join("frame_times"), 1)?.values;
    let positions = rows::<3>(folder, "frame_positions", times.len())?;
    let orientations = rows::<4>(folder, "frame_orientations", times.len())?;
    let Some(first) = positions.first().copied().map(Vector3::from) else {
        return Ok((Trajectory::default(), times));
    };
    let enu_from_ecef = enu_from_ecef(&first);
    // Device: x forward, y right, z down. Vehicle: x forward, y left, z up.
    let device_from_vehicle =
        Se3::from_axis_angle(Vector3::x() * std::f64::consts::PI, Vector3::zeros());
    let poses = times.iter().zip(positions.iter().zip(&orientations));
    let poses = poses
        .filter(|(_, (p, q))| p.iter().chain(q.iter()).all(|v| v.is_finite()))
        .map(|(time_s, (position, wxyz))| {
            let place = enu_from_ecef * (Vector3::from(*position) - first);
            let ecef_from_device = Se3::from_quaternion(*wxyz, Vector3::zeros());
            let rotation = enu_from_ecef * ecef_from_device.rotation();
            StampedPose {
                time_s: *time_s,
                world_from_body: Se3::from_parts(&rotation, place) * device_from_vehicle,
            }
        });
    Ok((Trajectory::new(poses.collect()), times))
}

fn rows<const N: usize>(folder: &Path, name: &str, expected: usize) -> Result<Vec<[f64; N]>> {
    let path = folder.join(name);
    let table = Table::read(&path, N)?;
    let (rows, _) = table.values.as_chunks::<N>();
    if rows.len() != expected {
        return Err(Error::Array {
            problem: ArrayProblem::Rows {
                rows: rows.len(),
                times: TimesArray::Frames,
                expected,
            },
            path,
        });
    }
    Ok(rows.to_vec())
}

/// Rotation from earth-centred axes to east, north, up at a position.
fn enu_from_ecef(place: &Vector3<f64>) -> Matrix3<f64> {
    let longitude = place.y.atan2(place.x);
    // Exact on the ellipsoid; some micro-radians off at a height of one kilometre, which turns all positions alike.
    let latitude = place
        .z
        .atan2(place.x.hypot(place.y) * (1.0 - ECCENTRICITY_SQUARED));
    let ((sin_lat, cos_lat), (sin_lon, cos_lon)) = (latitude.sin_cos(), longitude.sin_cos());
    Matrix3::new(
        -sin_lon,
        cos_lon,
        0.0,
        -sin_lat * cos_lon,
        -sin_lat * sin_lon,
        cos_lat,
        cos_lat * cos_lon,
        cos_lat * sin_lon,
        sin_lat,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn up_is_the_ellipsoids_normal() {
        // 45° N, 90° E on the ellipsoid: prime vertical radius N = a / √(1 − e² / 2).
        let n = 6_378_137.0 / (1.0 - ECCENTRICITY_SQUARED / 2.0).sqrt();
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let place = Vector3::new(0.0, n * half, n * (1.0 - ECCENTRICITY_SQUARED) * half);
        let up = enu_from_ecef(&place).row(2).transpose();
        assert!((up - Vector3::new(0.0, half, half)).norm() < 1e-12, "{up}");
        let east = enu_from_ecef(&place).row(0).transpose();
        assert!((east - Vector3::new(-1.0, 0.0, 0.0)).norm() < 1e-12);
    }
}
