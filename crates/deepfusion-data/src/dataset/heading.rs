//! Where a camera looks against where its vehicle goes.
//!
//! Driving straight, everything in the images streams out of the point that the vehicle heads for. A camera that looks a degree below it
//! sees the road move as one would that is an eighth lower, so depth learned with the wrong direction comes out an eighth too near.

use deepfusion_geometry::Se3;
use nalgebra::{Vector2, Vector3};
use std::fmt;

/// Standard error of a heading that is sure enough to be taken, radians: a quarter of a degree.
const SURE: f64 = 0.0044;
/// A heading that is further off is another error, or no road vehicle's: ten degrees, in radians.
const MOST: f64 = 0.175;

/// By how much the direction of travel, as images show it, differs from what the mount says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Heading {
    /// Further up and to the right in the image, radians: a camera that looks down heads for a point above its middle.
    pub off: Vector2<f64>,
    /// Standard errors of both, radians.
    pub std_error: Vector2<f64>,
}

impl Heading {
    /// Whether it is known well enough to be taken for the mount's error: to a quarter of a degree, and at most ten degrees.
    #[must_use]
    pub fn is_sure(&self) -> bool {
        self.std_error.iter().all(|error| *error <= SURE) && self.off.norm() <= MOST
    }

    /// Turns a point of the camera as the mount has it into the camera as it is.
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
            "driving straight, its images show that it looks {:.1} ± {:.1} degrees {} and {:.1} ± {:.1} degrees {}, and that is taken",
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
    fn a_camera_that_looks_down_heads_up_in_its_image() {
        let degrees = |up: f64, right: f64| Heading {
            off: Vector2::new(up.to_radians(), right.to_radians()),
            std_error: Vector2::new(0.002, 0.001),
        };
        let ahead = degrees(2.0, -1.0).turn().rotate(&Vector3::z());
        assert!(ahead.y < -0.03 && ahead.x < -0.01, "up and left: {ahead}");
        let said = degrees(2.0, -1.0).to_string();
        assert!(said.contains("2.0 ± 0.1 degrees down and 1.0 ± 0.1 degrees to the right"));
        assert!(degrees(2.0, 1.0).is_sure() && !degrees(9.0, 9.0).is_sure());
        let vague = Heading {
            std_error: Vector2::new(0.02, 0.001),
            ..degrees(2.0, 1.0)
        };
        assert!(!vague.is_sure());
    }
}
