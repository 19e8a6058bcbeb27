//! Vehicles: cars of many shapes and paints, vans, lorries, buses, trams.

use super::site::Kit;
use crate::primitive::{Hull, Shape, V3};
use crate::scene::cars::{self, BODIES, Body, CarModel};
use crate::scene::{ObjectClass, World};
use crate::texture::objects::Paint;
use crate::texture::pattern::colour;
use crate::texture::{Material, Rgb};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// White, silver, greys and black for most cars; any other colour for the rest.
fn paint(rng: &mut ChaCha8Rng) -> Rgb {
    let grey = |tone: f32| Rgb::new(tone, tone, tone * 1.02);
    match rng.random_range(0..20) {
        0..=3 => grey(rng.random_range(0.012..0.03)),
        4..=6 => grey(rng.random_range(0.03..0.12)),
        7..=10 => grey(rng.random_range(0.2..0.5)),
        11..=13 => grey(rng.random_range(0.6..0.85)),
        14..=15 => Rgb::new(0.02, 0.04, rng.random_range(0.08..0.3)),
        16..=17 => Rgb::new(rng.random_range(0.15..0.5), 0.02, 0.02),
        _ => colour(rng, 1.0),
    }
}

/// Models of every kind of vehicle; most are cars.
pub(super) fn vehicles(world: &mut World, rng: &mut ChaCha8Rng, kit: &Kit) -> Vec<CarModel> {
    let mut models = Vec::new();
    for number in 0..36 {
        let body = varied(rng, &BODIES[number % BODIES.len()]);
        let (lower, upper) = (cars::lower_hull(&body), cars::upper_hull(&body));
        let (lower, upper) = (world.hull(lower), world.hull(upper));
        let colour = paint(rng);
        let mut model = cars::model(world, &body, lower, upper, kit.tyre, colour);
        // The wheels project a little from the body.
        model.size[1] += 0.04;
        if number % BODIES.len() == 4 {
            model.class = ObjectClass::Van;
        }
        models.push(model);
    }
    for _ in 0..4 {
        let body = Body {
            size: [
                rng.random_range(5.0..6.6),
                rng.random_range(1.95..2.1),
                rng.random_range(2.2..2.8),
            ],
            waist: rng.random_range(1.2..1.5),
            cabin: [0.0; 2],
            roof: [0.0; 2],
            hood: [rng.random_range(0.5..1.0), rng.random_range(0.25..0.5)],
        };
        models.push(van(world, rng, kit, body));
    }
    for _ in 0..5 {
        models.push(lorry(world, rng, kit));
    }
    for _ in 0..2 {
        models.push(coach(world, rng, kit, false));
    }
    models.push(coach(world, rng, kit, true));
    models
}

fn varied(rng: &mut ChaCha8Rng, body: &Body) -> Body {
    let mut body = *body;
    let [l, w, h] = [
        rng.random_range(0.93..1.09f32),
        rng.random_range(0.96..1.05f32),
        rng.random_range(0.95..1.07f32),
    ];
    body.size = [body.size[0] * l, body.size[1] * w, body.size[2] * h];
    body.waist *= h;
    for x in [&mut body.cabin, &mut body.roof] {
        x[0] = x[0] * l + rng.random_range(-0.08..0.08);
        x[1] = (x[1] * l + rng.random_range(-0.1..0.1)).max(-0.49 * body.size[0]);
    }
    body.roof[1] = body.roof[1].max(body.cabin[1] + 0.05);
    body.hood[1] *= rng.random_range(0.7..1.3);
    body
}

/// A box with upright sides and a bevel at the upper front edge: its length along the top, and its height.
fn shell(half: f32, wide: f32, top: f32, bevel: [f32; 2]) -> Hull {
    let mut planes = vec![
        (V3::x(), half),
        (-V3::x(), half),
        (V3::y(), wide),
        (-V3::y(), wide),
        (V3::z(), top),
        (-V3::z(), 0.0),
    ];
    let normal = V3::new(bevel[1], 0.0, bevel[0]).normalize();
    planes.push((normal, normal.x * half + normal.z * (top - bevel[1])));
    Hull {
        planes,
        bounds: (half, wide, 0.0, top),
    }
}

/// Collects the parts of a model.
struct ModelParts<'a> {
    world: &'a mut World,
    parts: Vec<(Shape, [f64; 3], u32)>,
}

impl ModelParts<'_> {
    fn hull(&mut self, hull: Hull, at: [f64; 3], material: u32) {
        let index = self.world.hull(hull);
        self.parts.push((Shape::Hull(index), at, material));
    }

    fn block(&mut self, size: [f32; 3], at: [f64; 3], material: u32) {
        let shape = Shape::Box {
            half_x: 0.5 * size[0],
            half_y: 0.5 * size[1],
            height: size[2],
        };
        self.parts.push((shape, at, material));
    }

    fn wheels(&mut self, axles: &[f32], out: f32, radius: f32, tyre: u32) {
        for x in axles {
            for side in [-1.0, 1.0] {
                let wheel = Shape::Wheel {
                    radius,
                    half_width: 0.13,
                };
                let at = [
                    f64::from(*x),
                    side * f64::from(out - 0.14),
                    f64::from(radius),
                ];
                self.parts.push((wheel, at, tyre));
            }
        }
    }
}

fn painted(world: &mut World, colour: Rgb, size: [f32; 3], base: f32, cabin: bool) -> u32 {
    world.material(Material::Paint(Paint {
        colour,
        size,
        base,
        cabin,
    }))
}

fn van(world: &mut World, rng: &mut ChaCha8Rng, kit: &Kit, body: Body) -> CarModel {
    let colour = paint(rng);
    let lower = painted(world, colour, body.size, 0.24, false);
    let upper = painted(world, colour, body.size, body.waist, true);
    let side = kit.wild[rng.random_range(0..kit.wild.len())];
    let load = if rng.random_bool(0.4) { side } else { lower };
    let mut parts = ModelParts {
        world,
        parts: Vec::new(),
    };
    let [l, w, h] = body.size;
    parts.hull(
        shell(0.5 * l, 0.5 * w, body.waist - 0.24, body.hood),
        [0.0, 0.0, 0.24],
        lower,
    );
    // The cab's glass in front, the load behind it.
    let cab = 1.5f32;
    let slope = rng.random_range(0.5..0.9);
    let front = 0.5 * l - body.hood[0] - 0.5 * cab;
    parts.hull(
        shell(
            0.5 * cab,
            0.5 * w - 0.02,
            h - body.waist,
            [slope, h - body.waist],
        ),
        [f64::from(front), 0.0, f64::from(body.waist)],
        upper,
    );
    let length = 0.5 * l + front - 0.5 * cab + 0.05;
    parts.block(
        [length, w - 0.02, h - body.waist],
        [
            f64::from(0.5 * length - 0.5 * l),
            0.0,
            f64::from(body.waist),
        ],
        load,
    );
    parts.wheels(&[0.31 * l, -0.3 * l], 0.5 * w, 0.34, kit.tyre);
    CarModel {
        class: ObjectClass::Van,
        size: [l, w + 0.02, h],
        parts: parts.parts,
    }
}

fn lorry(world: &mut World, rng: &mut ChaCha8Rng, kit: &Kit) -> CarModel {
    let w = rng.random_range(2.3..2.55f32);
    let h = rng.random_range(2.9..4.0f32);
    let l = rng.random_range(7.0..16.0f32);
    let cab = rng.random_range(1.8..2.4f32);
    let size = [l, w, h];
    let tint = paint(rng);
    let cab_height = rng.random_range(2.5..3.3f32).min(h);
    let front = painted(world, tint, [cab, w, cab_height], 0.5, false);
    let glass = painted(world, tint, [cab, w, cab_height], 1.6, true);
    let load = kit.wild[rng.random_range(0..kit.wild.len())];
    let plain = kit.metal[rng.random_range(0..kit.metal.len())];
    let mut parts = ModelParts {
        world,
        parts: Vec::new(),
    };
    let at = f64::from(0.5 * l - 0.5 * cab);
    parts.hull(
        shell(0.5 * cab, 0.5 * w, 1.1, [0.1, 0.1]),
        [at, 0.0, 0.5],
        front,
    );
    parts.hull(
        shell(0.5 * cab, 0.5 * w - 0.02, cab_height - 1.6, [0.5, 0.9]),
        [at, 0.0, 1.6],
        glass,
    );
    let length = l - cab - 0.4;
    let middle = f64::from(0.5 * length - 0.5 * l);
    parts.block([l - 0.8, 0.9, 0.35], [-0.3, 0.0, 0.6], kit.dark);
    let top = match rng.random_range(0..5) {
        0 => {
            // A flat bed with a load.
            parts.block([length, w, 0.5], [middle, 0.0, 0.95], plain);
            parts.block([0.6 * length, 0.8 * w, 1.0], [middle, 0.0, 1.45], load);
            2.45
        }
        1 => {
            let tank = Shape::Ellipsoid {
                radii: [0.5 * length, 0.5 * w, 0.5 * (h - 1.2)],
            };
            parts
                .parts
                .push((tank, [middle, 0.0, f64::from(0.5 * (h + 1.1))], plain));
            parts.block([length, 1.2, 0.3], [middle, 0.0, 0.95], kit.dark);
            size[2]
        }
        _ => {
            let material = if rng.random_bool(0.5) { load } else { plain };
            parts.block([length, w, h - 1.0], [middle, 0.0, 1.0], material);
            size[2]
        }
    };
    parts.wheels(
        &[0.5 * l - 0.9, -0.28 * l, -0.28 * l - 1.15],
        0.5 * w,
        0.48,
        kit.tyre,
    );
    CarModel {
        class: ObjectClass::Truck,
        size: [size[0], size[1] + 0.02, top.max(cab_height)],
        parts: parts.parts,
    }
}

/// A bus or a tram.
fn coach(world: &mut World, rng: &mut ChaCha8Rng, kit: &Kit, tram: bool) -> CarModel {
    let l = if tram {
        rng.random_range(18.0..26.0f32)
    } else {
        rng.random_range(9.0..13.0f32)
    };
    let (w, h) = (2.5f32, rng.random_range(2.9..3.4f32));
    let tint = colour(rng, 1.0);
    let size = [l, w, h];
    let lower = painted(world, tint, size, 0.35, false);
    let upper = painted(world, tint, size, 1.15, true);
    let mut parts = ModelParts {
        world,
        parts: Vec::new(),
    };
    parts.hull(
        shell(0.5 * l, 0.5 * w, 0.8, [0.05, 0.05]),
        [0.0, 0.0, 0.35],
        lower,
    );
    parts.hull(
        shell(0.5 * l - 0.02, 0.5 * w - 0.02, h - 1.45, [0.3, 1.2]),
        [0.0, 0.0, 1.15],
        upper,
    );
    let roof = kit.metal[rng.random_range(0..kit.metal.len())];
    parts.block(
        [l - 0.4, w - 0.1, 0.3],
        [0.0, 0.0, f64::from(h - 0.3)],
        roof,
    );
    parts.wheels(&[0.33 * l, -0.27 * l], 0.5 * w, 0.46, kit.tyre);
    CarModel {
        class: if tram {
            ObjectClass::Tram
        } else {
            ObjectClass::Truck
        },
        size: [l, w + 0.02, h],
        parts: parts.parts,
    }
}
