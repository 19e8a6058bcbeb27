//! Settings of an endless stream of views.

use super::draw::mix;
use super::ingredient::Ingredient;
use super::mounted::MountedCamera;
use crate::config::Scene;
use crate::error::{check, within};
use crate::{ExpectedSetting as Expected, Result};
use serde::{Deserialize, Serialize};

/// Settings of [`crate::Endless`]. Equal settings give equal views, byte for byte.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EndlessConfig {
    /// Seed of every world, camera, weather and image.
    pub seed: u64,
    /// Width of the pictures, in pixels.
    pub width: u32,
    /// Height of the pictures, in pixels.
    pub height: u32,
    /// Views taken of one world before the next one is built.
    pub views_per_world: usize,
    /// Number of worlds in use at a time: this many consecutive views are of different worlds.
    pub worlds_at_once: usize,
    /// Share of the views taken by a grey camera.
    pub grey: f64,
    /// Share of the views by daylight in the open; the rest are in rooms, in garages and at night.
    pub daylight: f64,
    /// Whether the camera's image formation (exposure, noise, blur, JPEG and so on) is applied. Without it the
    /// pictures are as [`crate::Simulation`]'s, in varied light.
    pub formation: bool,
    /// Share of the worlds, and of the views, that are as in [`crate::Simulation`]: only the camera varies, in plain weather and without
    /// image formation.
    pub plain: f64,
    /// Share of the varied views in the open whose road rises and falls ahead of the camera.
    pub hills: f64,
    /// Share of the varied views on streets, in parks and on country roads that have people, if there is room for them. They ride bicycles
    /// ahead of the camera and towards it, walk along pavements and cross the road.
    pub riders: f64,
    /// The scenes of the worlds, equally frequent. Empty: all scenes, streets most often, and `daylight` of them by day.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub scenes: Vec<Scene>,
    /// Ingredients that are left out of the varied views.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub without: Vec<Ingredient>,
    /// Cameras of known vehicles that take all views, equally frequent. A view is the camera's whole image, resized to the requested size.
    /// Empty: any camera.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub cameras: Vec<MountedCamera>,
}

impl Default for EndlessConfig {
    fn default() -> Self {
        Self {
            seed: 1,
            width: 640,
            height: 192,
            views_per_world: 24,
            worlds_at_once: 16,
            grey: 0.15,
            daylight: 0.8,
            formation: true,
            plain: 0.0,
            hills: 0.0,
            riders: 0.0,
            scenes: Vec::new(),
            without: Vec::new(),
            cameras: Vec::new(),
        }
    }
}

impl EndlessConfig {
    /// Checks every field.
    ///
    /// # Errors
    /// [`crate::Error::Config`] naming the first field out of range.
    pub fn validate(&self) -> Result<()> {
        within("width", f64::from(self.width), 16.0, 4096.0)?;
        within("height", f64::from(self.height), 16.0, 4096.0)?;
        within(
            "views_per_world",
            self.views_per_world as f64,
            1.0,
            100_000.0,
        )?;
        within("worlds_at_once", self.worlds_at_once as f64, 1.0, 256.0)?;
        for (field, share) in [
            ("grey", self.grey),
            ("daylight", self.daylight),
            ("plain", self.plain),
            ("hills", self.hills),
            ("riders", self.riders),
        ] {
            within(field, share, 0.0, 1.0)?;
        }
        let names = || {
            let names: Vec<&str> = self.scenes.iter().map(|scene| scene.name()).collect();
            names.join(", ")
        };
        check(
            self.scenes.is_empty() || self.plain == 0.0 || !self.plain_scenes().is_empty(),
            "scenes",
            names(),
            Expected::PlainScene,
        )?;
        check(
            !(self.on_cars() && self.is_indoors()),
            "scenes",
            names(),
            Expected::SceneForCars,
        )?;
        self.cameras.iter().try_for_each(MountedCamera::validate)
    }

    /// The scenes of the plain worlds.
    pub(super) fn plain_scenes(&self) -> Vec<Scene> {
        let meant = |scene: &Scene| self.scenes.is_empty() || self.scenes.contains(scene);
        Scene::ALL.into_iter().filter(meant).collect()
    }

    /// Whether all worlds are indoors.
    fn is_indoors(&self) -> bool {
        !self.scenes.is_empty() && self.scenes.iter().all(|scene| *scene == Scene::Indoor)
    }

    /// The camera of a view, if the cameras are given.
    pub(super) fn camera_of(&self, index: u64) -> Option<&MountedCamera> {
        let count = self.cameras.len() as u64;
        (count > 0).then(|| &self.cameras[(mix(self.seed ^ mix(index)) % count) as usize])
    }

    /// Whether every camera is on a car: cars do not drive through rooms.
    pub(super) fn on_cars(&self) -> bool {
        !self.cameras.is_empty() && self.cameras.iter().all(MountedCamera::is_on_a_car)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_bad_field_is_named() {
        let base = EndlessConfig::default;
        let bad = [
            (EndlessConfig { width: 8, ..base() }, "width"),
            (
                EndlessConfig {
                    height: 5000,
                    ..base()
                },
                "height",
            ),
            (
                EndlessConfig {
                    views_per_world: 0,
                    ..base()
                },
                "views_per_world",
            ),
            (
                EndlessConfig {
                    worlds_at_once: 300,
                    ..base()
                },
                "worlds_at_once",
            ),
            (
                EndlessConfig {
                    grey: 1.5,
                    ..base()
                },
                "grey",
            ),
            (
                EndlessConfig {
                    daylight: f64::NAN,
                    ..base()
                },
                "daylight",
            ),
            (
                EndlessConfig {
                    plain: -0.1,
                    ..base()
                },
                "plain",
            ),
            (
                EndlessConfig {
                    hills: 2.0,
                    ..base()
                },
                "hills",
            ),
            (
                EndlessConfig {
                    riders: -1.0,
                    ..base()
                },
                "riders",
            ),
        ];
        for (config, name) in bad {
            let error = config.validate().unwrap_err();
            assert!(error.to_string().contains(&format!("`{name}`")), "{error}");
        }
        assert!(base().validate().is_ok());
    }

    #[test]
    fn scenes_must_fit_the_other_settings() {
        let of = |scenes: &[Scene], plain| EndlessConfig {
            scenes: scenes.to_vec(),
            plain,
            ..EndlessConfig::default()
        };
        assert!(of(&[Scene::Indoor], 0.0).validate().is_ok());
        assert!(of(&[Scene::Indoor, Scene::Night], 0.5).validate().is_ok());
        let error = of(&[Scene::Indoor], 0.5).validate().unwrap_err();
        assert!(error.to_string().contains("`scenes`"), "{error}");
    }
}
