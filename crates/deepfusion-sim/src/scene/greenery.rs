//! Trees, bushes, hedges.

use super::{ObjectClass, World};
use crate::primitive::Shape;
use crate::road::KERB_HEIGHT;
use crate::texture::{Material, Rgb};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// Materials shared by the plants of a drive.
pub(super) struct Greens {
    leaves: Vec<u32>,
    bark: Vec<u32>,
}

impl Greens {
    /// Draws the colours of this drive's season.
    pub(super) fn new(world: &mut World, rng: &mut ChaCha8Rng) -> Self {
        let autumn = rng.random_range(0.0..0.35);
        let leaves = (0..8)
            .map(|_| {
                let turned = rng.random_bool(autumn);
                let tone = rng.random_range(0.75..1.3f32);
                let colour = if turned {
                    Rgb::new(0.33, rng.random_range(0.13..0.24), 0.035)
                } else {
                    Rgb::new(
                        rng.random_range(0.08..0.17),
                        rng.random_range(0.15..0.22),
                        0.045,
                    )
                };
                world.material(Material::Foliage(colour * tone))
            })
            .collect();
        let bark = (0..3)
            .map(|_| {
                let tone = rng.random_range(0.1..0.24f32);
                world.material(Material::Bark(Rgb::new(tone, tone * 0.85, tone * 0.7)))
            })
            .collect();
        Self { leaves, bark }
    }

    fn any(rng: &mut ChaCha8Rng, of: &[u32]) -> u32 {
        of[rng.random_range(0..of.len())]
    }

    /// A broad-leaved tree, or sometimes a conifer.
    pub(super) fn tree(&self, world: &mut World, rng: &mut ChaCha8Rng, x: f64, y: f64) {
        let size = rng.random_range(0.7..1.25f32);
        let (leaves, bark) = (Self::any(rng, &self.leaves), Self::any(rng, &self.bark));
        let ground = f64::from(KERB_HEIGHT) - 0.05;
        let conifer = rng.random_bool(0.12);
        let trunk = if conifer {
            1.2
        } else {
            rng.random_range(2.0..3.4f32) * size
        };
        let radius = rng.random_range(0.11..0.2f32) * size;
        let shape = Shape::Cylinder {
            radius,
            height: trunk + 1.4,
        };
        world.solid(shape, [x, y, ground], 0.0, bark, rng.random());
        let mut crown = |world: &mut World, dx: f32, dy: f32, z: f32, radii: [f32; 3]| {
            let at = [x + f64::from(dx), y + f64::from(dy), ground + f64::from(z)];
            let turn = rng.random_range(0.0..3.0);
            world.solid(Shape::Ellipsoid { radii }, at, turn, leaves, rng.random());
        };
        let top;
        let mut reach = 0.0f32;
        if conifer {
            let tall = 7.0 * size;
            for level in 0..6 {
                let part = level as f32 / 6.0;
                let wide = (1.9 - 1.6 * part) * size;
                crown(
                    world,
                    0.0,
                    0.0,
                    1.2 + tall * part,
                    [wide, wide, 0.85 * size],
                );
                reach = reach.max(wide);
            }
            top = 1.2 + tall;
        } else {
            let wide = 1.75 * size;
            let middle = trunk + 1.25 * size;
            crown(world, 0.0, 0.0, middle, [wide, wide, 1.5 * size]);
            for i in 0..9 {
                let angle = i as f32 * 2.4 + size * 9.0;
                let up = ((i as f32 * 0.618).fract() - 0.42) * 2.1 * size;
                let out = wide * (1.02 - 0.28 * (up / size).powi(2)).max(0.2);
                let ball = size * (0.65 + 0.45 * ((i * 7) % 5) as f32 / 5.0);
                let (dx, dy) = (out * angle.cos(), out * angle.sin());
                crown(world, dx, dy, middle + up, [ball, ball * 0.9, ball * 0.75]);
                reach = reach.max(out + ball);
            }
            top = middle + 2.4 * size;
        }
        let wide = 2.0 * f64::from(reach);
        world.object(
            ObjectClass::Tree,
            [x, y, ground],
            0.0,
            [wide, wide, f64::from(top)],
        );
    }

    /// A bush.
    pub(super) fn bush(&self, world: &mut World, rng: &mut ChaCha8Rng, x: f64, y: f64) {
        let leaves = Self::any(rng, &self.leaves);
        let size = rng.random_range(0.4..1.0f64);
        for _ in 0..4 {
            let at = [
                x + size * rng.random_range(-0.6..0.6),
                y + size * rng.random_range(-0.6..0.6),
                f64::from(KERB_HEIGHT) + 0.35 * size,
            ];
            let ball = (size * rng.random_range(0.55..0.95)) as f32;
            let radii = [ball, ball * 0.85, ball * 0.9];
            world.solid(Shape::Ellipsoid { radii }, at, 0.0, leaves, rng.random());
        }
        let wide = 3.0 * size;
        world.object(
            ObjectClass::Tree,
            [x, y, f64::from(KERB_HEIGHT)],
            0.0,
            [wide, wide, 1.3 * size],
        );
    }

    /// A hedge, `length` metres along `heading`, with an uneven top.
    pub(super) fn hedge(
        &self,
        world: &mut World,
        rng: &mut ChaCha8Rng,
        x: f64,
        y: f64,
        heading: f64,
        length: f64,
    ) {
        let leaves = Self::any(rng, &self.leaves);
        let height = rng.random_range(0.8..1.9f32);
        let base = [x, y, f64::from(KERB_HEIGHT) - 0.02];
        let shape = Shape::Box {
            half_x: 0.5 * length as f32,
            half_y: 0.35,
            height,
        };
        world.solid(shape, base, heading, leaves, rng.random());
        let bumps = (length / 0.9) as i32;
        for i in 0..bumps {
            let u = (f64::from(i) + 0.5) / f64::from(bumps) * length - 0.5 * length;
            let at = [
                x + u * heading.cos(),
                y + u * heading.sin(),
                base[2] + f64::from(height) - 0.12,
            ];
            let radii = [0.55, 0.4, rng.random_range(0.18..0.4)];
            world.solid(
                Shape::Ellipsoid { radii },
                at,
                heading,
                leaves,
                rng.random(),
            );
        }
        world.object(
            ObjectClass::Fence,
            base,
            heading,
            [length, 0.8, f64::from(height) + 0.2],
        );
    }
}
