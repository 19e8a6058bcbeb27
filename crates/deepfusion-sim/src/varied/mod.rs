//! The endless mode: views of ever new streets by ever new cameras, as training data for depth networks. Also drives (`drive`) with such a
//! camera, light and weather.
//!
//! A view depends on the settings and its index alone, so loaders may request any view, from any thread, in any order. The depth is exact,
//! whatever is done to the colours.

mod built_world;
mod cache;
mod camera;
mod config;
mod digits;
mod draw;
mod drive;
mod formation;
mod hills;
mod ingredient;
mod mounted;
mod riders;
mod schedule;
mod weather;
mod wet;

use crate::Result;
use crate::config::Scene;
use crate::render::{self, Air, Cores, Edges, RenderInput};
use crate::riders::Riders;
use built_world::BuiltWorld;
use cache::Cache;
use camera::Mount;
pub use config::EndlessConfig;
use deepfusion_geometry::{DepthMap, Intrinsics, Se3};
use draw::generator;
pub(crate) use drive::DriveLook;
pub use drive::{DrawnDrive, DrawnLight};
use formation::{Brightness, Formation};
use image::RgbImage;
pub use ingredient::Ingredient;
use ingredient::Without;
pub use mounted::MountedCamera;
use rand::Rng;
use schedule::Schedule;
pub use weather::Weather;

/// Worlds kept beyond those in use, for threads that are ahead of or behind the others.
const SPARE_WORLDS: usize = 6;

/// One view, with its ground truth.
#[derive(Debug, Clone)]
pub struct View {
    /// H×W 8-bit RGB; the three channels are equal if the camera is grey.
    pub rgb: RgbImage,
    /// Exact camera z of each pixel's centre, metres; 0 = sky.
    pub depth: DepthMap,
    /// The camera, in pixels of the picture.
    pub intrinsics: Intrinsics,
    /// H·W flags, row by row: the pixel's centre is on a dynamic object.
    pub moving: Vec<bool>,
    /// Camera (x right, y down, z forward) to world (z up), metres.
    pub world_from_cam: Se3,
    /// Number of the world; views with the same number are of the same world.
    pub world: u64,
    /// The kind of scene.
    pub scene: Scene,
    /// The weather.
    pub weather: Weather,
    /// Height of the camera above the ground below it, metres.
    pub height_m: f64,
    /// Whether the camera is grey.
    pub grey: bool,
    /// Whether the road rises or falls ahead of the camera. Only the ground at the camera is then level and at the world's z = 0.
    pub hills: bool,
    /// Number of people who ride and walk around the camera.
    pub riders: usize,
}

/// An endless stream of views.
///
/// `W = worlds_at_once` worlds are in use at a time, and consecutive views are of different worlds. At most `W + 6` built worlds are kept,
/// of about 2 MB each.
pub struct Endless {
    config: EndlessConfig,
    schedule: Schedule,
    worlds: Cache<BuiltWorld>,
}

impl Endless {
    /// A stream; no world is built yet.
    ///
    /// # Errors
    /// [`crate::Error::Config`] for a setting out of range.
    pub fn new(config: EndlessConfig) -> Result<Self> {
        config.validate()?;
        Ok(Self {
            schedule: Schedule::new(config.worlds_at_once, config.views_per_world),
            worlds: Cache::new(config.worlds_at_once + SPARE_WORLDS),
            config,
        })
    }

    /// The settings of the stream.
    #[must_use]
    pub fn config(&self) -> &EndlessConfig {
        &self.config
    }

    /// View number `index`, the same at every call, from any thread, in any order. Works on the calling thread alone; builds the view's
    /// world first if necessary.
    #[must_use]
    pub fn view(&self, index: u64) -> View {
        self.view_sized(index, (self.config.width, self.config.height))
    }

    /// The same place, seen by a camera with another image size (width, height; in pixels). Lens and position are drawn for that size; the
    /// whole image of a given camera is resized to it.
    #[must_use]
    pub fn view_sized(&self, index: u64, size: (u32, u32)) -> View {
        let config = &self.config;
        let without = Without(&config.without);
        let world_number = self.schedule.view_at(index).world;
        let place = self
            .worlds
            .get(world_number, || BuiltWorld::build(config, world_number));
        let world = &place.world;

        let mut rng = generator(config.seed, index, 0x00CA_4E4A);
        let anchor = rng.random_range(0.0..place.length);
        let nearest = rng.random_range(3.0..40.0);
        let traffic = place.traffic(&mut rng, anchor, nearest);
        let mut moving = traffic.solids(world, 0.0);
        let mut cars = traffic.objects(world, 0.0);
        let indoors = !world.rooms.is_empty();
        let lens = without.lens(camera::lens(&mut rng, size, indoors));
        let mounted = config.camera_of(index);
        let intrinsics = match mounted {
            Some(camera) => camera.intrinsics.resized(size.0, size.1),
            None => lens.intrinsics(size),
        };
        let near = (moving.as_slice(), anchor);
        let mount = Mount { mounted, without };
        let viewpoint = camera::viewpoint(&mut rng, &place, near, &intrinsics, mount);
        if viewpoint.alone || !without.moves() {
            moving.clear();
            cars.clear();
        }
        let riders = if without.moves() {
            riders::of_view(config, index, &place, &viewpoint.world_from_cam, &cars)
        } else {
            Riders::default()
        };
        moving.extend(riders.solids(world, 0.0, 0.0));
        cars.extend(riders.objects(world, 0.0, world.objects.len() + traffic.count()));

        let mut rng = generator(config.seed, index, 0x5EA);
        let (weather, air) = if place.plain {
            (weather::plain(world), Air::of(world))
        } else {
            without.weather(weather::draw(&mut rng, world), world)
        };
        let folds = hills::of_view(config, index, &place, &viewpoint.world_from_cam);
        let input = RenderInput {
            world,
            light: &place.light,
            air: &air,
            cars: &cars,
            world_from_cam: &viewpoint.world_from_cam,
            intrinsics: &intrinsics,
            folds: &folds,
        };
        let standing = world.primitives.iter().chain(&world.far);
        let solids = standing.chain(&moving).copied().collect();
        let mut exposure = render::expose(&input, solids, Cores::One, Edges::EachSurface);
        wet::reflect(&input, &mut exposure);

        let mut rng = generator(config.seed, index, 0xF11);
        let formation = Formation::draw(&mut rng, Brightness::of(weather), config.grey);
        let formed = config.formation && !place.plain;
        let rgb = if formed {
            let (width, height) = (size.0 as usize, size.1 as usize);
            formation.image(&exposure.light, width, height, rng.random())
        } else {
            render::encode(&exposure.light, size.0, size.1)
        };
        View {
            rgb,
            depth: exposure.depth,
            intrinsics,
            moving: exposure.moving,
            world_from_cam: viewpoint.world_from_cam,
            world: world_number,
            scene: world.scene,
            weather,
            height_m: viewpoint.height,
            grey: formed && formation.is_grey(),
            hills: !folds.creases.is_empty(),
            riders: riders.count(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn worlds_have_the_requested_scenes() -> Result<()> {
        let endless = Endless::new(EndlessConfig {
            width: 64,
            height: 32,
            views_per_world: 1,
            scenes: vec![Scene::Indoor, Scene::Night],
            ..EndlessConfig::default()
        })?;
        let found: Vec<Scene> = (0..24).map(|index| endless.view(index).scene).collect();
        assert!(found.contains(&Scene::Indoor) && found.contains(&Scene::Night));
        assert!(found.iter().all(|s| endless.config().scenes.contains(s)));
        Ok(())
    }

    #[test]
    fn the_number_of_worlds_in_memory_is_bounded() -> Result<()> {
        let endless = Endless::new(EndlessConfig {
            width: 64,
            height: 32,
            worlds_at_once: 2,
            views_per_world: 1,
            ..EndlessConfig::default()
        })?;
        for index in 0..14 {
            assert_eq!(endless.view(index).world, index);
            assert!(endless.worlds.len() <= 2 + SPARE_WORLDS);
        }
        Ok(())
    }
}
