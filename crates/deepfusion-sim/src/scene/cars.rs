//! Cars: a body, a cabin and four wheels.

use super::{ObjectClass, World};
use crate::primitive::{Hull, Primitive, Shape, V3};
use crate::texture::objects::Paint;
use crate::texture::{Material, Rgb};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// One model of car in one colour.
#[derive(Debug, Clone)]
pub(crate) struct CarModel {
    /// Class of the objects made from it.
    pub class: ObjectClass,
    /// Length, width, height, metres.
    pub size: [f32; 3],
    /// Shape, position in the car's axes (x forward, y left, origin on the ground below the middle) and material of each part.
    pub(super) parts: Vec<(Shape, [f64; 3], u32)>,
}

impl CarModel {
    /// The solids of a car at a position with a heading.
    pub(crate) fn solids(
        &self,
        base: [f64; 3],
        heading: f64,
        seed: u32,
        moving: bool,
    ) -> Vec<Primitive> {
        let (sin, cos) = heading.sin_cos();
        self.parts
            .iter()
            .map(|(shape, [x, y, z], material)| Primitive {
                position: [
                    base[0] + cos * x - sin * y,
                    base[1] + sin * x + cos * y,
                    base[2] + z,
                ],
                heading: (cos as f32, sin as f32),
                shape: *shape,
                material: *material,
                seed,
                moving,
            })
            .collect()
    }
}

/// Proportions of a body.
#[derive(Debug, Clone, Copy)]
pub(super) struct Body {
    pub(super) size: [f32; 3],
    /// Height of the waistline above the road.
    pub(super) waist: f32,
    /// Ends of the cabin at the waistline and at the roof, from the middle: front, rear.
    pub(super) cabin: [f32; 2],
    pub(super) roof: [f32; 2],
    /// Length and drop of the hood's slope.
    pub(super) hood: [f32; 2],
}

pub(super) const BODIES: [Body; 5] = [
    // A small car.
    Body {
        size: [3.8, 1.68, 1.5],
        waist: 0.93,
        cabin: [0.85, -1.8],
        roof: [0.1, -1.55],
        hood: [1.0, 0.2],
    },
    // A saloon.
    Body {
        size: [4.55, 1.78, 1.44],
        waist: 0.92,
        cabin: [0.95, -1.6],
        roof: [0.15, -0.95],
        hood: [1.2, 0.16],
    },
    // An estate.
    Body {
        size: [4.6, 1.8, 1.5],
        waist: 0.94,
        cabin: [0.95, -2.15],
        roof: [0.15, -1.85],
        hood: [1.2, 0.18],
    },
    // An off-roader.
    Body {
        size: [4.4, 1.86, 1.72],
        waist: 1.06,
        cabin: [0.85, -2.1],
        roof: [0.2, -1.85],
        hood: [1.0, 0.16],
    },
    // A van.
    Body {
        size: [5.0, 1.92, 2.1],
        waist: 1.15,
        cabin: [1.75, -2.45],
        roof: [0.95, -2.4],
        hood: [0.7, 0.3],
    },
];

const COLOURS: [[f32; 3]; 10] = [
    [0.55, 0.55, 0.55],
    [0.33, 0.34, 0.35],
    [0.05, 0.05, 0.055],
    [0.12, 0.125, 0.13],
    [0.68, 0.68, 0.66],
    [0.35, 0.03, 0.03],
    [0.04, 0.09, 0.27],
    [0.06, 0.17, 0.12],
    [0.42, 0.36, 0.24],
    [0.12, 0.25, 0.40],
];

const FLOOR: f32 = 0.24;
const WHEEL: f32 = 0.31;

/// Every body in several colours.
pub(crate) fn models(world: &mut World, rng: &mut ChaCha8Rng) -> Vec<CarModel> {
    let tyre = world.material(Material::Tyre);
    let mut models = Vec::new();
    for body in &BODIES {
        let lower = lower_hull(body);
        let lower = world.hull(lower);
        let upper = upper_hull(body);
        let upper = world.hull(upper);
        for _ in 0..9 {
            let colour = super::buildings::pick(rng, &COLOURS);
            models.push(model(world, body, lower, upper, tyre, colour));
        }
    }
    models
}

pub(super) fn model(
    world: &mut World,
    body: &Body,
    lower: u32,
    upper: u32,
    tyre: u32,
    colour: Rgb,
) -> CarModel {
    let mut paint = |base, cabin| {
        world.material(Material::Paint(Paint {
            colour,
            size: body.size,
            base,
            cabin,
        }))
    };
    let (shell, cabin) = (paint(FLOOR, false), paint(body.waist, true));
    let mut parts = vec![
        (Shape::Hull(lower), [0.0, 0.0, f64::from(FLOOR)], shell),
        (Shape::Hull(upper), [0.0, 0.0, f64::from(body.waist)], cabin),
    ];
    for (front, left) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
        let wheel = Shape::Wheel {
            radius: WHEEL,
            half_width: 0.1,
        };
        let place = [
            front * 0.3 * f64::from(body.size[0]),
            left * (0.5 * f64::from(body.size[1]) - 0.09),
            f64::from(WHEEL),
        ];
        parts.push((wheel, place, tyre));
    }
    CarModel {
        class: ObjectClass::Car,
        size: body.size,
        parts,
    }
}

/// The plane through two points of the side view; its outside is to the left of the way from a to b.
fn slope(a: [f32; 2], b: [f32; 2]) -> (V3, f32) {
    let normal = V3::new(-(b[1] - a[1]), 0.0, b[0] - a[0]).normalize();
    (normal, normal.x * a[0] + normal.z * a[1])
}

pub(super) fn lower_hull(body: &Body) -> Hull {
    let (half, wide, top) = (0.5 * body.size[0], 0.5 * body.size[1], body.waist - FLOOR);
    let [length, drop] = body.hood;
    let sides = V3::new(0.0, 0.97, -0.243).normalize();
    Hull {
        planes: vec![
            (V3::x(), half),
            (-V3::x(), half),
            (V3::y(), wide),
            (-V3::y(), wide),
            (V3::z(), top),
            (-V3::z(), 0.0),
            slope([half - length, top], [half, top - drop]),
            // The bumpers are rounded below, and the sills lie further in.
            slope([half, 0.22], [half - 0.22, 0.0]),
            slope([0.16 - half, 0.0], [-half, 0.24]),
            slope([-half, top - 0.12], [-half + 0.25, top]),
            (sides, wide * sides.y - 0.12 * -sides.z),
            (
                V3::new(0.0, -sides.y, sides.z),
                wide * sides.y - 0.12 * -sides.z,
            ),
        ],
        bounds: (half, wide, 0.0, top),
    }
}

pub(super) fn upper_hull(body: &Body) -> Hull {
    let (wide, top) = (0.5 * body.size[1] - 0.03, body.size[2] - body.waist);
    let lean = (0.17f32 / top).atan();
    let (sin, cos) = lean.sin_cos();
    let [front, rear] = body.cabin;
    let [roof_front, roof_rear] = body.roof;
    Hull {
        planes: vec![
            slope([roof_front, top], [front, 0.0]),
            slope([rear, 0.0], [roof_rear, top]),
            (V3::new(0.0, cos, sin), wide * cos),
            (V3::new(0.0, -cos, sin), wide * cos),
            (V3::z(), top),
            (-V3::z(), 0.0),
        ],
        bounds: (front.max(-rear), wide, 0.0, top),
    }
}

/// Parks a car.
pub(crate) fn park(world: &mut World, rng: &mut ChaCha8Rng, base: [f64; 3], heading: f64) {
    let index = rng.random_range(0..world.models.len());
    let model = world.models[index].clone();
    let solids = model.solids(base, heading, rng.random(), false);
    world.primitives.extend(solids);
    world.object(ObjectClass::Car, base, heading, model.size.map(f64::from));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hulls_fill_their_bounds() {
        for body in &BODIES {
            for hull in [lower_hull(body), upper_hull(body)] {
                let (x, y, low, high) = hull.bounds;
                let inside = |p: V3| hull.planes.iter().all(|(n, d)| n.dot(&p) <= d + 1e-4);
                let middle = 0.5 * (low + high);
                assert!(inside(V3::new(0.0, 0.0, middle)));
                assert!(!inside(V3::new(x + 0.01, 0.0, middle)));
                assert!(!inside(V3::new(-0.5, y + 0.01, middle)));
                assert!(!inside(V3::new(-0.5, 0.0, high + 0.01)));
                assert!(inside(V3::new(-0.5, 0.0, high - 0.01)));
            }
            let lower = lower_hull(body);
            let out = V3::new(0.0, 0.5 * body.size[1] - 0.005, 0.35);
            assert!(lower.planes.iter().all(|(n, d)| n.dot(&out) <= *d));
        }
    }
}
