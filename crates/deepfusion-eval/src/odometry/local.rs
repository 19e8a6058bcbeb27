use super::TrackPair;
use crate::statistics::{mean, median};
use deepfusion_geometry::Se3;
use nalgebra::Vector3;

/// Number of poses in a snippet for the absolute trajectory error.
const ATE_POSES: usize = 5;
/// Pairs of frames between which the camera moves less than this, in metres, are not used for the scale.
const MOVING_M: f64 = 0.05;

/// Errors over a few frames.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Local {
    /// Per snippet of five poses: √(mean ‖p̂ − p‖²), with positions relative to the snippet's first pose, in metres.
    pub ate_m: Vec<f64>,
    /// The same in SfMLearner's form, for comparison with its tables: positions are first scaled by the least-squares factor, and the error
    /// is √(Σ ‖p̂ − p‖²) / 5.
    pub ate_scaled_m: Vec<f64>,
    /// Per pair of frames: true over predicted displacement, for pairs between which the camera moves.
    pub ratios: Vec<f64>,
    /// Per pair of frames: translation of the error motion (the predicted motion relative to the true one), in metres.
    pub pair_m: Vec<f64>,
    /// Per pair of frames: rotation angle of the error motion, in radians.
    pub pair_rad: Vec<f64>,
}

impl Local {
    /// The errors of all drives.
    #[must_use]
    pub fn of(tracks: &[TrackPair]) -> Self {
        let mut local = Self::default();
        for track in tracks {
            local.add_pairs(track);
            for first in 0..(track.truth.len() + 1).saturating_sub(ATE_POSES) {
                local.add_snippet(track, first);
            }
        }
        local
    }

    /// The median of the scale ratios.
    #[must_use]
    pub fn scale(&self) -> Option<f64> {
        median(&self.ratios)
    }

    /// The mean absolute trajectory error over snippets.
    #[must_use]
    pub fn mean_ate_m(&self) -> Option<f64> {
        mean(&self.ate_m)
    }

    fn add_pairs(&mut self, track: &TrackPair) {
        let motions = |poses: &[Se3]| -> Vec<Se3> {
            poses.windows(2).map(|w| w[0].inverse() * w[1]).collect()
        };
        let pairs = motions(&track.truth).into_iter();
        for (truth, predicted) in pairs.zip(motions(&track.predicted)) {
            let (true_m, predicted_m) =
                (truth.translation().norm(), predicted.translation().norm());
            let ratio = true_m / predicted_m;
            if true_m >= MOVING_M && ratio.is_finite() {
                self.ratios.push(ratio);
            }
            let left = truth.inverse() * predicted;
            self.pair_m.push(left.translation().norm());
            self.pair_rad.push(left.angle());
        }
    }

    fn add_snippet(&mut self, track: &TrackPair, first: usize) {
        let positions = |poses: &[Se3]| -> Vec<Vector3<f64>> {
            let snippet = &poses[first..first + ATE_POSES];
            let first_from_world = snippet[0].inverse();
            let seen = |p: &Se3| first_from_world.transform(&p.translation());
            snippet.iter().map(seen).collect()
        };
        let (truth, predicted) = (positions(&track.truth), positions(&track.predicted));
        let squares = |scale: f64| -> f64 {
            let pairs = truth.iter().zip(&predicted);
            pairs.map(|(t, p)| (t - p * scale).norm_squared()).sum()
        };
        self.ate_m.push((squares(1.0) / ATE_POSES as f64).sqrt());
        let dot: f64 = truth.iter().zip(&predicted).map(|(t, p)| t.dot(p)).sum();
        let own: f64 = predicted.iter().map(Vector3::norm_squared).sum();
        let scale = if own > 0.0 { dot / own } else { 1.0 };
        self.ate_scaled_m
            .push(squares(scale).sqrt() / ATE_POSES as f64);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn straight(frames: u32, step_m: f64) -> Vec<Se3> {
        let at = |i| {
            Se3::from_axis_angle(
                Vector3::zeros(),
                Vector3::new(0.0, 0.0, step_m * f64::from(i)),
            )
        };
        (0..frames).map(at).collect()
    }

    #[test]
    fn a_scale_error_by_hand() {
        let track = TrackPair::new("d", straight(6, 1.0), straight(6, 0.8)).unwrap();
        let local = Local::of(&[track]);
        assert_eq!((local.ate_m.len(), local.ratios.len()), (2, 5));
        assert!((local.scale().unwrap() - 1.25).abs() < 1e-12);
        // 0.2 · (0, 1, 2, 3, 4): √(0.04 · 30 / 5).
        assert!((local.mean_ate_m().unwrap() - 0.24_f64.sqrt()).abs() < 1e-12);
        assert!(local.ate_scaled_m.iter().all(|e| *e < 1e-12));
        assert!(local.pair_m.iter().all(|e| (e - 0.2).abs() < 1e-12));
    }

    #[test]
    fn a_standing_camera_has_no_scale() {
        let track = TrackPair::new("d", straight(6, 0.01), straight(6, 1.0)).unwrap();
        assert_eq!(Local::of(&[track]).scale(), None);
        let track = TrackPair::new("d", straight(6, 1.0), straight(6, 0.0)).unwrap();
        assert_eq!(Local::of(&[track]).scale(), None);
    }

    #[test]
    fn fewer_than_five_poses_make_no_snippet() {
        let track = TrackPair::new("d", straight(4, 1.0), straight(4, 1.0)).unwrap();
        assert_eq!(Local::of(&[track]).mean_ate_m(), None);
    }
}
