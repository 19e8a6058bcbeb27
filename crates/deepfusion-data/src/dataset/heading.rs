//! The camera's viewing direction relative to the vehicle's direction of travel.
//!
//! When driving straight, the optical flow expands from the point that the vehicle heads for. If a camera looks a degree below it,
//! the road moves in its images as for a camera mounted an eighth lower, so depth learned with the wrong direction is an eighth too small.

use deepfusion_geometry::Se3;
use nalgebra::{Vector2, Vector3};
use std::fmt;

/// Largest standard error of a heading that is used, radians: a quarter of a degree.
const MAX_STD_ERROR: f64 = 0.0044;
/// Largest offset of a heading that is used, radians: ten degrees. A larger one has another cause.
const MAX_OFFSET: f64 = 0.175;

/// Difference between the direction of travel in the images and that according to the mount.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Heading {
    /// Offset up and to the right in the image, radians. A camera that looks down heads for a point above the image centre.
    pub off: Vector2<f64>,
    /// Standard errors of both, radians.
    pub std_error: Vector2<f64>,
}

impl Heading {
    /// Whether it can be used to correct the mount: its standard errors are at most a quarter of a degree, and it is at most ten degrees.
    #[must_use]
    pub fn is_sure(&self) -> bool {
        self.std_error.iter().all(|error| *error <= MAX_STD_ERROR) && self.off.norm() <= MAX_OFFSET
    }

    /// The rotation from the camera according to the mount to the true camera.
    #[must_use]
    pub fn turn(&self) -> Se3 {
        Se3::from_axis_angle(Vector3::new(self.off.x, self.off.y, 0.0), Vector3::zeros())
    }
}

impl fmt::Display for Heading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (off, error) = (
            self.off.map(f64::to_degrees),
            self.std_error.map(f64::to_degrees),
        );
        let side = |off: f64, [more, less]: [&'static str; 2]| if off > 0.0 { more } else { less };
        write!(
            f,
            "according to its images when driving straight, it looks {:.1} ± {:.1} degrees {} and {:.1} ± {:.1} degrees {}, which is used",
            off.x.abs(),
            error.x,
            side(off.x, ["down", "up"]),
            off.y.abs(),
            error.y,
            side(off.y, ["to the left", "to the right"]),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_looking_down_heads_for_a_point_above_its_axis() {
        let degrees = |up: f64, right: f64| Heading {
            off: Vector2::new(up.to_radians(), right.to_radians()),
            std_error: Vector2::new(0.002, 0.001),
        };
        let ahead = degrees(2.0, -1.0).turn().rotate(&Vector3::z());
        assert!(ahead.y < -0.03 && ahead.x < -0.01, "up and left: {ahead}");
        let text = degrees(2.0, -1.0).to_string();
        assert!(text.contains("2.0 ± 0.1 degrees down and 1.0 ± 0.1 degrees to the right"));
        assert!(degrees(2.0, 1.0).is_sure() && !degrees(9.0, 9.0).is_sure());
        let uncertain = Heading {
            std_error: Vector2::new(0.02, 0.001),
            ..degrees(2.0, 1.0)
        };
        assert!(!uncertain.is_sure());
    }
}
