//! The camera's path according to the vehicle's GPS / IMU unit.

use super::calibration::Calibration;
use super::oxts::{OxtsPacket, read_packets};
use crate::{CameraPath, Dataset, Result};
use deepfusion_geometry::Se3;
use nalgebra::{Rotation3, Vector3};

/// The camera's path from OXTS: the unit's measured attitude, and its position as the integral of its
/// velocity (`vf`, `vl`, `vu`, rotated by the heading; trapezoidal rule). The GPS position is not used, since it jumps
/// by decimetres between houses. The velocity's error accumulates to a few per mille of the distance instead.
///
/// The path is cut where frames are missing, times do not increase, or the packets have a gap of more than
/// half a second.
///
/// # Errors
/// [`crate::Error::Missing`] without time stamps, oxts or the IMU's calibration;
/// [`crate::Error::Oxts`] for a packet that cannot be read.
pub(super) fn oxts_paths(
    dataset: &Dataset,
    calibration: &Calibration,
    speed_scale: f64,
) -> Result<Vec<CameraPath>> {
    // Returns an error that names what is missing, if anything.
    dataset.ego()?;
    // An assumed viewing direction may have been corrected from the images since.
    let cam_from_imu = calibration.require_cam_from_imu()?;
    let imu_from_cam = dataset.cam_from_vehicle().unwrap_or(cam_from_imu).inverse();
    let origin_ns = dataset.origin_ns().unwrap_or_default();
    let mut packets = read_packets(&dataset.folder().join("oxts"), origin_ns)?;
    for (_, packet) in &mut packets {
        packet.velocity_mps = packet.velocity_mps.map(|v| v * speed_scale);
    }
    let unit = UnitPath::new(&packets);
    let mut paths = Vec::new();
    for stretch in dataset.stretches() {
        let follows = |a: &usize, b: &usize| {
            let times = (dataset.frames()[*a].time_s, dataset.frames()[*b].time_s);
            let (Some(from_s), Some(to_s)) = times else {
                return false;
            };
            let track = dataset.track();
            track.is_some_and(|t| t.motion(from_s, to_s).is_some())
        };
        for piece in stretch.chunk_by(follows).filter(|piece| piece.len() > 1) {
            let known = piece.iter().filter_map(|frame| {
                let time_s = dataset.frames()[*frame].time_s?;
                Some((*frame, time_s, unit.at(time_s)? * imu_from_cam))
            });
            let mut path = CameraPath {
                frames: Vec::new(),
                times_s: Vec::new(),
                world_from_cam: Vec::new(),
            };
            for (frame, time_s, pose) in known {
                path.frames.push(frame);
                path.times_s.push(time_s);
                path.world_from_cam.push(pose);
            }
            paths.push(path);
        }
    }
    Ok(paths)
}

/// The unit's pose at each packet's time.
struct UnitPath {
    time_s: Vec<f64>,
    world_from_imu: Vec<Se3>,
    /// Velocity over ground, in world axes, in m/s.
    velocity_mps: Vec<Vector3<f64>>,
}

impl UnitPath {
    fn new(packets: &[(f64, OxtsPacket)]) -> Self {
        let mut path = Self {
            time_s: Vec::new(),
            world_from_imu: Vec::new(),
            velocity_mps: Vec::new(),
        };
        let mut place = Vector3::zeros();
        for (time_s, packet) in packets {
            let [roll, pitch, yaw] = packet.attitude_rad;
            // vf, vl, vu are parallel to the ground, so only the heading rotates them into the world.
            let heading = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw);
            let velocity = heading * Vector3::from(packet.velocity_mps);
            if let (Some(last_s), Some(before)) = (path.time_s.last(), path.velocity_mps.last()) {
                if time_s <= last_s {
                    continue;
                }
                place += (before + velocity) * (0.5 * (time_s - last_s));
            }
            let attitude = Rotation3::from_euler_angles(roll, pitch, yaw);
            path.time_s.push(*time_s);
            path.world_from_imu
                .push(Se3::from_parts(attitude.matrix(), place));
            path.velocity_mps.push(velocity);
        }
        path
    }

    /// `world_from_imu`, interpolated; extrapolated beyond the ends, since the clocks of camera and unit differ by some
    /// milliseconds.
    fn at(&self, time_s: f64) -> Option<Se3> {
        let after = self.time_s.partition_point(|t| *t < time_s);
        if after == 0 || after == self.time_s.len() {
            let end = after.min(self.time_s.len().checked_sub(1)?);
            let on = self.velocity_mps[end] * (time_s - self.time_s[end]);
            return Some(Se3::from_axis_angle(Vector3::zeros(), on) * self.world_from_imu[end]);
        }
        let (t0, t1) = (self.time_s[after - 1], self.time_s[after]);
        let fraction = (time_s - t0) / (t1 - t0);
        Some(self.world_from_imu[after - 1].interpolate(&self.world_from_imu[after], fraction))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn packet(yaw: f64, pitch: f64) -> OxtsPacket {
        OxtsPacket {
            attitude_rad: [0.0, pitch, yaw],
            velocity_mps: [10.0, 0.0, 0.0],
            acceleration_mps2: [0.0; 3],
            rate_radps: [0.0; 3],
        }
    }

    #[test]
    fn the_path_of_a_circle_closes() {
        // 10 m/s and a full turn in 20 s: a circle of radius 31.8 m, sampled at 100 Hz.
        let turn = std::f64::consts::TAU / 20.0;
        let packets: Vec<_> = (0..=2000)
            .map(|i| {
                let t = f64::from(i) * 0.01;
                (t, packet(turn * t, 0.0))
            })
            .collect();
        let path = UnitPath::new(&packets);
        let half = path.at(10.0).unwrap().translation();
        assert!((half - Vector3::new(0.0, 200.0 / std::f64::consts::PI, 0.0)).norm() < 1e-3);
        let whole = path.at(20.0).unwrap();
        assert!(whole.translation().norm() < 1e-9 && whole.angle() < 1e-9);
    }

    #[test]
    fn slightly_different_clocks_leave_no_gap() {
        let path = UnitPath::new(&[(0.0, packet(0.0, 0.1)), (0.1, packet(0.0, 0.1))]);
        for t in [-0.01, 0.05, 0.11] {
            let place = path.at(t).unwrap().translation();
            assert!((place - Vector3::new(10.0 * t, 0.0, 0.0)).norm() < 1e-12);
        }
        // Nose down by 0.1 rad: the unit's x points below the horizon.
        let ahead = path.at(0.0).unwrap().rotate(&Vector3::x());
        assert!((ahead.z + 0.1_f64.sin()).abs() < 1e-12);
    }
}
