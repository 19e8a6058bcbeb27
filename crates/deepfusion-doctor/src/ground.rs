//! The road in the measured depth compared with the camera's mount: the direction of up, and the height.

use super::finding::{Figure, Limit, Outcome, Severity, median};
use super::reason::{CameraReason, RoadAngle};
use super::skip::CameraSkip;
use deepfusion_data::{Dataset, GtKind, PLAUSIBLE_HEIGHT_M};
use deepfusion_geometry::DepthMap;
use nalgebra::{Matrix3, Vector3};

/// Number of frames examined.
const MOST_FRAMES: usize = 8;
/// Where the road is searched for: metres ahead, metres to the side, metres below the camera.
const AHEAD_M: std::ops::Range<f64> = 3.0..18.0;
const ASIDE_M: f64 = 4.0;
const BELOW_M: std::ops::Range<f64> = 0.5..3.5;
const LEAST_POINTS: usize = 60;
/// How far the road has to be seen, metres along and across: anything shorter may be a car's roof or hood.
const LEAST_LENGTH_M: f64 = 5.0;
const LEAST_WIDTH_M: f64 = 2.5;
/// Frames that have to show it, and how far their angles may scatter about the median, as a share of the limit.
const LEAST_PLANES: usize = 4;
const MOST_SCATTER: f64 = 0.5;
/// Roughness of a road and noise of a scan, metres.
const NOISE_M: f64 = 0.04;
const ROUNDS: usize = 10;
/// How far up may differ, degrees: cars pitch, and roads are crowned (KITTI 0009's by 1.9 degrees of roll).
const MOST_PITCH_DEG: f64 = 2.0;
const MOST_TILT_DEG: f64 = 12.0;
const MOST_ROLL_DEG: f64 = 3.5;

pub(super) fn check(dataset: &Dataset) -> Outcome {
    let Some(mount) = dataset.cam_from_vehicle() else {
        return Outcome::skipped("ground", CameraSkip::NoMount);
    };
    let up = mount.rotate(&Vector3::z());
    let with_depth: Vec<usize> = (0..dataset.frames().len())
        .filter(|i| dataset.has_ground_truth(*i, GtKind::Z))
        .collect();
    let step = with_depth.len().div_ceil(MOST_FRAMES).max(1);
    let mut planes = Vec::new();
    for frame in with_depth.into_iter().step_by(step) {
        match dataset.ground_truth(frame, GtKind::Z) {
            Ok(Some(depth)) => {
                let points = points(dataset, frame, &depth);
                planes.extend(plane(&points, &up));
            }
            Ok(None) => {}
            Err(error) => {
                let mut outcome = Outcome::new("ground");
                let number = dataset.frames()[frame].number;
                let what = CameraReason::Depth(error.into());
                outcome.find(Severity::Warning, Some(number), what);
                return outcome;
            }
        }
    }
    // A plane turned by more is a wall or a car, not the road: a LiDAR that looks ahead sees little road.
    planes.retain(|(n, _)| n.angle(&up).to_degrees() <= MOST_TILT_DEG);
    if planes.len() < LEAST_PLANES {
        let why = CameraSkip::LittleRoad {
            frames: planes.len(),
            needed: LEAST_PLANES,
        };
        return Outcome::skipped("ground", why);
    }
    let pitch = |(n, _): &(Vector3<f64>, f64)| turns_deg(&up, n)[0];
    let roll = |(n, _): &(Vector3<f64>, f64)| turns_deg(&up, n)[1];
    // Road, kerb and objects on it give different planes from frame to frame; a wrong mount is off by the same angle in all.
    let pitches = Angle::of(planes.iter().map(pitch).collect());
    let rolls = Angle::of(planes.iter().map(roll).collect());
    if pitches.scatter > MOST_SCATTER * MOST_PITCH_DEG
        || rolls.scatter > MOST_SCATTER * MOST_ROLL_DEG
    {
        let why = CameraSkip::UnevenRoad {
            pitch_deg: pitches.scatter,
            roll_deg: rolls.scatter,
        };
        return Outcome::skipped("ground", why);
    }
    let height = median(planes.iter().map(|p| p.1).collect());
    let mut outcome = Outcome::new("ground");
    let angles = [
        (
            "pitch of the road against the mount",
            pitches.median,
            RoadAngle::Pitch,
            MOST_PITCH_DEG,
            1.0,
        ),
        (
            "roll of the road against the mount",
            rolls.median,
            RoadAngle::Roll,
            MOST_ROLL_DEG,
            -1.0,
        ),
    ];
    for (quantity, value, angle, most, sign) in angles {
        let figure = Figure::new(quantity, value, "degrees", Limit::Within(-most, most));
        outcome.judge(Severity::Warning, figure, || CameraReason::RoadTurned {
            frames: planes.len(),
            camera_by_deg: sign * value,
            angle,
        });
    }
    let limit = Limit::Within(*PLAUSIBLE_HEIGHT_M.start(), *PLAUSIBLE_HEIGHT_M.end());
    let figure = Figure::new("camera above the measured road", height, "m", limit);
    outcome.judge(Severity::Warning, figure, || {
        let height_m = height;
        CameraReason::Height { height_m }
    });
    outcome
}

/// Rotation from up according to the mount to up according to the road, degrees: about the camera's x (the camera looks further down
/// than its mount says) and z (it is turned anticlockwise, seen along its view).
fn turns_deg(by_mount: &Vector3<f64>, by_road: &Vector3<f64>) -> [f64; 2] {
    let turn = by_mount.cross(by_road);
    [turn.x, turn.z].map(|sine| sine.asin().to_degrees())
}

/// An angle over the frames, degrees.
struct Angle {
    median: f64,
    /// Median distance from the median.
    scatter: f64,
}

impl Angle {
    fn of(angles: Vec<f64>) -> Self {
        let middle = median(angles.clone());
        let scatter = median(angles.iter().map(|a| (a - middle).abs()).collect());
        Self {
            median: middle,
            scatter,
        }
    }
}

/// The measured points, in the camera's axes, metres.
fn points(dataset: &Dataset, frame: usize, depth: &DepthMap) -> Vec<Vector3<f64>> {
    let k = dataset.intrinsics(frame);
    let known = depth.data.iter().enumerate().filter(|(_, d)| **d > 0.0);
    let point = |(i, d): (usize, &f32)| {
        let (u, v) = (i % depth.width, i / depth.width);
        k.back_project(u as f64, v as f64, f64::from(*d))
    };
    known.map(point).collect()
}

/// The road's plane: its normal (up), and the camera's height above it. Robust least squares of n·X = −h, starting at the mount's
/// up and the most frequent height.
fn plane(points: &[Vector3<f64>], up: &Vector3<f64>) -> Option<(Vector3<f64>, f64)> {
    let near: Vec<&Vector3<f64>> = points
        .iter()
        .filter(|p| AHEAD_M.contains(&p.z) && p.x.abs() < ASIDE_M && BELOW_M.contains(&-up.dot(p)))
        .collect();
    if near.len() < LEAST_POINTS {
        return None;
    }
    // The road is the lowest height that many points share: kerbs and cars lie above it.
    let mut heights: Vec<f64> = near.iter().map(|p| -up.dot(p)).collect();
    heights.sort_by(f64::total_cmp);
    let start = heights[heights.len() * 7 / 10];
    let mut plane = up / start;
    for round in 0..ROUNDS {
        let scale = NOISE_M * 2.0_f64.powi((4 - round as i32).max(0));
        let height = 1.0 / plane.norm();
        let (mut m, mut y) = (Matrix3::zeros(), Vector3::zeros());
        for p in &near {
            let residual = (plane.dot(p) + 1.0) * height / scale;
            let weight = 1.0 / (1.0 + residual * residual).powi(2);
            m += weight * *p * p.transpose();
            y -= weight * *p;
        }
        plane = m.try_inverse()? * y;
    }
    let height = 1.0 / plane.norm();
    let inside: Vec<_> = near
        .iter()
        .filter(|p| ((plane.dot(p) + 1.0) * height).abs() < 3.0 * NOISE_M)
        .collect();
    let long = inner_range(inside.iter().map(|p| p.z).collect()) >= LEAST_LENGTH_M;
    let wide = inner_range(inside.iter().map(|p| p.x).collect()) >= LEAST_WIDTH_M;
    (inside.len() > LEAST_POINTS / 2 && long && wide).then(|| (plane * height, height))
}

/// The range that contains the middle nine tenths.
fn inner_range(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values[((values.len() - 1) as f64 * share) as usize];
    if values.is_empty() {
        0.0
    } else {
        at(0.95) - at(0.05)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tilted_road_is_measured() {
        let tilt = 3.0_f64.to_radians();
        let normal = Vector3::new(0.0, -tilt.cos(), tilt.sin());
        let mut points = Vec::new();
        for i in 0..600 {
            let noise = |k: f64| ((f64::from(i) * k).sin() * 43758.5453).fract();
            let (x, z) = (3.5 * noise(1.3), 9.0 + 6.0 * noise(2.1));
            // n·X = −h with h = 1.65.
            let y = (-1.65 - normal.x * x - normal.z * z) / normal.y;
            let car = if i % 5 == 0 { 0.6 } else { 0.0 };
            points.push(Vector3::new(x, y - car + 0.01 * noise(3.7), z));
        }
        let (n, height) = plane(&points, &-Vector3::y()).unwrap();
        assert!((n - normal).norm() < 0.004, "{n}");
        assert!((height - 1.65).abs() < 0.02, "{height}");
    }

    #[test]
    fn pitch_and_roll_have_the_right_sign() {
        let (sin, cos) = 3.0_f64.to_radians().sin_cos();
        let up = -Vector3::y();
        // Up along the right, lower and front sides of a camera that looks 3 degrees down, and of one that is turned clockwise.
        let (looks_down, clockwise) =
            (Vector3::new(0.0, -cos, -sin), Vector3::new(-sin, -cos, 0.0));
        let near = |found: [f64; 2], expected: [f64; 2]| {
            assert!((found[0] - expected[0]).abs() < 1e-9 && (found[1] - expected[1]).abs() < 1e-9);
        };
        near(turns_deg(&up, &looks_down), [3.0, 0.0]);
        near(turns_deg(&up, &clockwise), [0.0, -3.0]);
    }

    #[test]
    fn without_a_road_there_is_no_plane() {
        assert!(plane(&[], &-Vector3::y()).is_none());
        let wall: Vec<_> = (0..500)
            .map(|i| Vector3::new(0.0, -f64::from(i) * 0.01, 8.0))
            .collect();
        assert!(plane(&wall, &-Vector3::y()).is_none());
        // A roof is as flat as a road, and short.
        let roof: Vec<_> = (0..500)
            .map(|i| Vector3::new(f64::from(i % 20) * 0.08, 1.0, 9.0 + f64::from(i / 20) * 0.1))
            .collect();
        assert!(plane(&roof, &-Vector3::y()).is_none());
    }
}
