//! What can be said of depth without ground truth: [`Verdict`].

mod certificate;
mod gate;
mod text;

pub use certificate::{
    BlockScale, ErrorSource, ScaleCertificate, ScaleVerdict, SourceName, TOLERANCE,
};
pub use gate::{Check, WorsenedCheck};

use serde::{Deserialize, Serialize};

use crate::statistics::median;

/// What a drive with speeds says of a network's depth, without LiDAR.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Verdict {
    /// The bias of the metre; `None` where `no_certificate` says why.
    pub scale_certificate: Option<ScaleCertificate>,
    /// Why there is no certificate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub no_certificate: Option<NoCertificate>,
    /// What else was found.
    pub without_truth: Evidence,
}

/// Why nothing can be said of the scale.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum NoCertificate {
    /// No recording knows speed and turns.
    MotionUnknown,
    /// The camera does not move enough from frame to frame.
    NoMovement,
    /// Training saw all frames.
    AllSeen,
    /// Whether training saw the frames is not known.
    SeenNotKnown,
    /// The scene shows too few points that can be followed.
    FewPoints,
}

/// How well depth, images and the vehicle's motion fit together. A number that does not exist is `null`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Evidence {
    /// Whether training saw none of the frames looked at: `Some(false)` where it saw all that could have been, `None` where that is not known.
    pub held_out: Option<bool>,
    /// Frames looked at.
    pub frames: usize,
    /// How well the frames explain each other.
    pub reprojection: Option<Reprojection>,
    /// The median over frames of the median over pixels of |ln(depth carried over from the frame before / depth)|: 0.05 is 5 %.
    pub consistency: Option<f64>,
    /// The same of |ln(depth / depth of the mirrored image)|.
    pub flip: Option<f64>,
    /// The camera's way as seen through the depth, against the vehicle's, by speed.
    pub speeds: Vec<SpeedRow>,
    /// The speed by the road's motion in the images, against the vehicle's, by speed; the camera's height is that which all speeds together
    /// imply, so that only differences between speeds show. No network takes part.
    #[serde(default)]
    pub road_speeds: Vec<SpeedRow>,
    /// The way between neighbouring frames as PoseNet sees it, against the vehicle's, by speed; of runs that trained one.
    #[serde(default)]
    pub pose_speeds: Vec<SpeedRow>,
    /// What the depth is to be multiplied by, by the depth as predicted.
    pub ranges: Vec<ScaleRow>,
}

impl Evidence {
    /// The ranges of speeds that anything is known of: from, and below, m/s.
    #[must_use]
    pub fn speed_ranges(&self) -> Vec<(f64, Option<f64>)> {
        let rows = || {
            self.speeds
                .iter()
                .chain(&self.road_speeds)
                .chain(&self.pose_speeds)
        };
        let mut ranges: Vec<_> = rows().map(|row| (row.from_mps, row.to_mps)).collect();
        ranges.sort_by(|a, b| a.0.total_cmp(&b.0));
        ranges.dedup();
        ranges
    }
}

/// Photometric errors, 0.85 · (1 − SSIM)/2 + 0.15 · |difference| of grey levels in \[0, 1\], means over pairs of frames.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Reprojection {
    /// With the frame before carried over by the predicted depth and the measured motion.
    pub warped: f64,
    /// With the frame before as it is: depth that explains nothing is not below it.
    pub unwarped: f64,
    /// Pairs of frames.
    pub pairs: usize,
}

/// A range of speeds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SpeedRow {
    /// From this speed on, m/s.
    pub from_mps: f64,
    /// Below this one, m/s; `None`: without an end.
    pub to_mps: Option<f64>,
    /// Pairs of frames.
    pub n: usize,
    /// The median of (way through the depth) / (way measured): 1.1 where the depth makes the vehicle 10 % faster than it says. Of the road's
    /// motion and of PoseNet likewise.
    pub ratio: f64,
}

/// A range of predicted depths.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ScaleRow {
    /// From this depth on, metres.
    pub from_m: f64,
    /// Below this one, metres.
    pub to_m: f64,
    /// Scene points.
    pub n: usize,
    /// The median of (depth by the scene's movement) / (depth predicted), as `scale.median` is with ground truth.
    pub scale: f64,
}

/// Where speeds are divided, m/s.
const SPEEDS_MPS: [f64; 5] = [0.0, 3.0, 8.0, 15.0, 25.0];
/// Where depths are divided, metres; as the metrics' ranges.
const RANGES_M: [f64; 5] = [0.0, 10.0, 20.0, 40.0, 80.0];

/// Rows of (speed in m/s, ln of way through the depth over way measured).
///
/// Rows without a pair are left out.
#[must_use]
pub fn speed_rows(pairs: &[(f64, f64)]) -> Vec<SpeedRow> {
    let rows = SPEEDS_MPS.iter().enumerate().filter_map(|(i, &from_mps)| {
        let to_mps = SPEEDS_MPS.get(i + 1).copied();
        let inside = |speed: f64| speed >= from_mps && to_mps.is_none_or(|to| speed < to);
        let logs = logs_where(pairs, inside);
        Some(SpeedRow {
            from_mps,
            to_mps,
            n: logs.len(),
            ratio: median(&logs)?.exp(),
        })
    });
    rows.collect()
}

/// Of the ranges of [`speed_rows`], the one that a speed lies in, by its number.
#[must_use]
pub fn speed_range(speed_mps: f64) -> usize {
    SPEEDS_MPS
        .iter()
        .rposition(|from| speed_mps >= *from)
        .unwrap_or(0)
}

/// Rows of (predicted depth in metres, ln of the factor it wants).
#[must_use]
pub fn scale_rows(points: &[(f64, f64)]) -> Vec<ScaleRow> {
    let rows = RANGES_M.windows(2).filter_map(|edge| {
        let (from_m, to_m) = (edge[0], edge[1]);
        let logs = logs_where(points, |depth| depth >= from_m && depth < to_m);
        Some(ScaleRow {
            from_m,
            to_m,
            n: logs.len(),
            scale: median(&logs)?.exp(),
        })
    });
    rows.collect()
}

fn logs_where(pairs: &[(f64, f64)], inside: impl Fn(f64) -> bool) -> Vec<f64> {
    let inside = pairs.iter().filter(|(at, _)| inside(*at));
    inside.map(|(_, log)| *log).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_hold_what_lies_in_them() {
        let rows = speed_rows(&[(2.0, 0.0), (30.0, 0.1), (26.0, 0.3), (40.0, 0.2)]);
        let of = |row: &SpeedRow| (row.from_mps, row.to_mps, row.n, row.ratio);
        assert_eq!(of(&rows[0]), (0.0, Some(3.0), 1, 1.0));
        assert_eq!(of(&rows[1]), (25.0, None, 3, 0.2_f64.exp()));
        assert_eq!(rows.len(), 2);
        let rows = scale_rows(&[(10.0, 0.5), (80.0, 0.7)]);
        assert_eq!((rows.len(), rows[0].from_m, rows[0].n), (1, 10.0, 1));
    }
}
