//! Speed and turns from the poses of Odometry messages without a twist, as published by LiDAR and visual odometry.

use crate::formats::shared::pose_track::speed_log;
use crate::logs::speed_log::SpeedLog;
use deepfusion_geometry::Se3;
use deepfusion_rosbag::msg::{Odometry, Twist};
use nalgebra::Vector3;
use std::path::Path;

/// Distance over which a direction of travel is determined, in metres. If the poses never move this far, the vehicle stands still.
const STEP_M: f64 = 1.0;
/// Least mean cosine of the angle between the poses' x axis and the direction of travel: beyond 26°, x is not the vehicle's forward axis.
const MIN_COSINE: f64 = 0.9;

/// The vehicle's motion according to poses.
pub(super) enum PoseMotion {
    /// The vehicle stands still.
    Standing,
    /// The poses' x does not point along the direction of travel: they are of a body with other axes.
    OtherAxes,
    /// Speeds, turns, roll and pitch.
    Moving(Box<SpeedLog>),
}

/// The pose in a message (`world_from_body`, metres), if its twist is 0.
pub(super) fn pose_without_twist(odometry: &Odometry) -> Option<Se3> {
    let Twist { linear, angular } = &odometry.twist.twist;
    let twist = [
        linear.x, linear.y, linear.z, angular.x, angular.y, angular.z,
    ];
    let (p, q) = (
        &odometry.pose.pose.position,
        &odometry.pose.pose.orientation,
    );
    let place = Vector3::new(p.x, p.y, p.z);
    let empty = twist.iter().all(|value| *value == 0.0);
    empty.then(|| Se3::from_quaternion([q.w, q.x, q.y, q.z], place))
}

/// The motion computed from poses with their times (ns). Invalid poses, such as those without an orientation, are left out.
pub(super) fn motion_of(bag: &Path, mut poses: Vec<(i64, Se3)>) -> PoseMotion {
    let is_pose = |pose: &Se3| {
        let (attitude, place) = (pose.quaternion(), pose.translation());
        let mut numbers = attitude.iter().chain(place.iter());
        numbers.all(|number| number.is_finite())
    };
    poses.retain(|(_, pose)| is_pose(pose));
    poses.sort_by_key(|(ns, _)| *ns);
    match along(&poses) {
        None => PoseMotion::Standing,
        Some(along) if along < MIN_COSINE => PoseMotion::OtherAxes,
        Some(_) => PoseMotion::Moving(Box::new(speed_log(bag, &poses))),
    }
}

/// Mean cosine of the angle between the poses' x axis and the direction of travel, forward or backward; `None` if they stand still.
fn along(poses: &[(i64, Se3)]) -> Option<f64> {
    let mut from = poses.first()?.1;
    let (mut sum, mut steps) = (0.0, 0_u32);
    for (_, pose) in poses {
        let moved = pose.translation() - from.translation();
        let path_m = moved.norm();
        if path_m < STEP_M {
            continue;
        }
        // The chord of an arc has the direction halfway between both attitudes.
        let ahead = from.interpolate(pose, 0.5).rotate(&Vector3::x());
        sum += ahead.dot(&moved).abs() / path_m;
        steps += 1;
        from = *pose;
    }
    (steps > 0).then(|| sum / f64::from(steps))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 10 m/s in one direction, a pose each tenth of a second, with a constant attitude.
    fn poses(direction: [f64; 3], turn: [f64; 3]) -> Vec<(i64, Se3)> {
        let at = |i: i32| {
            let place = Vector3::from(direction) * f64::from(i);
            let pose = Se3::from_axis_angle(Vector3::from(turn), place);
            (i64::from(i) * 100_000_000, pose)
        };
        (0..30).map(at).collect()
    }

    #[test]
    fn poses_give_speeds_only_if_their_x_points_along_the_path() {
        let path = Path::new("drive.bag");
        // To the north, with the x axis pointing north; the last pose has no orientation.
        let mut north = poses([0.0, 1.0, 0.0], [0.0, 0.0, 1.57]);
        let zero = Se3::from_quaternion([0.0; 4], Vector3::zeros());
        north.push((3_000_000_000, zero));
        let PoseMotion::Moving(log) = motion_of(path, north) else {
            panic!("it drives");
        };
        assert_eq!(log.speeds_mps.ns.len(), 30);
        for speed in &log.speeds_mps.values {
            assert!((speed - 10.0).abs() < 1e-3, "{speed}");
        }
        // A camera's body: x to the right.
        let sideways = poses([0.0, 1.0, 0.0], [0.0; 3]);
        assert!(matches!(motion_of(path, sideways), PoseMotion::OtherAxes));
        let standing = poses([0.01, 0.0, 0.0], [0.0; 3]);
        assert!(matches!(motion_of(path, standing), PoseMotion::Standing));
        assert!(matches!(motion_of(path, Vec::new()), PoseMotion::Standing));
    }
}
