//! Cameras of known vehicles: every view has the lens and the height of a camera that the network is meant for.

use super::camera::HEIGHTS;
use super::draw::normal;
use crate::{Error, ExpectedSetting as Expected, Result};
use deepfusion_geometry::Intrinsics;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// Standard deviations of height (share), pitch and roll (degrees): the vehicle moves on its springs, and a mounting is known to about a
/// degree.
const SPRINGS: (f64, f64, f64) = (0.012, 0.8, 0.6);

/// Lower cameras are on robots, which also go where cars do not, metres.
const LEAST_ON_CARS: f64 = 0.9;

/// Greatest pitch and roll of a mounting, degrees.
const MOST_TILT: f64 = 30.0;

/// A camera mounted on a vehicle or a robot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MountedCamera {
    /// Its intrinsics, in pixels of its own image, which may have any size and aspect ratio: a view shows the whole of it.
    pub intrinsics: Intrinsics,
    /// Height above the ground, metres; `None`: any height of cameras on cars.
    pub height_m: Option<f64>,
    /// Pitch downwards, degrees.
    pub pitch_degrees: f64,
    /// Roll about its axis, clockwise in the viewing direction, degrees.
    pub roll_degrees: f64,
}

impl MountedCamera {
    /// A level camera.
    #[must_use]
    pub fn level(intrinsics: Intrinsics, height_m: Option<f64>) -> Self {
        Self {
            intrinsics,
            height_m,
            pitch_degrees: 0.0,
            roll_degrees: 0.0,
        }
    }

    /// Checks every field.
    pub(super) fn validate(&self) -> Result<()> {
        let bad = |field, value: String, expected| {
            Err(Error::Config {
                field,
                value,
                expected,
            })
        };
        if let Some(why) = self.intrinsics.implausible() {
            return bad("cameras.intrinsics", why.to_string(), Expected::Lens);
        }
        if let Some(height) = self.height_m
            && !(HEIGHTS.0..=HEIGHTS.1).contains(&height)
        {
            let (from, to) = HEIGHTS;
            let value = height.to_string();
            return bad("cameras.height_m", value, Expected::Metres { from, to });
        }
        for (field, angle) in [
            ("cameras.pitch_degrees", self.pitch_degrees),
            ("cameras.roll_degrees", self.roll_degrees),
        ] {
            if !(-MOST_TILT..=MOST_TILT).contains(&angle) {
                let (from, to) = (-MOST_TILT, MOST_TILT);
                return bad(field, angle.to_string(), Expected::Degrees { from, to });
            }
        }
        Ok(())
    }

    /// Whether it is high enough for a car, which drives on roads only.
    pub(super) fn is_on_a_car(&self) -> bool {
        self.height_m.is_none_or(|height| height >= LEAST_ON_CARS)
    }

    /// Height above the ground, metres, pitch and roll, radians, as the vehicle moves on its springs. `drawn` is the height that is used if
    /// the camera's own is unknown.
    pub(super) fn pose(&self, rng: &mut ChaCha8Rng, drawn: f64) -> (f64, f64, f64) {
        let (height, pitch, roll) = SPRINGS;
        let height = self.height_m.unwrap_or(drawn) * normal(rng, 1.0, height, 2.5);
        let pitch = normal(rng, self.pitch_degrees, pitch, 2.5);
        let roll = normal(rng, self.roll_degrees, roll, 2.5);
        (height, pitch.to_radians(), roll.to_radians())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::varied::draw::generator;

    fn kitti() -> MountedCamera {
        let k = Intrinsics::from_numbers([721.5, 721.5, 609.6, 172.9], (1242, 375));
        MountedCamera::level(k, Some(1.65))
    }

    #[test]
    fn a_pose_varies_only_as_the_springs_allow() {
        let camera = MountedCamera {
            pitch_degrees: 3.0,
            ..kitti()
        };
        let mut rng = generator(1, 1, 1);
        let poses: Vec<_> = (0..2000).map(|_| camera.pose(&mut rng, 1.0)).collect();
        let mean = |of: fn(&(f64, f64, f64)) -> f64| poses.iter().map(of).sum::<f64>() / 2000.0;
        assert!((mean(|p| p.0) - 1.65).abs() < 2e-3);
        assert!((mean(|p| p.1).to_degrees() - 3.0).abs() < 0.05);
        assert!(mean(|p| p.2).to_degrees().abs() < 0.05);
        assert!(poses.iter().all(|p| (p.0 / 1.65 - 1.0).abs() < 0.031));
        let unknown = MountedCamera::level(camera.intrinsics, None);
        assert!((unknown.pose(&mut rng, 1.5).0 / 1.5 - 1.0).abs() < 0.031);
    }

    #[test]
    fn invalid_mountings_are_named() {
        let broken = |change: fn(&mut MountedCamera)| {
            let mut camera = kitti();
            change(&mut camera);
            camera.validate().unwrap_err().to_string()
        };
        assert!(kitti().validate().is_ok());
        assert!(broken(|c| c.intrinsics.fx = -1.0).contains("`cameras.intrinsics`"));
        assert!(broken(|c| c.height_m = Some(20.0)).contains("`cameras.height_m`"));
        assert!(broken(|c| c.height_m = Some(f64::NAN)).contains("`cameras.height_m`"));
        assert!(broken(|c| c.pitch_degrees = f64::NAN).contains("`cameras.pitch_degrees`"));
        assert!(broken(|c| c.roll_degrees = 90.0).contains("`cameras.roll_degrees`"));
    }
}
