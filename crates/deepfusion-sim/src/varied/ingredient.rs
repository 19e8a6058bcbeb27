//! The ingredients that make the views varied. Each can be left out, so that a table can show its effect.

use super::camera::Lens;
use super::weather::{self, Weather};
use crate::config::Scene;
use crate::primitive::V3;
use crate::render::Air;
use crate::rig::{CAMERA_HEIGHT, kitti_like_intrinsics};
use crate::scene::{Variety, World};
use crate::{Error, ExpectedSetting, Result};
use serde::{Deserialize, Serialize};

/// One ingredient of the varied views. If it is left out ([`crate::EndlessConfig::without`]), its part of a view is as in
/// [`crate::Simulation`], and everything else that is drawn for the view stays the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Ingredient {
    /// Cameras at any height; without it all are 1.65 m above the ground.
    CameraHeight,
    /// Cameras that pitch and roll; without it all are level.
    CameraTilt,
    /// Lenses with any field of view, an off-centre principal point, and pixels that are not quite square. Without it the horizontal field
    /// of view is KITTI's, 81°, with the principal point in the middle.
    Lenses,
    /// Pictures with another aspect ratio that were squeezed to the requested size; without it none is.
    Squeeze,
    /// The weather, and the sun's position; without it a clear sky by day, and the plain light of night, garage and room.
    Weather,
    /// Worlds whose materials, plants, people and layout are random; without it those of [`Variety::none`]. Country roads then become
    /// parks, motorways streets, and rooms garages, since these have no plain version.
    Variety,
    /// Dynamic objects; without it there are none.
    Traffic,
}

impl Ingredient {
    /// All ingredients.
    pub const ALL: [Self; 7] = [
        Self::CameraHeight,
        Self::CameraTilt,
        Self::Lenses,
        Self::Squeeze,
        Self::Weather,
        Self::Variety,
        Self::Traffic,
    ];

    /// Its name in configuration files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::CameraHeight => "camera-height",
            Self::CameraTilt => "camera-tilt",
            Self::Lenses => "lenses",
            Self::Squeeze => "squeeze",
            Self::Weather => "weather",
            Self::Variety => "variety",
            Self::Traffic => "traffic",
        }
    }
}

impl std::str::FromStr for Ingredient {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        let found = Self::ALL.into_iter().find(|one| one.name() == name);
        found.ok_or_else(|| Error::Config {
            field: "without",
            value: name.to_owned(),
            expected: ExpectedSetting::OneOf(Self::ALL.map(Self::name).to_vec()),
        })
    }
}

/// Replaces the drawn value of each ingredient that is left out by the simulator's own. The value is drawn all the same, so that the rest
/// of a view does not change.
#[derive(Clone, Copy)]
pub(super) struct Without<'a>(pub &'a [Ingredient]);

impl Without<'_> {
    fn has(self, ingredient: Ingredient) -> bool {
        !self.0.contains(&ingredient)
    }

    /// The camera's height above its ground, metres.
    pub(super) fn height(self, drawn: f64) -> f64 {
        if self.has(Ingredient::CameraHeight) {
            drawn
        } else {
            CAMERA_HEIGHT
        }
    }

    /// The camera's pitch and roll, radians.
    pub(super) fn tilt(self, drawn: (f64, f64)) -> (f64, f64) {
        if self.has(Ingredient::CameraTilt) {
            drawn
        } else {
            (0.0, 0.0)
        }
    }

    /// The camera's lens, and the squeeze of its picture.
    pub(super) fn lens(self, drawn: Lens) -> Lens {
        let squeeze = if self.has(Ingredient::Squeeze) {
            drawn.squeeze
        } else {
            1.0
        };
        if self.has(Ingredient::Lenses) {
            return Lens { squeeze, ..drawn };
        }
        let kitti = kitti_like_intrinsics(1000, 300);
        Lens {
            field: 2.0 * (500.0 / kitti.fx).atan(),
            unequal: 0.0,
            squeeze,
            column: 0.0,
            row: 0.0,
        }
    }

    /// The time of day and the weather.
    pub(super) fn weather(self, drawn: (Weather, Air), world: &World) -> (Weather, Air) {
        if self.has(Ingredient::Weather) {
            drawn
        } else {
            (weather::plain(world), Air::of(world))
        }
    }

    /// Direction towards the sun; `plain` is that of the world.
    pub(super) fn sun(self, drawn: V3, plain: V3) -> V3 {
        if self.has(Ingredient::Weather) {
            drawn
        } else {
            plain
        }
    }

    /// The kind of scene.
    pub(super) fn scene(self, drawn: Scene) -> Scene {
        match drawn {
            _ if self.has(Ingredient::Variety) => drawn,
            Scene::Country => Scene::Park,
            Scene::Motorway => Scene::Urban,
            Scene::Indoor => Scene::Garage,
            plain => plain,
        }
    }

    /// The variety of a world.
    pub(super) fn variety(self, drawn: Variety) -> Variety {
        if self.has(Ingredient::Variety) {
            drawn
        } else {
            Variety::none()
        }
    }

    /// Whether there are dynamic objects.
    pub(super) fn moves(self) -> bool {
        self.has(Ingredient::Traffic)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_parse_and_an_unknown_one_lists_all() {
        for one in Ingredient::ALL {
            assert_eq!(one.name().parse::<Ingredient>().ok(), Some(one));
            let error = "salt".parse::<Ingredient>().unwrap_err().to_string();
            assert!(error.contains(one.name()) && error.contains("salt"));
        }
    }

    #[test]
    fn a_kitti_lens_has_the_same_field_of_view_at_any_size() {
        let lens = Lens {
            field: 1.0,
            unequal: 0.01,
            squeeze: 0.7,
            column: 0.01,
            row: 0.1,
        };
        let without = [Ingredient::Lenses];
        let kept = Without(&without).lens(lens);
        assert!((kept.field.to_degrees() - 81.4).abs() < 0.1 && kept.squeeze == 0.7);
        let without = [Ingredient::Lenses, Ingredient::Squeeze];
        let k = Without(&without).lens(lens).intrinsics((320, 96));
        assert!(k.fx == k.fy && k.cx == 159.5 && k.cy == 47.5);
    }
}
