//! Lamp posts, signs, bollards, bins, fences, garden walls.

use super::buildings::pick;
use super::{ObjectClass, World};
use crate::primitive::Shape;
use crate::road::KERB_HEIGHT;
use crate::texture::{Material, Rgb};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

const GROUND: f64 = KERB_HEIGHT as f64 - 0.02;

/// Materials shared by the furniture of a drive.
pub(super) struct Furniture {
    pole: u32,
    dark: u32,
    pale: u32,
    signs: Vec<u32>,
    fences: Vec<u32>,
    walls: Vec<u32>,
    boxes: Vec<u32>,
}

const FENCES: [[f32; 3]; 4] = [
    [0.22, 0.13, 0.07],
    [0.35, 0.26, 0.17],
    [0.5, 0.5, 0.47],
    [0.1, 0.13, 0.09],
];
const WALLS: [[f32; 3]; 3] = [[0.3, 0.13, 0.09], [0.36, 0.32, 0.27], [0.25, 0.22, 0.2]];
const BOXES: [[f32; 3]; 5] = [
    [0.05, 0.1, 0.06],
    [0.3, 0.3, 0.3],
    [0.55, 0.4, 0.03],
    [0.04, 0.08, 0.25],
    [0.1, 0.09, 0.08],
];
const SIGNS: [[[f32; 3]; 2]; 6] = [
    [[0.6, 0.03, 0.03], [0.8, 0.8, 0.8]],
    [[0.03, 0.08, 0.4], [0.8, 0.8, 0.8]],
    [[0.75, 0.55, 0.03], [0.05, 0.05, 0.05]],
    [[0.7, 0.7, 0.68], [0.1, 0.1, 0.12]],
    [[0.05, 0.3, 0.12], [0.75, 0.75, 0.6]],
    [[0.5, 0.15, 0.3], [0.85, 0.75, 0.5]],
];

impl Furniture {
    /// Draws the colours.
    pub(super) fn new(world: &mut World, rng: &mut ChaCha8Rng) -> Self {
        let metal = |world: &mut World, tone: f32| {
            world.material(Material::Metal(Rgb::new(tone, tone, tone * 0.97)))
        };
        let rgb = |c: [f32; 3]| Rgb::new(c[0], c[1], c[2]);
        Self {
            pole: metal(world, 0.32),
            dark: metal(world, 0.06),
            pale: metal(world, 0.5),
            signs: SIGNS
                .iter()
                .map(|[a, b]| world.material(Material::Sign(rgb(*a), rgb(*b))))
                .collect(),
            fences: (0..5)
                .map(|_| {
                    let colour = pick(rng, &FENCES);
                    world.material(Material::Planks(colour))
                })
                .collect(),
            walls: (0..4)
                .map(|_| {
                    let colour = pick(rng, &WALLS);
                    world.material(Material::Masonry(colour))
                })
                .collect(),
            boxes: (0..6)
                .map(|_| {
                    let colour = pick(rng, &BOXES);
                    world.material(Material::Metal(colour))
                })
                .collect(),
        }
    }

    /// A lamp post with an arm that reaches over the road; `towards` is the heading to the road.
    pub(super) fn lamp(
        &self,
        world: &mut World,
        rng: &mut ChaCha8Rng,
        x: f64,
        y: f64,
        towards: f64,
    ) {
        let height = rng.random_range(4.5..7.5f32);
        let paint = if rng.random_bool(0.5) {
            self.pole
        } else {
            self.dark
        };
        let seed = rng.random();
        let post = Shape::Cylinder {
            radius: 0.075,
            height,
        };
        world.solid(post, [x, y, GROUND], 0.0, paint, seed);
        let foot = Shape::Cylinder {
            radius: 0.13,
            height: 0.9,
        };
        world.solid(foot, [x, y, GROUND], 0.0, paint, seed);
        let (half_x, half_y) = (0.6, 0.12);
        let head = [
            x + 0.5 * towards.cos(),
            y + 0.5 * towards.sin(),
            GROUND + f64::from(height) - 0.05,
        ];
        let lamp = Shape::Box {
            half_x,
            half_y,
            height: 0.14,
        };
        world.solid(lamp, head, towards, self.pale, seed);
        let under = [head[0], head[1], head[2] - 0.1];
        world.light_lamp(under, Rgb::new(1.0, 0.78, 0.5) * (1.2 * height * height));
        world.object(
            ObjectClass::Pole,
            [x, y, GROUND],
            towards,
            [0.26, 0.26, f64::from(height)],
        );
    }

    /// A traffic sign that faces `heading`.
    pub(super) fn sign(
        &self,
        world: &mut World,
        rng: &mut ChaCha8Rng,
        x: f64,
        y: f64,
        heading: f64,
    ) {
        let height = rng.random_range(2.1..2.9f32);
        let post = Shape::Cylinder {
            radius: 0.04,
            height,
        };
        world.solid(post, [x, y, GROUND], 0.0, self.pole, rng.random());
        let face = self.signs[rng.random_range(0..self.signs.len())];
        let half = rng.random_range(0.25..0.4f32);
        let board = Shape::Box {
            half_x: 0.02,
            half_y: half,
            height: 2.0 * half,
        };
        let at = [
            x + 0.06 * heading.cos(),
            y + 0.06 * heading.sin(),
            GROUND + f64::from(height - 1.9 * half),
        ];
        world.solid(board, at, heading, face, rng.random());
        let size = [0.1, f64::from(2.0 * half), f64::from(height)];
        world.object(ObjectClass::Pole, [x, y, GROUND], heading, size);
    }

    /// A bollard.
    pub(super) fn bollard(&self, world: &mut World, rng: &mut ChaCha8Rng, x: f64, y: f64) {
        let shape = Shape::Cylinder {
            radius: 0.07,
            height: 0.9,
        };
        world.solid(shape, [x, y, GROUND], 0.0, self.dark, rng.random());
        world.object(ObjectClass::Pole, [x, y, GROUND], 0.0, [0.14, 0.14, 0.9]);
    }

    /// An advertising column, a cabinet or a bin.
    pub(super) fn cabinet(
        &self,
        world: &mut World,
        rng: &mut ChaCha8Rng,
        x: f64,
        y: f64,
        heading: f64,
    ) {
        if rng.random_bool(0.2) {
            let shape = Shape::Cylinder {
                radius: 0.6,
                height: 2.7,
            };
            let paper = self.signs[rng.random_range(0..self.signs.len())];
            world.solid(shape, [x, y, GROUND], 0.0, paper, rng.random());
            world.object(ObjectClass::Pole, [x, y, GROUND], 0.0, [1.2, 1.2, 2.7]);
            return;
        }
        let (a, b) = (
            rng.random_range(0.25..0.7f32),
            rng.random_range(0.2..0.4f32),
        );
        let height = rng.random_range(0.8..1.5f32);
        let shape = Shape::Box {
            half_x: a,
            half_y: b,
            height,
        };
        let paint = self.boxes[rng.random_range(0..self.boxes.len())];
        world.solid(shape, [x, y, GROUND], heading, paint, rng.random());
        let size = [2.0 * a, 2.0 * b, height].map(f64::from);
        world.object(ObjectClass::Pole, [x, y, GROUND], heading, size);
    }

    /// A fence of planks or a garden wall.
    pub(super) fn fence(
        &self,
        world: &mut World,
        rng: &mut ChaCha8Rng,
        x: f64,
        y: f64,
        heading: f64,
        length: f64,
    ) {
        let walled = rng.random_bool(0.4);
        let of = if walled { &self.walls } else { &self.fences };
        let material = of[rng.random_range(0..of.len())];
        let half_y = if walled { 0.14 } else { 0.04 };
        let height = rng.random_range(0.7..1.7f32);
        let shape = Shape::Box {
            half_x: 0.5 * length as f32,
            half_y,
            height,
        };
        world.solid(shape, [x, y, GROUND], heading, material, rng.random());
        let size = [length, f64::from(2.0 * half_y), f64::from(height)];
        world.object(ObjectClass::Fence, [x, y, GROUND], heading, size);
    }
}
