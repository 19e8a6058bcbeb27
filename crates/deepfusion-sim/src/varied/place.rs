//! A world of the endless mode: a short stretch of street, its traffic, its sun.

use super::EndlessConfig;
use super::draw::{generator, weighted};
use crate::config::Scene;
use crate::light::GroundLight;
use crate::motion::Drive;
use crate::primitive::V3;
use crate::render::Cores;
use crate::road::Road;
use crate::scene::{Variety, World};
use crate::traffic::Traffic;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// The street begins this far behind the first camera and ends this far beyond the last, metres.
const BEHIND: f64 = 110.0;
const AHEAD: f64 = 190.0;

/// Traffic is simulated for so long, seconds; cameras stand along the way that a car drives meanwhile.
const DURATION_S: f64 = 9.0;

/// A built world.
pub struct Place {
    /// The street and what stands on it.
    pub world: World,
    /// Light on its ground.
    pub light: GroundLight,
    /// What moves.
    pub traffic: Traffic,
    /// Cameras are placed from 0 to here, metres along the street.
    pub length: f64,
}

impl Place {
    /// Builds world `number` of a stream.
    pub fn build(config: &EndlessConfig, number: u64) -> Self {
        let mut rng = generator(config.seed, number, 0x90D);
        let varied = rng.random_bool(config.variety);
        let scene = scene(&mut rng, config.daylight, varied);
        let variety = if varied {
            Variety::draw(&mut rng)
        } else {
            Variety::none()
        };
        let seed: u64 = rng.random();
        let longest = 14.0 * (DURATION_S + 3.0);
        let mut road = match scene {
            Scene::Indoor => Road::straight(-0.5 * BEHIND, longest + AHEAD),
            Scene::Motorway | Scene::Country => Road::gentle(&mut rng, -BEHIND, longest + AHEAD),
            _ => Road::generate(&mut rng, -BEHIND, longest + AHEAD),
        };
        let drive = Drive::simulate(&mut rng, &road, DURATION_S, scene.pace());
        let length = drive.progress(DURATION_S).0;
        road.truncate(length + if scene == Scene::Indoor { 40.0 } else { AHEAD });
        let mut world = World::furnish_varied(road, seed, scene, &variety);
        world.sun = sun(&mut rng);
        let light = GroundLight::bake(&world, Cores::One);
        let cars = match scene {
            Scene::Garage => rng.random_range(0..3),
            Scene::Park => rng.random_range(0..5),
            _ => rng.random_range(0..13),
        };
        let traffic = if varied && !matches!(scene, Scene::Garage | Scene::Indoor) {
            let density = match scene {
                Scene::Park => rng.random_range(0.0..0.3),
                _ => rng.random_range(0.0..1.0),
            };
            let start = (-40.0, length / DURATION_S, 0.0);
            Traffic::around(&mut rng, &world, start, density)
        } else {
            Traffic::new(&mut rng, &world, &drive, DURATION_S, cars)
        };
        Self {
            world,
            light,
            traffic,
            length,
        }
    }

    /// A time of its traffic, seconds.
    pub fn time(rng: &mut ChaCha8Rng) -> f64 {
        rng.random_range(0.0..DURATION_S)
    }
}

/// By daylight mostly streets, then shopping streets and parks, and in varied worlds country roads and motorways;
/// else rooms (in varied worlds), garages and nights.
fn scene(rng: &mut ChaCha8Rng, daylight: f64, varied: bool) -> Scene {
    if varied {
        return if rng.random_bool(daylight) {
            weighted(
                rng,
                &[
                    (0.46, Scene::Urban),
                    (0.15, Scene::Commercial),
                    (0.13, Scene::Park),
                    (0.16, Scene::Country),
                    (0.1, Scene::Motorway),
                ],
            )
        } else {
            weighted(
                rng,
                &[
                    (0.65, Scene::Indoor),
                    (0.15, Scene::Garage),
                    (0.2, Scene::Night),
                ],
            )
        };
    }
    if rng.random_bool(daylight) {
        weighted(
            rng,
            &[
                (0.5, Scene::Urban),
                (0.25, Scene::Commercial),
                (0.25, Scene::Park),
            ],
        )
    } else {
        weighted(rng, &[(0.5, Scene::Garage), (0.5, Scene::Night)])
    }
}

/// Towards the sun: any azimuth; in a quarter of the worlds low (3° to 17°), else 17° to 65° high.
fn sun(rng: &mut ChaCha8Rng) -> V3 {
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
