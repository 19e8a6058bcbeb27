//! Dynamic points from the radial velocities of a frequency-modulated LiDAR.
//!
//! A static point approaches as fast as the sensor moves towards it: v_r = −v·d̂, where v is the sensor's velocity
//! over ground and d̂ the ray. Most of a scan is static, so v follows from the scan itself by least squares. The
//! residual v_r + v·d̂ is the point's own speed along the ray.

use nalgebra::{Matrix3, Vector3};

/// Residuals below this are noise, m/s; larger ones get a smaller weight (Cauchy).
const NOISE_MPS: f64 = 0.15;
/// Points with a larger residual are dynamic, m/s.
const INLIER_MPS: f64 = 0.3;
/// Rounds of reweighting.
const ROUNDS: usize = 12;
/// Fewest points for an estimate.
const MIN_POINTS: usize = 30;
/// Most points used: all 10⁵ points of a scan give no better estimate than every tenth.
const MAX_POINTS: usize = 8000;

/// The sensor's own velocity, estimated from its scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DopplerEgo {
    /// Velocity over ground, in the sensor's axes, m/s.
    pub velocity: Vector3<f64>,
    /// Fraction of the points that agree with it.
    pub static_share: f64,
    /// Root mean square of the residuals of those points, m/s.
    pub rms_mps: f64,
}

/// The velocity of the sensor over ground by robust least squares of v_r = −v·d̂. `start` is the initial value, such as
/// the vehicle's velocity.
///
/// # Shapes
/// - `xyz`: points in the sensor's axes, metres; `radial`: one value per point, m/s, receding is positive
///
/// `None` for fewer than 30 usable points, or if the rays are too similar to determine three components (a component that no
/// ray shows is then taken from `start`, if given).
#[must_use]
pub fn ego_velocity(
    xyz: &[[f32; 3]],
    radial: &[f32],
    start: Option<Vector3<f64>>,
) -> Option<DopplerEgo> {
    let step = (xyz.len() / MAX_POINTS).max(1);
    let rays: Vec<(Vector3<f64>, f64)> = xyz
        .iter()
        .zip(radial)
        .step_by(step)
        .filter_map(|(point, radial)| ray(point).map(|d| (d, f64::from(*radial))))
        .filter(|(_, radial)| radial.is_finite())
        .collect();
    if rays.len() < MIN_POINTS {
        return None;
    }
    let prior = start.unwrap_or_default();
    // The pull towards the start must be negligible if none was given.
    let hold = if start.is_some() { 1e-3 } else { 1e-9 } * rays.len() as f64;
    let mut velocity = match start {
        Some(start) => start,
        None => median_start(&rays),
    };
    // From coarse to fine, so that a wrong start is overcome.
    for round in 0..ROUNDS {
        let scale = NOISE_MPS * 2.0_f64.powi((6 - round as i32).max(0));
        let (mut m, mut y) = (Matrix3::identity() * hold, prior * hold);
        for (d, radial) in &rays {
            let residual = (radial + velocity.dot(d)) / scale;
            let weight = 1.0 / (1.0 + residual * residual);
            m += weight * d * d.transpose();
            y -= weight * radial * d;
        }
        velocity = m.try_inverse()? * y;
    }
    let residuals = rays.iter().map(|(d, radial)| radial + velocity.dot(d));
    let inside: Vec<f64> = residuals.filter(|r| r.abs() < INLIER_MPS).collect();
    let square: f64 = inside.iter().map(|r| r * r).sum();
    Some(DopplerEgo {
        velocity,
        static_share: inside.len() as f64 / rays.len() as f64,
        rms_mps: (square / inside.len().max(1) as f64).sqrt(),
    })
}

/// An initial value from the rays nearest to straight ahead: the median of −v_r / cos.
fn median_start(rays: &[(Vector3<f64>, f64)]) -> Vector3<f64> {
    let mut speeds: Vec<f64> = rays
        .iter()
        .filter(|(d, _)| d.x > 0.5)
        .map(|(d, radial)| -radial / d.x)
        .collect();
    speeds.sort_by(f64::total_cmp);
    let forward = speeds.get(speeds.len() / 2).copied().unwrap_or_default();
    Vector3::new(forward, 0.0, 0.0)
}

/// Each point's own speed along its ray, v_r + v·d̂, m/s, receding is positive: 0 for static points. NaN for invalid
/// points or velocities.
#[must_use]
pub fn ground_radial(xyz: &[[f32; 3]], radial: &[f32], sensor_velocity: &Vector3<f64>) -> Vec<f32> {
    let own = |(point, radial): (&[f32; 3], &f32)| match ray(point) {
        Some(d) => radial + sensor_velocity.dot(&d) as f32,
        None => f32::NAN,
    };
    xyz.iter().zip(radial).map(own).collect()
}

fn ray(point: &[f32; 3]) -> Option<Vector3<f64>> {
    let point = Vector3::from(point.map(f64::from));
    let length = point.norm();
    (length.is_finite() && length > 0.1).then(|| point / length)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rays of a forward-looking scanner, some of whose points move.
    fn scan(velocity: Vector3<f64>, moving: f64) -> (Vec<[f32; 3]>, Vec<f32>) {
        let (mut xyz, mut radial) = (Vec::new(), Vec::new());
        for i in 0..3000 {
            let noise = |k: f64| ((i as f64 * k).sin() * 43758.5453).fract();
            let (azimuth, elevation) = (0.8 * noise(1.7), 0.12 * noise(2.3) - 0.03);
            let d = Vector3::new(azimuth.cos(), azimuth.sin(), elevation).normalize();
            let own = if (i as f64 / 3000.0) < moving {
                7.5
            } else {
                0.0
            };
            xyz.push((d * (15.0 + 10.0 * noise(3.1))).map(|x| x as f32).into());
            radial.push((own - velocity.dot(&d) + 0.05 * noise(5.9)) as f32);
        }
        (xyz, radial)
    }

    #[test]
    fn the_sensors_velocity_is_estimated_from_static_points() {
        let truth = Vector3::new(9.0, -0.4, 0.05);
        for moving in [0.0, 0.2, 0.4] {
            let (xyz, radial) = scan(truth, moving);
            for start in [None, Some(Vector3::new(8.0, 0.0, 0.0))] {
                let ego = ego_velocity(&xyz, &radial, start).unwrap();
                let error = (ego.velocity - truth).norm();
                assert!(error < 0.06, "{moving} {start:?}: {:?}", ego.velocity);
                assert!((ego.static_share - (1.0 - moving)).abs() < 0.03);
                let own = ground_radial(&xyz, &radial, &ego.velocity);
                let moved = own.iter().filter(|v| v.abs() > 0.5).count() as f64;
                assert!((moved / 3000.0 - moving).abs() < 0.01);
            }
        }
    }

    #[test]
    fn too_few_or_invalid_points_give_no_velocity() {
        assert!(ego_velocity(&[], &[], None).is_none());
        let (xyz, _) = scan(Vector3::x(), 0.0);
        assert!(ego_velocity(&xyz, &vec![f32::NAN; xyz.len()], None).is_none());
        let own = ground_radial(
            &[[0.0; 3], [f32::NAN, 1.0, 0.0]],
            &[1.0, 1.0],
            &Vector3::x(),
        );
        assert!(own.iter().all(|v| v.is_nan()));
    }
}
