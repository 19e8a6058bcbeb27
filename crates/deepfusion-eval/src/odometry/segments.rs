use super::{TrackPair, distances};
use deepfusion_geometry::Se3;

/// Stretch lengths of KITTI's odometry benchmark, in metres.
const KITTI_LENGTHS_M: [u32; 8] = [100, 200, 300, 400, 500, 600, 700, 800];
/// Stretch lengths if no drive is 100 m long.
pub(super) const SHORT_LENGTHS_M: [u32; 5] = [10, 20, 30, 40, 50];
/// KITTI's devkit starts a stretch at every tenth frame (once a second); on short drives, every frame starts one.
const KITTI_STEP: usize = 10;

/// The drift over one stretch of a drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SegmentError {
    /// Its nominal length, in metres.
    pub length_m: u32,
    /// Translation of E divided by the length.
    pub translation: f64,
    /// Rotation angle of E divided by the length, in radians per metre.
    pub rotation_radpm: f64,
}

/// KITTI's drift over stretches of the true trajectory. A stretch goes from frame a to b, the first frame more than the length farther
/// along the road. Its error is E = (P_a⁻¹·P_b)⁻¹·(G_a⁻¹·G_b).
#[derive(Debug, Clone, PartialEq)]
pub struct Segments {
    /// The lengths in use.
    pub lengths_m: &'static [u32],
    /// All stretches of all drives.
    pub errors: Vec<SegmentError>,
}

impl Segments {
    /// The stretches with KITTI's lengths, or those of 10 to 50 m if no drive has any.
    #[must_use]
    pub fn of(tracks: &[TrackPair]) -> Self {
        let kitti = Self::with_lengths(tracks, &KITTI_LENGTHS_M, KITTI_STEP);
        if kitti.errors.is_empty() {
            Self::with_lengths(tracks, &SHORT_LENGTHS_M, 1)
        } else {
            kitti
        }
    }

    fn with_lengths(tracks: &[TrackPair], lengths_m: &'static [u32], step: usize) -> Self {
        let mut errors = Vec::new();
        for track in tracks {
            let along = distances(&track.truth);
            for first in (0..along.len()).step_by(step) {
                for &length_m in lengths_m {
                    let end_m = along[first] + f64::from(length_m);
                    let last = first + along[first..].partition_point(|d| *d <= end_m);
                    if last < along.len() {
                        errors.push(segment(track, first, last, length_m));
                    }
                }
            }
        }
        Self { lengths_m, errors }
    }

    /// Whether the short lengths are in use.
    #[must_use]
    pub fn short(&self) -> bool {
        self.lengths_m == SHORT_LENGTHS_M
    }
}

fn segment(track: &TrackPair, first: usize, last: usize, length_m: u32) -> SegmentError {
    let motion = |poses: &[Se3]| poses[first].inverse() * poses[last];
    let error = motion(&track.predicted).inverse() * motion(&track.truth);
    SegmentError {
        length_m,
        translation: error.translation().norm() / f64::from(length_m),
        rotation_radpm: error.angle() / f64::from(length_m),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn straight(frames: usize, step_m: f64) -> Vec<Se3> {
        let at =
            |i| Se3::from_axis_angle(Vector3::zeros(), Vector3::new(0.0, 0.0, step_m * i as f64));
        (0..frames).map(at).collect()
    }

    /// A trajectory that is 2 % too long. Stretches end at the first frame beyond their length, so with frames a metre apart the drift over
    /// 100 m is 2 % of 101 m.
    #[test]
    fn a_scale_error_gives_the_same_drift() {
        let track = TrackPair::new("d", straight(152, 1.0), straight(152, 1.02)).unwrap();
        let segments = Segments::of(&[track]);
        assert!(!segments.short());
        // Starts 0, 10, …, 50; each needs a pose more than 100 m farther.
        assert_eq!(segments.errors.len(), 6);
        for error in &segments.errors {
            assert_eq!(error.length_m, 100);
            assert!((error.translation - 0.0202).abs() < 1e-12);
            assert!(error.rotation_radpm.abs() < 1e-9);
        }
    }

    #[test]
    fn short_drives_have_short_lengths() {
        let track = TrackPair::new("d", straight(22, 1.0), straight(22, 1.0)).unwrap();
        let segments = Segments::of(&[track]);
        assert!(segments.short());
        let count = |l| segments.errors.iter().filter(|e| e.length_m == l).count();
        assert_eq!([count(10), count(20), count(30)], [11, 1, 0]);
        let short = TrackPair::new("d", straight(5, 1.0), straight(5, 1.0)).unwrap();
        assert!(Segments::of(&[short]).errors.is_empty());
    }
}
