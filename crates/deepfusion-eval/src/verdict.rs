//! Evaluation of depth without ground truth: [`Verdict`].

mod certificate;
mod gate;
mod text;

pub use certificate::{
    BlockScale, ErrorSource, ScaleCertificate, ScaleVerdict, SourceName, TOLERANCE,
};
pub use gate::{Check, WorsenedCheck};

use serde::{Deserialize, Serialize};

use crate::statistics::median;

/// What a drive with speeds, but without LiDAR, shows about a network's depth.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Verdict {
    /// The scale bias; `None` if there is no certificate, with the reason in `no_certificate`.
    pub scale_certificate: Option<ScaleCertificate>,
    /// Why there is no certificate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub no_certificate: Option<NoCertificate>,
    /// Further results.
    pub without_truth: Evidence,
}

/// Why nothing is known about the scale.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum NoCertificate {
    /// No recording measures speed and turns.
    MotionUnknown,
    /// The camera does not move enough from frame to frame.
    NoMovement,
    /// Training saw all frames.
    AllSeen,
    /// Whether training saw the frames is not known.
    SeenNotKnown,
    /// The scene has too few points that can be tracked.
    FewPoints,
}

/// How well depth, images and the vehicle's motion agree. A number that does not exist is `null`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Evidence {
    /// Whether training saw none of the frames used: `Some(false)` if it saw all candidates, `None` if that is unknown.
    pub held_out: Option<bool>,
    /// Number of frames used.
    pub frames: usize,
    /// How well each frame is reconstructed from its neighbour.
    pub reprojection: Option<Reprojection>,
    /// Median over frames of the median over pixels of |ln(depth warped from the frame before / depth)|: 0.05 is 5 %.
    pub consistency: Option<f64>,
    /// The same for |ln(depth / depth of the mirrored image)|.
    pub flip: Option<f64>,
    /// The camera's displacement according to the depth, relative to the vehicle's, by speed.
    pub speeds: Vec<SpeedRow>,
    /// The speed according to the road's motion in the images, relative to the vehicle's, by speed. The camera's height is chosen so that
    /// all speeds agree on average, so only differences between speeds are meaningful. No network is involved.
    #[serde(default)]
    pub road_speeds: Vec<SpeedRow>,
    /// The displacement between neighbouring frames according to PoseNet, relative to the vehicle's, by speed; for runs that trained a
    /// PoseNet.
    #[serde(default)]
    pub pose_speeds: Vec<SpeedRow>,
    /// The factor that depth should be multiplied by, by predicted depth.
    pub ranges: Vec<ScaleRow>,
}

impl Evidence {
    /// The ranges of speeds with any results: lower and upper limit, m/s.
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

/// Photometric errors, 0.85 · (1 − SSIM)/2 + 0.15 · |difference| of grey levels in \[0, 1\]: means over pairs of frames.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Reprojection {
    /// With the frame before warped by the predicted depth and the measured motion.
    pub warped: f64,
    /// With the frame before unchanged: if `warped` is not below this, the depth explains nothing.
    pub unwarped: f64,
    /// Number of pairs of frames.
    pub pairs: usize,
}

/// Results in a range of speeds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SpeedRow {
    /// Lower limit of the speed, m/s.
    pub from_mps: f64,
    /// Upper limit of the speed, m/s; `None` for the last range.
    pub to_mps: Option<f64>,
    /// Number of pairs of frames.
    pub n: usize,
    /// Median of (displacement according to the depth) / (displacement measured): 1.1 if according to the depth the vehicle is 10 % faster
    /// than measured. Likewise for the road's motion and for PoseNet.
    pub ratio: f64,
}

/// Results in a range of predicted depths.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ScaleRow {
    /// Lower limit of the depth, in metres.
    pub from_m: f64,
    /// Upper limit of the depth, in metres.
    pub to_m: f64,
    /// Number of scene points.
    pub n: usize,
    /// Median of (depth from the scene's motion) / (predicted depth), comparable with `scale.median` with ground truth.
    pub scale: f64,
}

/// Limits of the speed ranges, m/s.
const SPEEDS_MPS: [f64; 5] = [0.0, 3.0, 8.0, 15.0, 25.0];
/// Limits of the depth ranges, in metres; as for the metrics.
const RANGES_M: [f64; 5] = [0.0, 10.0, 20.0, 40.0, 80.0];

/// Rows from pairs of (speed in m/s, ln of (displacement according to the depth / displacement measured)).
///
/// Ranges without a pair are left out.
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

/// Index of the range of [`speed_rows`] that contains a speed.
#[must_use]
pub fn speed_range(speed_mps: f64) -> usize {
    SPEEDS_MPS
        .iter()
        .rposition(|from| speed_mps >= *from)
        .unwrap_or(0)
}

/// Rows from points of (predicted depth in metres, ln of the factor that the depth should be multiplied by).
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
    fn rows_contain_the_samples_of_their_range() {
        let rows = speed_rows(&[(2.0, 0.0), (30.0, 0.1), (26.0, 0.3), (40.0, 0.2)]);
        let of = |row: &SpeedRow| (row.from_mps, row.to_mps, row.n, row.ratio);
        assert_eq!(of(&rows[0]), (0.0, Some(3.0), 1, 1.0));
        assert_eq!(of(&rows[1]), (25.0, None, 3, 0.2_f64.exp()));
        assert_eq!(rows.len(), 2);
        let rows = scale_rows(&[(10.0, 0.5), (80.0, 0.7)]);
        assert_eq!((rows.len(), rows[0].from_m, rows[0].n), (1, 10.0, 1));
    }
}
