//! Odometry: compares predicted trajectories of the camera with the true ones.
//!
//! Every number is unscaled, as is fair for a metric method: only the position and the direction at the start of a stretch are aligned. A
//! pose is `world_from_cam`, in metres. The two world frames may differ, since only motions within a trajectory are compared.

mod error;
mod file;
mod local;
mod pose_text;
mod report;
mod segments;
mod table;

pub use error::{PoseFileError, PoseLineProblem, TrackError};
pub use file::{PoseFile, PoseFormat};
pub use local::Local;
pub use pose_text::{kitti_text, tum_text};
pub use report::{LengthRow, OdometryReport, TrackRow};
pub use segments::{SegmentError, Segments};

use deepfusion_geometry::Se3;

/// The predicted and true poses of one drive, frame by frame.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackPair {
    /// Name of the drive.
    pub name: String,
    /// True `world_from_cam`.
    pub truth: Vec<Se3>,
    /// Predicted `world_from_cam`.
    pub predicted: Vec<Se3>,
    /// Times of the poses, in seconds; empty if unknown.
    pub times_s: Vec<f64>,
}

impl TrackPair {
    /// # Errors
    /// [`TrackError`] if the two differ in length or have fewer than two poses.
    pub fn new(
        name: impl Into<String>,
        truth: Vec<Se3>,
        predicted: Vec<Se3>,
    ) -> Result<Self, TrackError> {
        let name = name.into();
        if truth.len() != predicted.len() {
            return Err(TrackError::Lengths {
                name,
                predicted: predicted.len(),
                truth: truth.len(),
            });
        }
        if truth.len() < 2 {
            return Err(TrackError::TooShort {
                name,
                poses: truth.len(),
            });
        }
        Ok(Self {
            name,
            truth,
            predicted,
            times_s: Vec::new(),
        })
    }

    /// The same drive with times for its poses, in seconds.
    #[must_use]
    pub fn with_times(mut self, times_s: Vec<f64>) -> Self {
        self.times_s = times_s;
        self
    }

    /// Length of the true trajectory, in metres.
    #[must_use]
    pub fn distance_m(&self) -> f64 {
        distances(&self.truth).last().copied().unwrap_or(0.0)
    }
}

/// Poses from the motions between consecutive frames: `motions[i]` is `frame(i+1)_from_frame(i)`. The world is the first frame.
#[must_use]
pub fn chain(motions: &[Se3]) -> Vec<Se3> {
    let mut poses = vec![Se3::identity()];
    let mut world_from_cam = Se3::identity();
    for next_from_this in motions {
        world_from_cam = world_from_cam * next_from_this.inverse();
        poses.push(world_from_cam);
    }
    poses
}

/// The same trajectory relative to its first pose, as in KITTI's files.
#[must_use]
pub fn from_first(poses: &[Se3]) -> Vec<Se3> {
    let first_from_world = poses.first().map_or_else(Se3::identity, Se3::inverse);
    poses.iter().map(|pose| first_from_world * *pose).collect()
}

/// Distance travelled up to each pose, in metres.
fn distances(poses: &[Se3]) -> Vec<f64> {
    let mut length = 0.0;
    let mut lengths = Vec::with_capacity(poses.len());
    for (i, pose) in poses.iter().enumerate() {
        if i > 0 {
            length += (pose.translation() - poses[i - 1].translation()).norm();
        }
        lengths.push(length);
    }
    lengths
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn chaining_motions_restores_the_trajectory() {
        let path: Vec<Se3> = (0..6)
            .map(|i| {
                let t = f64::from(i);
                Se3::from_axis_angle(
                    Vector3::new(0.01 * t, -0.2 * t, 0.0),
                    Vector3::new(t.sin(), 0.1 * t, t),
                )
            })
            .collect();
        let motions: Vec<Se3> = path.windows(2).map(|w| w[1].inverse() * w[0]).collect();
        let first = path[0];
        for (chained, pose) in chain(&motions).iter().zip(&path) {
            let off = (first * *chained).inverse() * *pose;
            assert!(off.translation().norm() < 1e-12 && off.angle() < 1e-12);
        }
    }

    #[test]
    fn tracks_that_cannot_be_compared_are_refused() {
        let one = vec![Se3::identity()];
        let two = vec![Se3::identity(); 2];
        let error = TrackPair::new("drive", one.clone(), two).unwrap_err();
        assert!(error.to_string().contains("2 predicted poses, 1 true pose"));
        let error = TrackPair::new("drive", one.clone(), one).unwrap_err();
        assert!(error.to_string().contains("1 pose"), "{error}");
    }
}
