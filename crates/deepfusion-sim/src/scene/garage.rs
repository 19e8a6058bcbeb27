//! An underground car park: a lane between bays, pillars, walls, a low ceiling, lamps.

use super::{World, cars};
use crate::primitive::Shape;
use crate::texture::ground::{Beyond, Paving, Stretch};
use crate::texture::{Material, Rgb};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::FRAC_PI_2;

/// Distance from the lane's middle to the walls, metres.
const HALF_WIDTH: f64 = 8.8;
/// Distance from the lane's middle to the bays, metres.
const BAYS: f64 = 3.4;
/// Height of the ceiling's underside, metres.
const CEILING: f64 = 2.75;
/// Length of a piece of wall or ceiling along the lane, metres; pieces overlap a little in bends.
const PIECE: f64 = 3.0;
/// Distance between two pillars of a row, metres.
const PILLARS: f64 = 7.8;
/// Width of a bay, metres.
const BAY: f64 = 2.6;

const PILLAR_PAINTS: [[f32; 3]; 3] = [[0.55, 0.42, 0.06], [0.10, 0.22, 0.42], [0.42, 0.09, 0.07]];

/// Builds the garage along the whole road.
pub(super) fn furnish(world: &mut World, rng: &mut ChaCha8Rng) {
    lay_ground(world, rng);
    let concrete = world.material(Material::Masonry(Rgb::new(0.46, 0.45, 0.43)));
    let soffit = world.material(Material::Masonry(Rgb::new(0.38, 0.38, 0.37)));
    let pipe = world.material(Material::Metal(Rgb::new(0.50, 0.16, 0.10)));
    let housing = world.material(Material::Metal(Rgb::new(0.75, 0.76, 0.74)));
    let paints = PILLAR_PAINTS.map(|[r, g, b]| {
        world.material(Material::Sign(
            Rgb::new(r, g, b),
            Rgb::new(0.62, 0.61, 0.58),
        ))
    });
    let (start, end) = (world.road.start + 4.0, world.road.end() - 4.0);

    let mut s = start;
    while s < end {
        for side in [-1.0, 1.0] {
            let (x, y, heading) = world.road.world(s, side * (HALF_WIDTH + 0.15));
            // On the outside of a bend the pieces must be longer.
            let stretch = 1.0 + world.road.centre(s).3.abs() * HALF_WIDTH;
            let wall = Shape::Box {
                half_x: (0.5 * PIECE * stretch) as f32 + 0.05,
                half_y: 0.15,
                height: CEILING as f32,
            };
            world.solid(wall, [x, y, 0.0], heading, concrete, rng.random());
        }
        let (x, y, heading) = world.road.world(s, 0.0);
        let stretch = 1.0 + world.road.centre(s).3.abs() * HALF_WIDTH;
        let slab = Shape::Box {
            half_x: (0.5 * PIECE * stretch) as f32 + 0.05,
            half_y: HALF_WIDTH as f32 + 0.3,
            height: 0.3,
        };
        world.solid(slab, [x, y, CEILING], heading, soffit, rng.random());
        for lateral in [-2.3, 2.6] {
            let (x, y, heading) = world.road.world(s, lateral);
            let tube = Shape::Box {
                half_x: (0.5 * PIECE * stretch) as f32 + 0.05,
                half_y: 0.06,
                height: 0.12,
            };
            world.solid(tube, [x, y, CEILING - 0.22], heading, pipe, rng.random());
        }
        s += PIECE;
    }

    let mut s = start;
    while s < end {
        for side in [-1.0, 1.0] {
            let (x, y, heading) = world.road.world(s, side * (BAYS + 0.35));
            let pillar = Shape::Box {
                half_x: 0.25,
                half_y: 0.35,
                height: CEILING as f32,
            };
            let paint = paints[rng.random_range(0..paints.len())];
            world.solid(pillar, [x, y, 0.0], heading, paint, rng.random());
            world.object(
                super::ObjectClass::Pole,
                [x, y, 0.0],
                heading,
                [0.5, 0.7, CEILING],
            );
            for bay in 0..3 {
                let along = s + 0.25 + BAY * (f64::from(bay) + 0.5);
                if along < end && rng.random_bool(0.55) {
                    let out = BAYS + 2.6 + rng.random_range(-0.15..0.15);
                    let (x, y, heading) = world.road.world(along, side * out);
                    let nose_in = if rng.random_bool(0.7) { side } else { -side };
                    let turn = heading + nose_in * FRAC_PI_2 + rng.random_range(-0.03..0.03);
                    cars::park(world, rng, [x, y, 0.0], turn);
                }
            }
        }
        // A tube lamp over the lane, of random brightness or broken.
        let (x, y, heading) = world.road.world(s + 0.5 * PILLARS, 0.0);
        let tube = Shape::Box {
            half_x: 0.65,
            half_y: 0.09,
            height: 0.08,
        };
        world.solid(tube, [x, y, CEILING - 0.12], heading, housing, rng.random());
        let strength = if rng.random_bool(0.12) {
            0.0
        } else {
            rng.random_range(3.2..5.2)
        };
        if strength > 0.0 {
            let colour = Rgb::new(1.0, 0.98, 0.9) * strength;
            let place = [x, y, CEILING - 0.2];
            world.lamps.add((s + 0.5 * PILLARS) as f32, place, colour);
        }
        s += PILLARS;
    }
}

/// One wide carriageway from wall to wall.
fn lay_ground(world: &mut World, rng: &mut ChaCha8Rng) {
    world.stretches.push(Stretch {
        dashes: [4.0, 1.5],
        edge_lines: false,
        zebra: f32::NAN,
        asphalt: rng.random_range(0.22..0.32),
        bays: false,
        beyond: [Beyond::Paved; 2],
        paving: [Paving::Asphalt; 2],
        style: None,
    });
    let samples = world.road.samples_mut();
    for sample in samples.iter_mut() {
        sample.half_width = (HALF_WIDTH + 0.4) as f32;
        sample.pavement = [1.0; 2];
        sample.verge = [0.0; 2];
    }
    world.stretch_of = vec![0; world.road.samples_mut().len()];
    world.road.index();
}
