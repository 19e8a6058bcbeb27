use crate::{Error, ExpectedSetting as Expected, Result};
use serde::{Deserialize, Serialize};

/// Limits of ground, obstacles and targets, and the accuracy of depth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PerceptionConfig {
    /// Largest camera z that is used, in metres.
    pub max_depth_m: f32,
    /// Smallest height of an obstacle above the ground, in metres; kerbs are lower.
    pub min_height_m: f32,
    /// Height up to which pixels are joined into clusters, in metres. Things that hang higher, such as a tree's crown or a sign, would join
    /// the cars below them. If a cluster reaches this height, its box extends up to [`Self::max_target_height_m`].
    pub join_height_m: f32,
    /// Limits of a target's height, in metres.
    pub min_target_height_m: f32,
    /// See [`Self::min_target_height_m`].
    pub max_target_height_m: f32,
    /// Largest footprint of a target: length and width in metres.
    pub max_footprint_m: [f32; 2],
    /// Smallest number of pixels of a target in an image of 640×192; for other sizes in proportion to their area.
    pub min_pixels: f32,
    /// Smallest confidence of a reported target; tracks below it continue unreported.
    pub min_confidence: f64,
    /// Number of frames in which a target must have been seen before it is reported.
    pub confirm_frames: u32,
    /// Standard deviation of a disparity divided by the disparity: with 0.01 a depth of 30 m is accurate to 30 cm at each pixel. Exact
    /// depth: 0. It widens the gaps that a cluster may bridge.
    pub relative_error: f32,
    /// Jump of depth, as a share of the depth, beyond which a pixel between a near and a far surface is dropped ([`crate::flying_pixels`]);
    /// 0 keeps all pixels.
    pub edge_jump: f32,
    /// Largest distance of such a pixel from both surfaces, in pixels of an image 640 wide.
    pub edge_radius: f32,
    /// Steepest ground, rise over run, in the viewing direction.
    pub max_slope: f32,
    /// Limits of the camera's height above the ground, in metres.
    pub camera_height_m: [f32; 2],
    /// Largest angle between the camera's up and the ground's normal, in degrees.
    pub max_tilt_deg: f32,
    /// Whether rows of parked cars are completed, as in a car park: clearly visible cars show where the others stand, of which only a
    /// corner or a strip is visible. This needs the camera's poses, and remembers the cars already passed.
    pub parking_rows: bool,
}

impl PerceptionConfig {
    /// Settings for predicted depth: its edges bleed, and its error grows with depth.
    #[must_use]
    pub fn predicted() -> Self {
        Self {
            min_pixels: 100.0,
            min_confidence: 0.4,
            confirm_frames: 2,
            relative_error: 0.03,
            edge_jump: 0.025,
            ..Self::default()
        }
    }

    /// These settings with [`Self::parking_rows`]: the default of the commands and the Python package.
    #[must_use]
    pub fn with_parking_rows(self) -> Self {
        Self {
            parking_rows: true,
            ..self
        }
    }
}

impl PerceptionConfig {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`Error::Config`], naming the first invalid setting: a length, count or share that is negative or not finite, or a lower limit above
    /// its upper limit.
    pub fn validate(&self) -> Result<()> {
        let [camera_low, camera_high] = self.camera_height_m;
        let [length, width] = self.max_footprint_m;
        let above_zero = [
            ("max_depth_m", self.max_depth_m),
            ("join_height_m", self.join_height_m),
            ("max_target_height_m", self.max_target_height_m),
            ("max_footprint_m", length.min(width)),
            ("camera_height_m", camera_low),
        ];
        let from_zero = [
            ("min_height_m", self.min_height_m),
            ("min_target_height_m", self.min_target_height_m),
            ("min_pixels", self.min_pixels),
            ("min_confidence", self.min_confidence as f32),
            ("relative_error", self.relative_error),
            ("edge_jump", self.edge_jump),
            ("edge_radius", self.edge_radius),
            ("max_slope", self.max_slope),
            ("max_tilt_deg", self.max_tilt_deg),
        ];
        // Pairs of limits: the first may not be above the second.
        let ordered = [
            (
                "min_height_m",
                self.min_height_m,
                self.join_height_m,
                Expected::BelowSetting("join_height_m"),
            ),
            (
                "min_target_height_m",
                self.min_target_height_m,
                self.max_target_height_m,
                Expected::BelowSetting("max_target_height_m"),
            ),
            (
                "camera_height_m",
                camera_low,
                camera_high,
                Expected::LowerFirst,
            ),
            (
                "max_tilt_deg",
                self.max_tilt_deg,
                80.0,
                Expected::Below(80.0),
            ),
        ];
        let wrong = |field, value: f32, expected| {
            Err(Error::Config {
                field,
                value: f64::from(value),
                expected,
            })
        };
        for (field, value) in above_zero {
            if !(value.is_finite() && value > 0.0) {
                return wrong(field, value, Expected::AboveZero);
            }
        }
        for (field, value) in from_zero {
            if !(value.is_finite() && value >= 0.0) {
                return wrong(field, value, Expected::NotNegative);
            }
        }
        for (field, low, high, expected) in ordered {
            if low.is_nan() || high.is_nan() || low >= high {
                return wrong(field, low, expected);
            }
        }
        Ok(())
    }
}

/// Settings for exact depth.
impl Default for PerceptionConfig {
    fn default() -> Self {
        Self {
            max_depth_m: 60.0,
            min_height_m: 0.25,
            join_height_m: 2.6,
            min_target_height_m: 0.4,
            max_target_height_m: 4.5,
            max_footprint_m: [13.0, 3.5],
            min_pixels: 30.0,
            min_confidence: 0.2,
            confirm_frames: 1,
            relative_error: 0.0,
            edge_jump: 0.0,
            edge_radius: 3.0,
            max_slope: 0.2,
            camera_height_m: [0.3, 4.0],
            max_tilt_deg: 20.0,
            parking_rows: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_hint::Hint;

    #[test]
    fn invalid_settings_are_named() {
        assert!(PerceptionConfig::default().validate().is_ok());
        assert!(PerceptionConfig::predicted().validate().is_ok());
        let base = PerceptionConfig::default;
        let cases = [
            (
                "max_depth_m",
                PerceptionConfig {
                    max_depth_m: f32::NAN,
                    ..base()
                },
            ),
            (
                "min_height_m",
                PerceptionConfig {
                    min_height_m: 3.0,
                    ..base()
                },
            ),
            (
                "min_pixels",
                PerceptionConfig {
                    min_pixels: -1.0,
                    ..base()
                },
            ),
            (
                "camera_height_m",
                PerceptionConfig {
                    camera_height_m: [2.0, 1.0],
                    ..base()
                },
            ),
            (
                "max_tilt_deg",
                PerceptionConfig {
                    max_tilt_deg: 90.0,
                    ..base()
                },
            ),
        ];
        for (field, config) in cases {
            let error = config.validate().unwrap_err();
            assert!(
                error.to_string().starts_with(field) && error.hint().is_some(),
                "{error}"
            );
        }
    }

    #[test]
    fn expected_settings_as_text() {
        for (expected, text) in [
            (Expected::AboveZero, "a number above 0"),
            (Expected::NotNegative, "a number of at least 0"),
            (Expected::Below(80.0), "less than 80"),
            (
                Expected::BelowSetting("join_height_m"),
                "less than join_height_m",
            ),
            (Expected::LowerFirst, "the lower height first"),
        ] {
            assert_eq!(expected.to_string(), text);
        }
        let steep = PerceptionConfig {
            max_tilt_deg: 90.0,
            ..PerceptionConfig::default()
        };
        let error = steep.validate().unwrap_err();
        assert_eq!(
            error.to_string(),
            "max_tilt_deg is 90, expected less than 80"
        );
    }
}
