//! The camera assumed for recordings that do not state theirs.

use deepfusion_geometry::{HFOV_DEG, Intrinsics};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{Error, ExpectedSetting, TrainConfig};

/// The camera of recordings that do not state theirs, and whether its focal length is learned: a last resort. Absent: such recordings are
/// an error. The principal point is, and stays, in the middle of the images.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AssumedCamera {
    /// Field of view along the images' longer side, in degrees; if it is learned, the value to start from.
    pub hfov_deg: f64,
    /// fy/fx, which is not learned; 1 for square pixels, which nearly every camera has. Turns to the side say nothing about fy.
    pub aspect: f64,
    /// Whether to learn the focal length with the networks, from the photometric error of the warped images.
    pub learn: bool,
    /// Adam's learning rate for ln f: the largest relative change per step. It follows the run's schedule.
    pub learning_rate: f64,
}

/// The narrowest and the widest field of view that is learned, along the longer side: no lens without a calibration is narrower or wider.
const LEARNED_HFOV_DEG: [f64; 2] = [10.0, 160.0];

impl Default for AssumedCamera {
    fn default() -> Self {
        Self {
            hfov_deg: 60.0,
            aspect: 1.0,
            learn: true,
            learning_rate: 0.005,
        }
    }
}

impl AssumedCamera {
    /// The fixed assumed camera that is as wide as a learned one.
    #[must_use]
    pub fn fixed(k: &Intrinsics) -> Self {
        let half = f64::from(k.width.max(k.height)) / 2.0 / k.fx;
        Self {
            hfov_deg: 2.0 * half.atan().to_degrees(),
            aspect: k.fy / k.fx,
            learn: false,
            ..Self::default()
        }
    }

    /// The camera for images of the given size; only its field of view along the longer side is used.
    #[must_use]
    pub fn intrinsics(&self) -> Intrinsics {
        let square = Intrinsics::from_hfov(self.hfov_deg, (1024, 768));
        Intrinsics {
            fy: square.fy * self.aspect,
            ..square
        }
    }

    /// Limits of a learned focal length, as multiples of the assumed one: fields of view of 10 and 160 degrees.
    #[must_use]
    pub fn ratios(&self) -> (f64, f64) {
        let half = |degrees: f64| (degrees / 2.0).to_radians().tan();
        let [most, least] = LEARNED_HFOV_DEG.map(|degrees| half(self.hfov_deg) / half(degrees));
        (least.min(1.0), most.max(1.0))
    }

    /// # Errors
    /// [`Error::Config`] naming the first invalid value.
    pub(crate) fn validate(&self) -> Result<(), Error> {
        let fail = |field, expected: ExpectedSetting, found: f64| {
            Err(Error::config(field, expected, found.to_string()))
        };
        let (least, most) = HFOV_DEG;
        if !(self.hfov_deg > least && self.hfov_deg < most) {
            let expected = ExpectedSetting::Degrees {
                above: least,
                below: most,
            };
            return fail("assumed_camera.hfov_deg", expected, self.hfov_deg);
        }
        if !(0.2..=5.0).contains(&self.aspect) {
            let expected = ExpectedSetting::Within { from: 0.2, to: 5.0 };
            return fail("assumed_camera.aspect", expected, self.aspect);
        }
        let rate = self.learning_rate;
        if !(rate > 0.0 && rate <= 0.1) {
            let expected = ExpectedSetting::AboveZeroUpTo(0.1);
            return fail("assumed_camera.learning_rate", expected, rate);
        }
        Ok(())
    }
}

/// The focal length that a run learned for its assumed camera.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LearnedCamera {
    /// fx and fy in pixels of the run's images.
    pub focal_px: [f64; 2],
    /// One standard deviation of each, in pixels: how far parts of the drives disagree, and how far the loss is from its minimum. Absent if
    /// the drives do not determine the focal length.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_px: Option<[f64; 2]>,
    /// The step after which it had this value.
    pub step: usize,
}

/// Relative standard deviation of the focal length above which a learned camera is not reliable.
const MOST_SIGMA_SHARE: f64 = 0.1;

impl LearnedCamera {
    /// Whether the drives determined the focal length to within 10 %.
    #[must_use]
    pub fn is_reliable(&self) -> bool {
        let sure = |(sigma, focal): (&f64, &f64)| *sigma <= MOST_SIGMA_SHARE * focal;
        self.sigma_px
            .is_some_and(|sigmas| sigmas.iter().zip(&self.focal_px).all(sure))
    }
}

impl TrainConfig {
    /// The camera that a run has learned, for images of the given size, from a checkpoint's f/f₀ ([`crate::Checkpoint::focal_ratio`]).
    /// `None` if the run learns none.
    #[must_use]
    pub fn camera_learned(&self, ratio: f64, size: (u32, u32)) -> Option<Intrinsics> {
        let assumed = self.learned_camera()?.intrinsics().centred_at(size);
        Some(Intrinsics {
            fx: assumed.fx * ratio,
            fy: assumed.fy * ratio,
            ..assumed
        })
    }

    /// The assumed camera, if the run learns it.
    #[must_use]
    pub fn learned_camera(&self) -> Option<&AssumedCamera> {
        self.assumed_camera.as_ref().filter(|camera| camera.learn)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Preset;

    #[test]
    fn a_learned_camera_can_be_fixed() {
        let camera = Intrinsics {
            fx: 400.0,
            fy: 420.0,
            cx: 319.5,
            cy: 95.5,
            width: 640,
            height: 192,
        };
        let fixed = AssumedCamera::fixed(&camera);
        assert!(!fixed.learn);
        let again = fixed.intrinsics();
        let scale = 640.0 / f64::from(again.width);
        assert!((again.fx * scale - 400.0).abs() < 1e-9, "{again:?}");
        assert!((again.fy * scale - 420.0).abs() < 1e-9, "{again:?}");
    }

    #[test]
    fn the_limits_of_a_learned_camera_are_valid_cameras() {
        for hfov_deg in [5.0, 60.0, 165.0] {
            let camera = AssumedCamera {
                hfov_deg,
                ..AssumedCamera::default()
            };
            let (least, most) = camera.ratios();
            assert!(least <= 1.0 && most >= 1.0, "{hfov_deg}: {least} {most}");
            let k = camera.intrinsics();
            for ratio in [least, most] {
                let learned = Intrinsics {
                    fx: k.fx * ratio,
                    ..k
                };
                let view = AssumedCamera::fixed(&learned).hfov_deg;
                let (from, to) = (hfov_deg.min(10.0), hfov_deg.max(160.0));
                assert!((from - 1e-9..=to + 1e-9).contains(&view), "{view}");
            }
        }
    }

    #[test]
    fn invalid_cameras_are_refused() {
        let mut config = Preset::Tiny.config();
        assert!(!config.to_toml().unwrap().contains("assumed_camera"));
        config.set("assumed_camera.hfov_deg=75").unwrap();
        assert_eq!(config.learned_camera().map(|c| c.hfov_deg), Some(75.0));
        config.validate().unwrap();
        for (assignment, field) in [
            ("assumed_camera.hfov_deg=200", "assumed_camera.hfov_deg"),
            ("assumed_camera.aspect=0", "assumed_camera.aspect"),
            (
                "assumed_camera.learning_rate=1",
                "assumed_camera.learning_rate",
            ),
        ] {
            let mut wrong = config.clone();
            wrong.set(assignment).unwrap();
            let error = wrong.validate().unwrap_err().to_string();
            assert!(error.contains(field), "{error}");
        }
    }
}
