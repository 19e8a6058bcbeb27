use super::{Local, Segments, TrackPair};
use crate::statistics::mean;
use serde::{Deserialize, Serialize};

/// The result of an odometry evaluation over all drives. It serialises to JSON that scripts rely on: a number that does not exist is
/// `null`, never NaN.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OdometryReport {
    /// Number of poses compared.
    pub n: usize,
    /// Length of the true trajectories, in metres.
    pub distance_m: f64,
    /// Translation drift over stretches of `lengths_m`, in percent of their length; `None` if no stretch fits.
    pub t_rel_percent: Option<f64>,
    /// Rotation drift over the same stretches, in degrees per metre.
    pub r_rel_deg_per_m: Option<f64>,
    /// The absolute trajectory error of snippets of five poses, in metres: the root mean square relative to the snippet's first pose,
    /// averaged over snippets. Unscaled.
    pub ate_m: Option<f64>,
    /// Median over pairs of frames of true / predicted displacement: 1 for a metric method.
    pub scale: Option<f64>,
    /// The lengths of the stretches: 100 to 800 m, or 10 to 50 m if no drive is long enough.
    pub lengths_m: Vec<u32>,
    /// Source of the true poses.
    pub truth: String,
    /// The five-pose error in SfMLearner's form (each snippet scaled, √(Σ e²)/5), for comparison with tables that use it.
    pub ate_scaled_m: Option<f64>,
    /// Root mean square over pairs of frames of the translation error, in metres.
    pub rpe_m: Option<f64>,
    /// Root mean square over pairs of frames of the rotation error, in degrees.
    pub rpe_deg: Option<f64>,
    /// Drift by length of the stretch.
    pub lengths: Vec<LengthRow>,
    /// Results of each drive.
    pub drives: Vec<TrackRow>,
}

/// Drift over the stretches of one length.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LengthRow {
    /// The nominal length, in metres.
    pub length_m: u32,
    /// Number of stretches.
    pub n: usize,
    /// Translation drift, in percent.
    pub t_rel_percent: f64,
    /// Rotation drift, in degrees per metre.
    pub r_rel_deg_per_m: f64,
}

/// Results of one drive, for stretches of the same lengths as in the whole report.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrackRow {
    /// Name of the drive.
    pub name: String,
    /// Number of poses.
    pub n: usize,
    /// Length of the true trajectory, in metres.
    pub distance_m: f64,
    /// Translation drift, in percent.
    pub t_rel_percent: Option<f64>,
    /// Rotation drift, in degrees per metre.
    pub r_rel_deg_per_m: Option<f64>,
    /// Absolute trajectory error of five poses, in metres.
    pub ate_m: Option<f64>,
    /// Median of true / predicted displacement.
    pub scale: Option<f64>,
}

impl OdometryReport {
    /// The report over all drives; `truth` names the source of the true poses.
    #[must_use]
    pub fn of(tracks: &[TrackPair], truth: impl Into<String>) -> Self {
        let segments = Segments::of(tracks);
        let local = Local::of(tracks);
        let (t_rel_percent, r_rel_deg_per_m) = drift(&segments, |_| true);
        let lengths: Vec<LengthRow> = segments
            .lengths_m
            .iter()
            .filter_map(|length| length_row(&segments, *length))
            .collect();
        Self {
            n: tracks.iter().map(|t| t.truth.len()).sum(),
            distance_m: tracks.iter().map(TrackPair::distance_m).sum(),
            t_rel_percent,
            r_rel_deg_per_m,
            ate_m: local.mean_ate_m(),
            scale: local.scale(),
            lengths_m: lengths.iter().map(|row| row.length_m).collect(),
            truth: truth.into(),
            ate_scaled_m: mean(&local.ate_scaled_m),
            rpe_m: root_mean_square(&local.pair_m),
            rpe_deg: root_mean_square(&local.pair_rad).map(f64::to_degrees),
            lengths,
            drives: tracks.iter().map(|t| track_row(t, &segments)).collect(),
        }
    }
}

fn track_row(track: &TrackPair, all: &Segments) -> TrackRow {
    let own = Segments::of(std::slice::from_ref(track));
    // A short drive beside a long one has no stretches of the long one's lengths.
    let same = own.lengths_m == all.lengths_m;
    let (t_rel_percent, r_rel_deg_per_m) = drift(&own, |_| same);
    let local = Local::of(std::slice::from_ref(track));
    TrackRow {
        name: track.name.clone(),
        n: track.truth.len(),
        distance_m: track.distance_m(),
        t_rel_percent,
        r_rel_deg_per_m,
        ate_m: local.mean_ate_m(),
        scale: local.scale(),
    }
}

fn length_row(segments: &Segments, length_m: u32) -> Option<LengthRow> {
    let (t_rel_percent, r_rel_deg_per_m) = drift(segments, |l| l == length_m);
    Some(LengthRow {
        length_m,
        n: segments
            .errors
            .iter()
            .filter(|e| e.length_m == length_m)
            .count(),
        t_rel_percent: t_rel_percent?,
        r_rel_deg_per_m: r_rel_deg_per_m?,
    })
}

/// Percent and degrees per metre: means over the stretches with the lengths `wanted`.
fn drift(segments: &Segments, wanted: impl Fn(u32) -> bool) -> (Option<f64>, Option<f64>) {
    let chosen: Vec<_> = segments
        .errors
        .iter()
        .filter(|e| wanted(e.length_m))
        .collect();
    let translations: Vec<f64> = chosen.iter().map(|e| 100.0 * e.translation).collect();
    let rotations: Vec<f64> = chosen
        .iter()
        .map(|e| e.rotation_radpm.to_degrees())
        .collect();
    (mean(&translations), mean(&rotations))
}

fn root_mean_square(values: &[f64]) -> Option<f64> {
    let squares: Vec<f64> = values.iter().map(|v| v * v).collect();
    mean(&squares).map(f64::sqrt)
}
