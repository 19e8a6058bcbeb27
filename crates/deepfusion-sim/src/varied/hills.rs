//! The hills of a view: how the road rises and falls ahead of the camera.

use super::EndlessConfig;
use super::built_world::BuiltWorld;
use super::draw::{generator, log_uniform, normal, weighted};
use crate::primitive::{Primitive, Shape};
use crate::render::{Crease, Folds};
use crate::scene::World;
use deepfusion_geometry::Se3;
use nalgebra::Vector3;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::PI;

/// Greatest angle of a crease, radians.
const SHARPEST: f64 = 1.5 * PI / 180.0;

/// No slope begins beyond this distance, metres.
const FARTHEST: f64 = 220.0;

/// The hills of view `index`: none in rooms, in garages and in plain worlds. In the other worlds `hills` is the share of views that have
/// some; a view that has some has the same ones for every share.
pub(super) fn of_view(
    config: &EndlessConfig,
    index: u64,
    place: &BuiltWorld,
    world_from_cam: &Se3,
) -> Folds {
    let mut rng = generator(config.seed, index, 0x4111);
    if place.has_hills() && rng.random::<f64>() < config.hills {
        draw(&mut rng, &place.world, world_from_cam)
    } else {
        Folds::default()
    }
}

/// A pole or a trunk.
#[derive(Debug, Clone, Copy)]
struct Pole {
    /// Position, metres ahead of the camera.
    along: f64,
    /// Distance from a crease within which the crease would cut the pole, metres: its radius, and what is cut at its top.
    reach: f64,
}

impl Pole {
    fn is_at(&self, crease: f64) -> bool {
        (self.along - crease).abs() < self.reach
    }
}

/// The poles and trunks near enough that a missing piece would be visible.
fn poles(world: &World, eye: &Vector3<f64>, heading: f64) -> Vec<Pole> {
    let (sin, cos) = heading.sin_cos();
    let tilt = (0.5 * SHARPEST).tan();
    let pole = |solid: &Primitive| {
        let upright = match solid.shape {
            Shape::Cylinder { .. } => true,
            Shape::Capsule {
                half_axis: [x, y, z],
                ..
            } => x.hypot(y) < 0.3 * z.abs(),
            _ => false,
        };
        let (half_x, half_y, _, high) = solid.bounds(&world.hulls);
        let (radius, top) = (half_x.hypot(half_y), solid.position[2] + f64::from(high));
        let (x, y) = (solid.position[0] - eye.x, solid.position[1] - eye.y);
        let (along, lateral) = (cos * x + sin * y, cos * y - sin * x);
        let near = (0.0..120.0).contains(&along) && lateral.abs() < 40.0;
        (upright && near && radius < 0.6 && top > 1.5).then(|| Pole {
            along,
            reach: f64::from(radius) + tilt * top,
        })
    };
    world.primitives.iter().filter_map(pole).collect()
}

/// Draws one to three slopes, with crests and dips between them: curves of creases 8 to 20 m apart, the first one 6 to 40 m ahead. A crease
/// that would cut a pole is moved a little farther. The last piece of ground is about level, so that it reaches the horizon. Slopes follow
/// the direction of the road, in the sense in which the camera looks.
fn draw(rng: &mut ChaCha8Rng, world: &World, world_from_cam: &Se3) -> Folds {
    let eye = world_from_cam.translation();
    let index = world.road.locate(eye.x, eye.y).index;
    let road = world.road.sample(index).heading;
    let looks = world_from_cam.rotate(&Vector3::z());
    let along = looks.x * road.cos() + looks.y * road.sin();
    let direction = if along < 0.0 { PI } else { 0.0 };
    let heading = road + direction + normal(rng, 0.0, 0.06, 2.5);
    let poles = poles(world, &eye, heading);
    let mut creases = Vec::new();
    let mut distance = log_uniform(rng, 6.0, 40.0);
    let mut slope = 0.0;
    let mut up = rng.random_bool(0.5);
    let slopes = weighted(rng, &[(0.5, 1), (0.35, 2), (0.15, 3)]);
    for number in 0..=slopes {
        let next = if number == slopes {
            normal(rng, 0.0, 0.006, 2.0)
        } else {
            let steep = grade(rng).atan();
            if up { steep } else { -steep }
        };
        up ^= rng.random_bool(0.65);
        if distance > FARTHEST && number < slopes {
            continue;
        }
        let turn: f64 = next - slope;
        let count = (turn.abs() / SHARPEST).ceil().max(1.0);
        for _ in 0..count as usize {
            let places = (0..30).map(|step| distance + 0.13 * f64::from(step));
            distance = places
                .into_iter()
                .find(|place| !poles.iter().any(|pole| pole.is_at(*place)))
                .unwrap_or(distance);
            creases.push(Crease {
                distance,
                angle: turn / count,
            });
            distance += rng.random_range(8.0..20.0);
        }
        slope = next;
        distance += log_uniform(rng, 8.0, 120.0);
    }
    Folds { heading, creases }
}

/// The tangent of a slope: 9 in 10 between 1.5 % and 9 %, the others up to 15 %.
fn grade(rng: &mut ChaCha8Rng) -> f64 {
    if rng.random_bool(0.9) {
        rng.random_range(0.015..0.09)
    } else {
        rng.random_range(0.09..0.15)
    }
}

#[cfg(test)]
mod tests;
