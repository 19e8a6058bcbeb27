//! Fisheye lenses by Kannala and Brandt (IEEE TPAMI 28(8), 2006), with the four coefficients of `cv::fisheye`.

use nalgebra::Vector2;
use std::f64::consts::FRAC_PI_2;

/// Number of parts of the range up to 90 degrees in which the first angle that appears at a radius is searched.
const PARTS: u32 = 64;
/// Number of bisections of such a part, down to the last digit of a double.
const HALVINGS: u32 = 53;

/// The angle from the axis at which a ray at `theta` appears; both in radians.
fn shown(k: &[f64; 4], theta: f64) -> f64 {
    let t2 = theta * theta;
    theta * (1.0 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))))
}

/// Where a point with z = 1 appears.
pub(super) fn distort(k: &[f64; 4], ideal: &Vector2<f64>) -> Vector2<f64> {
    let r = ideal.norm();
    if r < 1e-12 {
        return *ideal;
    }
    ideal * (shown(k, r.atan()) / r)
}

/// The point with z = 1 that appears at this position. `None` for a ray at 90 degrees from the axis or more, which has no such point, and
/// for positions at which no ray appears.
pub(super) fn undistort(k: &[f64; 4], seen: &Vector2<f64>) -> Option<Vector2<f64>> {
    let radius = seen.norm();
    if radius < 1e-12 {
        return Some(*seen);
    }
    // The first angle that appears at this radius, before the polynomial turns back: a root beyond the fold is not physical.
    let (mut low, mut high) = (0.0, 0.0);
    for part in 1..=PARTS {
        high = FRAC_PI_2 * f64::from(part) / f64::from(PARTS);
        let at = shown(k, high);
        if at >= radius {
            break;
        }
        if at <= shown(k, low) || part == PARTS {
            return None;
        }
        low = high;
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if shown(k, middle) < radius {
            low = middle;
        } else {
            high = middle;
        }
    }
    let theta = 0.5 * (low + high);
    (theta < FRAC_PI_2 - 1e-6).then(|| seen * (theta.tan() / radius))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Up to 80 degrees from the axis, where tan θ magnifies an error of θ by 33. These coefficients do not turn back:
        /// the slope is 1 - 3·0.05·θ² - 5·0.01·θ⁴ - 7·0.003·θ⁶ - 9·0.001·θ⁸ > 0.1 for θ ≤ 1.4.
        #[test]
        fn undistortion_inverts_distortion(
            k1 in -0.05..0.2f64, k2 in -0.01..0.05f64, k3 in -0.003..0.01f64, k4 in -0.001..0.005f64,
            theta in 0.0..1.396f64, direction in 0.0..6.3f64,
        ) {
            let k = [k1, k2, k3, k4];
            let ideal = theta.tan() * Vector2::new(direction.cos(), direction.sin());
            let back = undistort(&k, &distort(&k, &ideal)).unwrap();
            prop_assert!((back - ideal).norm() < 1e-11, "{back} {ideal}");
        }

        #[test]
        fn any_input_terminates(k in proptest::array::uniform4(-5.0..5.0f64), x in -5.0..5.0f64, y in -5.0..5.0f64) {
            let seen = Vector2::new(x, y);
            if let Some(ideal) = undistort(&k, &seen) {
                // tan θ is steep near 90 degrees, where a double's last digit is 1e-4 of the point, but not of the angle.
                prop_assert!((distort(&k, &ideal) - seen).norm() < 1e-6);
            }
        }
    }

    #[test]
    fn behind_the_fold_and_beside_the_axis_there_is_no_point() {
        // θ - θ³ is 0.385 at most, at θ = 0.577.
        let fold = [-1.0, 0.0, 0.0, 0.0];
        assert!(undistort(&fold, &Vector2::new(0.3, 0.0)).is_some());
        assert_eq!(undistort(&fold, &Vector2::new(0.5, 0.0)), None);
        // Without coefficients, 1.6 is an angle beyond 90 degrees.
        assert_eq!(undistort(&[0.0; 4], &Vector2::new(0.0, 1.6)), None);
        assert_eq!(
            undistort(&[0.0; 4], &Vector2::zeros()),
            Some(Vector2::zeros())
        );
    }
}
