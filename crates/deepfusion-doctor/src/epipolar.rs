//! How the camera turned, and in which direction it moved, from the points that were followed.
//!
//! A point seen at (x, y) = K⁻¹ pixel by a camera that moves by t and turns by ω (both small, in the camera's
//! axes; `earlier_from_later` = (exp ω, t)) moves by
//!
//! (−t_x + x t_z, −t_y + y t_z) / Z + B(x, y) ω,  B = [[xy, −(1 + x²), y], [1 + y², −xy, −x]]
//!
//! (Longuet-Higgins and Prazdny 1980). Across its epipolar line, whose direction depends on t's direction
//! alone, only the turn moves it. For a given direction, ω follows by linear least squares, and the
//! direction with the smallest residuals is chosen (Bruss and Horn 1983).

mod agreement;
mod pitching;

use super::flow::Flow;
use super::survey::Survey;
use deepfusion_data::Ego;
use deepfusion_geometry::{Intrinsics, Se3};
use nalgebra::{Matrix2x3, Matrix3, Vector2, Vector3};
use rayon::prelude::*;

/// Fewer points do not determine a turn.
const LEAST_POINTS: usize = 12;
/// Residuals of well followed points, in pixels of the small image; larger residuals get less weight (Cauchy).
const NOISE_PX: f64 = 0.25;
const ROUNDS: usize = 4;
/// Usual turns of a car between two frames that its yaw rate does not show: pitch and roll, radians.
const USUAL_TILT: f64 = 0.006;

/// One pair's points in the camera's plane z = 1, and the motion that the vehicle measured.
#[derive(Debug, Clone)]
pub(crate) struct EpipolarPair {
    points: Vec<(Vector2<f64>, Vector2<f64>)>,
    noise: f64,
    /// Motion that the vehicle measured.
    pub(crate) earlier_from_later: Se3,
    pub(crate) dt_s: f64,
    /// The time halfway between the two images, in seconds on the frames' clock.
    pub(crate) middle_s: f64,
    pub(crate) speed_mps: f64,
}

/// What the points of a pair show for a given direction of travel.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Turn {
    /// Mean robust cost of a point: ½ ln(1 + (residual / noise)²).
    pub(crate) cost: f64,
    /// Median movement along the epipolar line, away from the point headed for: in units of f.
    pub(crate) parallax: f64,
}

/// Standard deviation assumed for the vehicle's yaw, radians a pair; infinite if it is not used.
#[derive(Debug, Clone, Copy)]
pub(crate) struct YawTrust(pub(crate) f64);

/// The pairs with points and a motion measured by the vehicle, with its turns.
pub(crate) fn pairs(survey: &Survey<'_>) -> Vec<EpipolarPair> {
    let k = &survey.intrinsics;
    let of = |pair: &super::survey::SeenPair| {
        let motion = pair.motion.as_ref()?;
        let later_s = survey.dataset.frames()[survey.frames[pair.later].index].time_s?;
        let times = (later_s - motion.dt_s, later_s);
        let found = EpipolarPair::new(&pair.flow, k, motion.source_from_target?, times)?;
        Some(EpipolarPair {
            speed_mps: motion.speed_mps,
            ..found
        })
    };
    survey.pairs.iter().filter_map(of).collect()
}

fn in_plane(k: &Intrinsics, flow: &Flow) -> (Vector2<f64>, Vector2<f64>) {
    let [u, v] = flow.at;
    let at = Vector2::new((u - k.cx) / k.fx, (v - k.cy) / k.fy);
    (at, Vector2::new(flow.by[0] / k.fx, flow.by[1] / k.fy))
}

impl EpipolarPair {
    /// Points that a camera followed between two times, and its motion according to the vehicle; `None` for too few points.
    pub(crate) fn new(
        followed: &[Flow],
        k: &Intrinsics,
        earlier_from_later: Se3,
        (from_s, to_s): (f64, f64),
    ) -> Option<Self> {
        let dt_s = to_s - from_s;
        (followed.len() >= LEAST_POINTS).then(|| Self {
            points: followed.iter().map(|f| in_plane(k, f)).collect(),
            noise: NOISE_PX / k.fx,
            earlier_from_later,
            dt_s,
            middle_s: 0.5 * (from_s + to_s),
            speed_mps: earlier_from_later.translation().norm() / dt_s,
        })
    }

    /// The same for a vehicle's clock that is this far ahead of the frames', so with the vehicle's motion at another time.
    /// `None` if its track does not reach that far.
    pub(crate) fn with_clock(&self, ego: &Ego<'_>, vehicle_ahead_s: f64) -> Option<Self> {
        let middle_s = self.middle_s + vehicle_ahead_s;
        let [from_s, to_s] = [-0.5, 0.5].map(|half| middle_s + half * self.dt_s);
        let vehicle = ego.vehicle_motion(from_s, to_s)?;
        Some(Self {
            earlier_from_later: vehicle.camera0_from_camera1(&ego.cam_from_vehicle),
            speed_mps: vehicle.distance_m.abs() / self.dt_s,
            ..self.clone()
        })
    }

    /// The turn that the points show if the camera moved along `direction`; `None` if they do not
    /// determine one.
    pub(crate) fn turn(&self, direction: &Vector3<f64>, yaw: YawTrust) -> Option<Turn> {
        let measured = self.earlier_from_later.axis_angle();
        let tilt = 1.0 / USUAL_TILT.powi(2);
        let hold = Vector3::new(tilt, 1.0 / yaw.0.powi(2), tilt);
        let rows: Vec<(Vector3<f64>, f64)> = self
            .points
            .iter()
            .filter_map(|(at, by)| {
                let along = along(at, direction)?;
                let across = Vector2::new(-along.y, along.x);
                Some((turning(at).transpose() * across, across.dot(by)))
            })
            .collect();
        let mut omega = measured;
        for _ in 0..ROUNDS {
            let mut m = Matrix3::from_diagonal(&hold);
            let mut y = hold.component_mul(&measured);
            for (row, moved) in &rows {
                let residual = (moved - row.dot(&omega)) / self.noise;
                let weight = 1.0 / (1.0 + residual * residual) / self.noise.powi(2);
                m += weight * row * row.transpose();
                y += weight * *moved * row;
            }
            omega = m.try_inverse()? * y;
        }
        let cost = rows
            .iter()
            .map(|(row, moved)| 0.5 * ((moved - row.dot(&omega)) / self.noise).powi(2).ln_1p());
        let cost = cost.sum::<f64>() / rows.len().max(1) as f64;
        let mut moved: Vec<f64> = self
            .points
            .iter()
            .filter_map(|(at, by)| Some(along(at, direction)?.dot(&(by - turning(at) * omega))))
            .collect();
        moved.sort_by(f64::total_cmp);
        Some(Turn {
            cost,
            parallax: moved.get(moved.len() / 2).copied()?,
        })
    }

    /// The direction of travel according to the vehicle, in the camera's axes, of length 1.
    pub(crate) fn direction(&self) -> Option<Vector3<f64>> {
        self.earlier_from_later.translation().try_normalize(1e-6)
    }

    /// Yaw rate according to the vehicle, rad/s, positive to the left. Its axis in the camera is y, except for the mount's tilt.
    pub(crate) fn vehicle_yaw_rate(&self) -> f64 {
        -self.earlier_from_later.axis_angle().y / self.dt_s
    }
}

/// The matrix B of the module's equation.
fn turning(at: &Vector2<f64>) -> Matrix2x3<f64> {
    let (x, y) = (at.x, at.y);
    Matrix2x3::new(x * y, -(1.0 + x * x), y, 1.0 + y * y, -x * y, -x)
}

/// Direction of the epipolar line, in which a point moves; `None` at the point headed for.
fn along(at: &Vector2<f64>, t: &Vector3<f64>) -> Option<Vector2<f64>> {
    headed_past(at, t).try_normalize(0.02)
}

/// From the point headed for to a point.
fn headed_past(at: &Vector2<f64>, t: &Vector3<f64>) -> Vector2<f64> {
    Vector2::new(at.x * t.z - t.x, at.y * t.z - t.y)
}

/// By how much the direction of travel differs from the mount's: about the camera's x (up is
/// positive) and y (right is positive), radians, where the pairs' cost is lowest.
pub(crate) fn heading_error(pairs: &[&EpipolarPair], yaw: YawTrust) -> Vector2<f64> {
    /// Steps of the search, degrees: from the first to the second, halved each time.
    const STEPS: (f64, f64) = (4.0, 0.04);
    let cost = |error: Vector2<f64>| -> f64 {
        let of = |pair: &&EpipolarPair| {
            let direction = turned(&pair.direction()?, error);
            Some(pair.turn(&direction, yaw)?.cost)
        };
        pairs.par_iter().filter_map(of).sum()
    };
    let mut best = Vector2::zeros();
    let mut least = cost(best);
    let mut step = STEPS.0.to_radians();
    while step >= STEPS.1.to_radians() {
        let around = [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)];
        let next = around
            .map(|(x, y)| best + Vector2::new(x, y) * step)
            .map(|error| (error, cost(error)));
        let lower = next.iter().min_by(|a, b| a.1.total_cmp(&b.1));
        match lower {
            // 0.4 rad off cannot be a direction of travel.
            Some((error, cost)) if *cost < least && error.norm() < 0.4 => {
                (best, least) = (*error, *cost);
            }
            _ => step *= 0.5,
        }
    }
    best
}

/// A direction turned up by the first angle and to the right by the second, radians.
pub(crate) fn turned(direction: &Vector3<f64>, error: Vector2<f64>) -> Vector3<f64> {
    let turn = Se3::from_axis_angle(Vector3::new(error.x, error.y, 0.0), Vector3::zeros());
    turn.rotate(direction)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Points of a scene before a camera that moves by `t` and turns by `omega` in a tenth of a second.
    pub(crate) fn pair(t: Vector3<f64>, omega: Vector3<f64>, measured: Se3) -> EpipolarPair {
        let later_from_earlier = Se3::exp(omega, Vector3::zeros());
        let later_from_earlier = Se3::from_axis_angle(later_from_earlier.axis_angle(), t).inverse();
        let points = (0..150).map(|i| {
            let noise = |k: f64| ((f64::from(i) * k).sin() * 43758.5453).fract();
            let z = 14.0 + 9.0 * noise(2.7);
            let point = Vector3::new(0.7 * z * noise(1.3), 0.25 * z * noise(1.9), z);
            let moved = later_from_earlier.transform(&point);
            let at = point.xy() / point.z;
            (at, moved.xy() / moved.z - at)
        });
        EpipolarPair {
            points: points.collect(),
            noise: NOISE_PX / 200.0,
            earlier_from_later: measured,
            dt_s: 0.1,
            middle_s: 0.0,
            speed_mps: 10.0,
        }
    }

    #[test]
    fn a_wrong_direction_of_travel_is_found() {
        let off = Vector2::new(0.05, -0.03);
        let t = turned(&Vector3::z(), off);
        let omega = Vector3::new(0.002, 0.004, -0.001);
        let measured = Se3::from_axis_angle(Vector3::new(0.0, 0.004, 0.0), Vector3::z());
        let pairs: Vec<_> = (0..4).map(|_| pair(t, omega, measured)).collect();
        let pairs: Vec<_> = pairs.iter().collect();
        let found = heading_error(&pairs, YawTrust(0.001));
        assert!((found - off).norm() < 0.006, "{found}");
    }

    #[test]
    fn points_move_away_from_the_point_headed_for() {
        let measured = Se3::from_axis_angle(Vector3::zeros(), Vector3::z());
        let pair = pair(Vector3::z(), Vector3::new(0.003, 0.02, -0.002), measured);
        let turn = pair.turn(&Vector3::z(), YawTrust(f64::INFINITY)).unwrap();
        assert!(turn.parallax > 0.0);
    }
}
