use crate::Se3;

/// The pose of a body at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StampedPose {
    /// Time, in seconds.
    pub time_s: f64,
    /// Pose of the body: body frame to world frame.
    pub world_from_body: Se3,
}

/// The trajectory of a body: poses in order of time.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Trajectory {
    poses: Vec<StampedPose>,
}

impl Trajectory {
    /// A trajectory through `poses`, which are sorted here. Poses whose time is not finite are dropped.
    #[must_use]
    pub fn new(mut poses: Vec<StampedPose>) -> Self {
        poses.retain(|p| p.time_s.is_finite());
        poses.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        Self { poses }
    }

    /// The poses, in order of time.
    #[must_use]
    pub fn poses(&self) -> &[StampedPose] {
        &self.poses
    }

    /// The pose at `time_s`, interpolated between its neighbours; `None` outside the trajectory, and between neighbours more than
    /// `max_gap_s` apart, because the motion between them is unknown.
    #[must_use]
    pub fn at(&self, time_s: f64, max_gap_s: f64) -> Option<Se3> {
        let after = self.poses.partition_point(|p| p.time_s < time_s);
        let next = self.poses.get(after)?;
        if next.time_s == time_s {
            return Some(next.world_from_body);
        }
        let previous = self.poses.get(after.checked_sub(1)?)?;
        let gap_s = next.time_s - previous.time_s;
        if gap_s > max_gap_s {
            return None;
        }
        let fraction = (time_s - previous.time_s) / gap_s;
        Some(
            previous
                .world_from_body
                .interpolate(&next.world_from_body, fraction),
        )
    }

    /// Length of the trajectory, in metres.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        self.poses
            .windows(2)
            .map(|w| {
                (w[1].world_from_body.translation() - w[0].world_from_body.translation()).norm()
            })
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn straight() -> Trajectory {
        let pose = |time_s: f64| StampedPose {
            time_s,
            world_from_body: Se3::from_axis_angle(
                Vector3::new(0.0, 0.0, 0.1 * time_s),
                Vector3::new(2.0 * time_s, 0.0, 0.0),
            ),
        };
        Trajectory::new(vec![pose(2.0), pose(0.0), pose(1.0)])
    }

    #[test]
    fn poses_are_interpolated() {
        let pose = straight().at(1.25, 1.0).unwrap();
        assert!((pose.translation().x - 2.5).abs() < 1e-12);
        assert!((pose.axis_angle().z - 0.125).abs() < 1e-12);
    }

    #[test]
    fn there_is_no_pose_outside_the_trajectory() {
        assert!(straight().at(-0.1, 1.0).is_none());
        assert!(straight().at(2.1, 1.0).is_none());
        assert!(straight().at(2.0, 1.0).is_some());
        assert!(Trajectory::default().at(0.0, 1.0).is_none());
    }

    #[test]
    fn there_is_no_pose_in_a_gap() {
        assert!(straight().at(1.25, 0.9).is_none());
        assert!(straight().at(1.0, 0.9).is_some());
    }

    #[test]
    fn length_sums_the_steps() {
        assert!((straight().length_m() - 4.0).abs() < 1e-12);
    }
}
