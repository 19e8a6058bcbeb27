//! A world of the endless mode: a short stretch of street with its traffic and sun.

use super::EndlessConfig;
use super::draw::{generator, weighted};
use super::ingredient::Without;
use crate::config::Scene;
use crate::light::GroundLight;
use crate::motion::Drive;
use crate::primitive::V3;
use crate::render::Cores;
use crate::road::Road;
use crate::scene::cars::CarModel;
use crate::scene::{Variety, World};
use crate::traffic::Traffic;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// The street begins this far behind the first camera and ends this far beyond the last, metres.
const BEHIND: f64 = 110.0;
const AHEAD: f64 = 190.0;

/// Cameras are placed along the path that a car drives in this time, seconds.
const DURATION_S: f64 = 9.0;

/// Share of the worlds that are not varied, but viewed in any weather and through any camera.
const UNVARIED: f64 = 0.12;

/// A built world, ready to be viewed.
pub(super) struct BuiltWorld {
    /// The street and everything static on it.
    pub world: World,
    /// Light on its ground.
    pub light: GroundLight,
    /// Greatest density of the traffic, in [0, 1].
    density: f64,
    /// Whether views are rendered as in [`crate::Simulation`].
    pub plain: bool,
    /// Models of the people who may ride and walk there; empty if nobody does.
    pub people: Vec<CarModel>,
    /// Cameras are placed from 0 to here, metres along the street.
    pub length: f64,
}

impl BuiltWorld {
    /// Builds world `number` of a stream.
    pub(super) fn build(config: &EndlessConfig, number: u64) -> Self {
        // A generator of its own, so that the share of plain worlds does not change the other worlds.
        let mut rng = generator(config.seed, number, 0x91A1);
        let plain = rng.random_bool(config.plain);
        let plain_scene = one_of(&mut rng, &config.plain_scenes());
        let mut rng = generator(config.seed, number, 0x90D);
        let varied_scene = if config.scenes.is_empty() {
            scene(&mut rng, config.daylight)
        } else {
            one_of(&mut rng, &config.scenes)
        };
        let drawn_scene = match if plain { plain_scene } else { varied_scene } {
            Scene::Indoor if config.on_cars() => {
                // Cars do not drive through rooms.
                let other = config.scenes.iter().find(|scene| **scene != Scene::Indoor);
                other.copied().unwrap_or(Scene::Urban)
            }
            drawn => drawn,
        };
        let without = Without(&config.without);
        let scene = without.scene(drawn_scene);
        let seed: u64 = rng.random();
        let longest = 14.0 * (DURATION_S + 3.0);
        let mut road = match scene {
            Scene::Indoor => Road::straight(-BEHIND, longest + AHEAD),
            Scene::Motorway | Scene::Country => Road::gentle(&mut rng, -BEHIND, longest + AHEAD),
            _ => Road::generate(&mut rng, -BEHIND, longest + AHEAD),
        };
        let drive = Drive::simulate(&mut rng, &road, DURATION_S, scene.pace());
        let length = drive.progress(DURATION_S).0;
        road.truncate(length + AHEAD);
        // Some worlds are as in `simulate`, if the scene exists there.
        let unvaried = plain || (Scene::ALL.contains(&drawn_scene) && rng.random_bool(UNVARIED));
        let variety = if unvaried {
            Variety::none()
        } else {
            without.variety(Variety::draw(&mut rng))
        };
        let mut world = World::furnish_varied(road, seed, scene, &variety);
        if !plain {
            world.sun = without.sun(sun(&mut rng), world.sun);
        }
        let people = if config.riders > 0.0 && !plain && scene.has_riders() {
            world.people()
        } else {
            Vec::new()
        };
        let light = GroundLight::bake(&world, Cores::One);
        Self {
            world,
            light,
            density: rng.random(),
            plain,
            people,
            length,
        }
    }

    /// Whether its views may have hills: those in the open may, unless the world is plain.
    pub(super) fn has_hills(&self) -> bool {
        !self.plain && !matches!(self.world.scene, Scene::Garage | Scene::Indoor)
    }

    /// The traffic around a position on the street, metres along it. The lane is free for `nearest` metres ahead of it.
    pub(super) fn traffic(&self, rng: &mut ChaCha8Rng, s: f64, nearest: f64) -> Traffic {
        let speed = 9.0 * self.world.scene.pace();
        let density = self.density * rng.random_range(0.0..1.0);
        Traffic::around(rng, &self.world, (s, speed, nearest), density)
    }
}

/// One of the scenes with equal probability; a street if there is none.
fn one_of(rng: &mut ChaCha8Rng, scenes: &[Scene]) -> Scene {
    match scenes.len() {
        0 => Scene::Urban,
        count => scenes[rng.random_range(0..count)],
    }
}

/// By day mostly streets, then shopping streets, country roads, parks and motorways; otherwise rooms, nights and garages.
fn scene(rng: &mut ChaCha8Rng, daylight: f64) -> Scene {
    if rng.random_bool(daylight) {
        weighted(
            rng,
            &[
                (0.42, Scene::Urban),
                (0.18, Scene::Commercial),
                (0.14, Scene::Park),
                (0.15, Scene::Country),
                (0.11, Scene::Motorway),
            ],
        )
    } else {
        weighted(
            rng,
            &[
                (0.55, Scene::Indoor),
                (0.2, Scene::Garage),
                (0.25, Scene::Night),
            ],
        )
    }
}

/// Direction towards the sun, at any azimuth: in a quarter of the worlds it is low (3° to 17°), otherwise 17° to 65° high.
pub(super) fn sun(rng: &mut ChaCha8Rng) -> V3 {
    let azimuth: f32 = rng.random_range(0.0..std::f32::consts::TAU);
    let elevation: f32 = if rng.random_bool(0.25) {
        rng.random_range(0.06..0.3)
    } else {
        rng.random_range(0.3..1.13)
    };
    V3::new(
        azimuth.cos() * elevation.cos(),
        azimuth.sin() * elevation.cos(),
        elevation.sin(),
    )
}
