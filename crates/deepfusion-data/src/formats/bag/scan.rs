//! Reads a LiDAR message as points with radial velocities, and projects them into a frame's camera.

use super::config::{LidarConfig, Sign};
use super::doppler::{ego_velocity, ground_radial};
use super::index::stamp;
use super::point_times::seconds_after;
use crate::{Error, Result, TopicProblem};
use deepfusion_geometry::{DepthMap, Intrinsics, Se3};
use deepfusion_rosbag::msg::PointCloud2;
use deepfusion_rosbag::{Message, MessageError, MessageSource};
use nalgebra::Vector3;
use std::collections::HashMap;

/// Names under which drivers publish the radial velocity.
const VELOCITY_NAMES: [&str; 6] = [
    "velocity",
    "radial_velocity",
    "doppler",
    "v_radial",
    "vel",
    "v",
];
/// If a smaller fraction of a scan's points agrees with its estimated velocity, the vehicle's is used instead.
pub(super) const MIN_STATIC: f64 = 0.4;
/// Points within this time share a pose, in seconds: at 50 m/s, the error is at most 5 mm.
const STEP_S: f64 = 1e-4;

/// A scan's points.
#[derive(Debug, Clone, Default)]
pub(super) struct Scan {
    pub(super) xyz: Vec<[f32; 3]>,
    /// Radial velocities relative to the sensor, m/s, receding is positive.
    pub(super) radial: Option<Vec<f32>>,
    /// Times of the points, in seconds after the scan's time. Without them, all points are from the scan's time, or compensated for motion.
    pub(super) after_s: Option<Vec<f32>>,
}

/// A scan projected into a frame's camera. H×W, row by row.
#[derive(Debug, Clone)]
pub(super) struct SeenScan {
    /// Camera z in metres, 0 = no depth.
    pub(super) depth: DepthMap,
    /// Index of the scan's point at each pixel; [`SeenScan::NONE`] if there is none.
    point: Vec<u32>,
}

impl SeenScan {
    const NONE: u32 = u32::MAX;

    /// The value of each pixel's point, given one value per point of the scan; `none` for pixels without a point.
    pub(super) fn pixels<T: Copy>(&self, of_points: &[T], none: T) -> Vec<T> {
        let value = |point: &u32| of_points.get(*point as usize).copied().unwrap_or(none);
        self.point.iter().map(value).collect()
    }
}

/// Only the positions of a cloud's points, metres.
///
/// # Errors
/// [`Error::Bag`] if the message is not a point cloud; [`Error::Topic`] without x, y and z.
pub(super) fn points(bag: &dyn MessageSource, message: &Message<'_>) -> Result<Vec<[f32; 3]>> {
    let cloud: PointCloud2<'_> = message.decode()?;
    xyz(|name| column(bag, message, &cloud, name))
}

fn xyz(column: impl Fn(&str) -> Result<Vec<f32>>) -> Result<Vec<[f32; 3]>> {
    let (x, y, z) = (column("x")?, column("y")?, column("z")?);
    let points = x.iter().zip(&y).zip(&z).map(|((x, y), z)| [*x, *y, *z]);
    Ok(points.collect())
}

fn column(
    bag: &dyn MessageSource,
    message: &Message<'_>,
    cloud: &PointCloud2<'_>,
    name: &str,
) -> Result<Vec<f32>> {
    let column = cloud.column(name);
    let column = column.map_err(|source| of_column(bag, message, source))?;
    Ok(column.f32s().collect())
}

fn of_column(bag: &dyn MessageSource, message: &Message<'_>, source: MessageError) -> Error {
    let topic = message.topic().to_owned();
    of_cloud(bag, TopicProblem::Column { topic, source })
}

fn of_cloud(bag: &dyn MessageSource, problem: TopicProblem) -> Error {
    Error::Topic {
        path: bag.path().to_owned(),
        problem: Box::new(problem),
        choice: None,
    }
}

/// The points' own times in the field of this name, in seconds after the message's.
fn times(
    bag: &dyn MessageSource,
    message: &Message<'_>,
    cloud: &PointCloud2<'_>,
    xyz: &[[f32; 3]],
    name: &str,
) -> Result<Vec<f32>> {
    let column = cloud.column(name);
    let column = column.map_err(|source| of_column(bag, message, source))?;
    let is_point = |i: usize| xyz.get(i).is_some_and(usable);
    seconds_after(&column, stamp(message), is_point).ok_or_else(|| {
        let (topic, field) = (message.topic().to_owned(), name.to_owned());
        of_cloud(bag, TopicProblem::PointTimes { topic, field })
    })
}

impl Scan {
    /// # Errors
    /// [`Error::Bag`] if the message is not a point cloud; [`Error::Topic`] without x, y and z, without a field named in
    /// the settings, or for invalid times.
    pub(super) fn decode(
        bag: &dyn MessageSource,
        message: &Message<'_>,
        lidar: &LidarConfig,
    ) -> Result<Self> {
        let cloud: PointCloud2<'_> = message.decode()?;
        let column = |name: &str| column(bag, message, &cloud, name);
        let xyz = xyz(column)?;
        let has = |name: &&str| cloud.fields.iter().any(|f| f.name == **name);
        let named = lidar.velocity_field.as_deref();
        let usual = || VELOCITY_NAMES.iter().find(|name| has(name)).copied();
        let radial = match named.or_else(usual) {
            Some(name) => Some(column(name)?),
            None => None,
        };
        let after_s = match lidar.time_field.as_deref() {
            Some(name) => Some(times(bag, message, &cloud, &xyz, name)?),
            None => None,
        };
        let sign = match lidar.receding {
            Sign::Positive => 1.0,
            Sign::Negative => -1.0,
        };
        Ok(Self {
            xyz,
            radial: radial.map(|r| r.into_iter().map(|v| sign * v).collect()),
            after_s,
        })
    }

    /// Each point's own speed along its ray, m/s. `vehicle` is the sensor's velocity (its axes) according to the vehicle, if
    /// known. The velocity estimated from the scan's static points does not depend on the clocks' offset, so it is
    /// used if enough of the scan agrees.
    pub(super) fn ground_radial(
        &self,
        vehicle: Option<Vector3<f64>>,
        over_ground: bool,
    ) -> Option<Vec<f32>> {
        let radial = self.radial.as_ref()?;
        if over_ground {
            return Some(radial.clone());
        }
        let by_scan = ego_velocity(&self.xyz, radial, vehicle)
            .filter(|ego| ego.static_share >= MIN_STATIC)
            .map(|ego| ego.velocity);
        let velocity = by_scan.or(vehicle)?;
        Some(ground_radial(&self.xyz, radial, &velocity))
    }

    /// The scan projected into a camera; the nearest point wins a pixel. `cam_from_lidar` takes seconds after the scan's time, and gives
    /// the transform from the LiDAR at that time to the camera at the frame's time.
    pub(super) fn seen(&self, cam_from_lidar: impl Fn(f64) -> Se3, k: &Intrinsics) -> SeenScan {
        let (width, height) = (k.width as usize, k.height as usize);
        let mut depth = DepthMap::empty(width, height);
        let mut nearest = vec![SeenScan::NONE; width * height];
        let mut poses = HashMap::new();
        let mut pose = |point: u32| -> Se3 {
            let after_s = self.after_s.as_deref().unwrap_or_default();
            let after_s = after_s.get(point as usize).copied().unwrap_or(0.0);
            let steps = (f64::from(after_s) / STEP_S).round();
            let pose = poses.entry(steps as i32);
            *pose.or_insert_with(|| cam_from_lidar(steps * STEP_S))
        };
        let points = (0_u32..).zip(&self.xyz);
        for (i, point) in points.filter(|(_, point)| usable(point)) {
            let seen = pose(i).transform(&Vector3::from(point.map(f64::from)));
            let Some(pixel) = k.project(&seen) else {
                continue;
            };
            let (u, v) = (pixel.x.round_ties_even(), pixel.y.round_ties_even());
            if !(u >= 0.0 && v >= 0.0 && u < width as f64 && v < height as f64) {
                continue;
            }
            let at = v as usize * width + u as usize;
            let old = depth.data[at];
            if old == 0.0 || seen.z < f64::from(old) {
                depth.data[at] = seen.z as f32;
                nearest[at] = i;
            }
        }
        SeenScan {
            depth,
            point: nearest,
        }
    }
}

/// Whether a point is valid: drivers fill rays without a return with zeros or NaN.
pub(super) fn usable(point: &[f32; 3]) -> bool {
    let length = Vector3::from(*point).norm();
    length.is_finite() && length > 0.1
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ray without a return would otherwise be a point at the scanner's own position, which may be in the image.
    #[test]
    fn rays_without_a_return_give_no_depth() {
        let scan = Scan {
            xyz: vec![[0.0; 3], [f32::NAN; 3], [0.0, 0.0, 8.0]],
            ..Scan::default()
        };
        let ahead = Se3::from_axis_angle(Vector3::zeros(), Vector3::new(0.0, 0.5, 1.0));
        let seen = scan.seen(|_| ahead, &Intrinsics::centred(100.0, (200, 100)));
        let known: Vec<f32> = seen
            .depth
            .data
            .iter()
            .copied()
            .filter(|d| *d > 0.0)
            .collect();
        assert_eq!(known, [9.0]);
    }

    /// A wall 10 m ahead, measured by a rotating scanner on its left before the frame and on its right after it, while driving at 10 m/s.
    #[test]
    fn points_are_projected_from_the_pose_at_their_own_time() {
        let scan = Scan {
            xyz: vec![[-1.0, 0.0, 10.0], [1.0, 0.0, 10.0]],
            after_s: Some(vec![-0.05, 0.05]),
            ..Scan::default()
        };
        let moved = |after_s: f64| {
            Se3::from_axis_angle(Vector3::zeros(), Vector3::new(0.0, 0.0, 10.0 * after_s))
        };
        let seen = scan.seen(moved, &Intrinsics::centred(100.0, (200, 100)));
        let depth = seen.depth.data.iter().copied();
        let mut known: Vec<f32> = depth.filter(|d| *d > 0.0).collect();
        known.sort_by(f32::total_cmp);
        assert_eq!(known, [9.5, 10.5]);
    }
}
