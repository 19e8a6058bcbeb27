//! People on foot, on bicycles and motorbikes, and parked bicycles and motorbikes.

use super::site::Kit;
use crate::primitive::Shape;
use crate::scene::cars::CarModel;
use crate::scene::{ObjectClass, World};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// Parts of a figure in its own axes: x forward, y left, z up from the ground.
#[derive(Default)]
struct Figure {
    parts: Vec<(Shape, [f64; 3], u32)>,
}

impl Figure {
    fn rod(&mut self, a: [f64; 3], b: [f64; 3], radius: f64, material: u32) {
        let half_axis = [0, 1, 2].map(|i| (0.5 * (b[i] - a[i])) as f32);
        let middle = [0, 1, 2].map(|i| 0.5 * (a[i] + b[i]));
        let shape = Shape::Capsule {
            half_axis,
            radius: radius as f32,
        };
        self.parts.push((shape, middle, material));
    }

    fn ball(&mut self, at: [f64; 3], radii: [f64; 3], material: u32) {
        let shape = Shape::Ellipsoid {
            radii: radii.map(|r| r as f32),
        };
        self.parts.push((shape, at, material));
    }

    fn block(&mut self, at: [f64; 3], size: [f64; 3], material: u32) {
        let shape = Shape::Box {
            half_x: 0.5 * size[0] as f32,
            half_y: 0.5 * size[1] as f32,
            height: size[2] as f32,
        };
        self.parts.push((shape, at, material));
    }

    /// A wheel with a hollow middle: a ring of rods in the plane y = `at[1]`.
    fn ring(&mut self, at: [f64; 3], radius: f64, thick: f64, material: u32) {
        let point = |i: usize| {
            let angle = i as f64 * std::f64::consts::TAU / 9.0;
            [
                at[0] + radius * angle.cos(),
                at[1],
                at[2] + radius * angle.sin(),
            ]
        };
        for i in 0..9 {
            self.rod(point(i), point(i + 1), thick, material);
        }
    }

    /// The model, with the least box centred on the origin that contains it.
    fn model(self, class: ObjectClass) -> CarModel {
        let mut size = [0.0f32; 3];
        for (shape, at, _) in &self.parts {
            let (x, y, top) = match *shape {
                Shape::Capsule {
                    half_axis: [x, y, z],
                    radius,
                } => (x.abs() + radius, y.abs() + radius, z.abs() + radius),
                Shape::Ellipsoid { radii: [x, y, z] } => (x, y, z),
                Shape::Box {
                    half_x,
                    half_y,
                    height,
                } => (half_x, half_y, height),
                _ => (0.0, 0.0, 0.0),
            };
            size[0] = size[0].max(2.0 * (at[0].abs() as f32 + x));
            size[1] = size[1].max(2.0 * (at[1].abs() as f32 + y));
            size[2] = size[2].max(at[2] as f32 + top);
        }
        CarModel {
            class,
            size,
            parts: self.parts,
        }
    }
}

/// Models of all people of a world.
pub(super) fn models(_world: &mut World, rng: &mut ChaCha8Rng, kit: &Kit) -> Vec<CarModel> {
    let mut crowd = Vec::new();
    for _ in 0..14 {
        let mut figure = Figure::default();
        walker(&mut figure, rng, kit);
        crowd.push(figure.model(ObjectClass::Pedestrian));
    }
    for number in 0..8 {
        let mut figure = Figure::default();
        let ridden = number < 4;
        if number % 4 == 3 {
            motorbike(&mut figure, rng, kit);
        } else {
            bicycle(&mut figure, rng, kit);
        }
        if ridden {
            rider(&mut figure, rng, kit);
        }
        crowd.push(figure.model(if ridden {
            ObjectClass::Cyclist
        } else {
            ObjectClass::Bicycle
        }));
    }
    crowd
}

fn any(rng: &mut ChaCha8Rng, of: &[u32]) -> u32 {
    of[rng.random_range(0..of.len())]
}

/// A person who walks or stands, 1.1 to 1.95 m tall.
fn walker(figure: &mut Figure, rng: &mut ChaCha8Rng, kit: &Kit) {
    let tall = if rng.random_bool(0.15) {
        rng.random_range(1.1..1.5)
    } else {
        rng.random_range(1.55..1.95)
    };
    let wide = rng.random_range(0.85..1.2);
    let (coat, legs, shoes) = (
        any(rng, &kit.cloth),
        any(rng, &kit.cloth),
        if rng.random_bool(0.7) {
            kit.dark
        } else {
            any(rng, &kit.cloth)
        },
    );
    let (skin, hair) = (any(rng, &kit.skin), any(rng, &kit.cloth));
    let stride = if rng.random_bool(0.3) {
        0.03
    } else {
        rng.random_range(0.1..0.34)
    } * tall;
    let (hip, shoulder) = (0.5 * tall, 0.8 * tall);
    let sides = [(1.0, stride), (-1.0, -stride)];
    for (side, step) in sides {
        let y = side * 0.055 * tall * wide;
        let foot = [step, y, 0.06];
        let knee = [0.5 * step + 0.05, y, 0.28 * tall];
        figure.rod([0.0, y, hip], knee, 0.046 * tall * wide, legs);
        figure.rod(knee, foot, 0.035 * tall * wide, legs);
        figure.rod(foot, [step + 0.14, y, 0.04], 0.04, shoes);
        // Arms swing in opposition to the legs.
        let out = side * 0.12 * tall * wide;
        let elbow = [-0.4 * step, out * 1.15, 0.62 * tall];
        let hand = [-0.7 * step + 0.08, out * 1.1, 0.48 * tall];
        figure.rod([0.0, out, shoulder], elbow, 0.032 * tall, coat);
        figure.rod(elbow, hand, 0.027 * tall, coat);
        figure.ball(hand, [0.045; 3], skin);
    }
    let long = if rng.random_bool(0.25) { 0.62 } else { 0.95 };
    figure.ball(
        [0.0, 0.0, 0.5 * (long * hip + shoulder) + 0.02 * tall],
        [
            0.075 * tall * wide,
            0.115 * tall * wide,
            0.5 * (shoulder - long * hip) + 0.06 * tall,
        ],
        coat,
    );
    figure.rod(
        [0.0, -0.08 * tall * wide, shoulder - 0.02],
        [0.0, 0.08 * tall * wide, shoulder - 0.02],
        0.05 * tall,
        coat,
    );
    figure.rod([0.0, 0.0, shoulder], [0.01, 0.0, 0.88 * tall], 0.045, skin);
    head(figure, [0.02, 0.0, 0.925 * tall], 0.066 * tall, skin, hair);
    if rng.random_bool(0.35) {
        let bag = any(rng, &kit.cloth);
        if rng.random_bool(0.5) {
            figure.block([-0.19, 0.0, 0.55 * tall], [0.18, 0.3, 0.25 * tall], bag);
        } else {
            figure.block([0.0, 0.3, 0.22 * tall], [0.34, 0.12, 0.26], bag);
        }
    }
}

fn head(figure: &mut Figure, at: [f64; 3], radius: f64, skin: u32, hair: u32) {
    figure.ball(at, [radius * 0.95, radius * 0.8, radius * 1.12], skin);
    let back = [at[0] - 0.3 * radius, at[1], at[2] + 0.25 * radius];
    figure.ball(back, [radius, radius * 0.9, radius * 0.98], hair);
}

fn bicycle(figure: &mut Figure, rng: &mut ChaCha8Rng, kit: &Kit) {
    let frame = any(rng, &kit.metal);
    let radius = 0.33;
    let (rear, front) = ([-0.52, 0.0, 0.34], [0.53, 0.0, 0.34]);
    for hub in [rear, front] {
        figure.ring(hub, radius, 0.02, kit.dark);
    }
    let (crank, saddle, head) = ([-0.08, 0.0, 0.3], [-0.25, 0.0, 0.88], [0.36, 0.0, 0.85]);
    for (a, b) in [
        (rear, crank),
        (rear, saddle),
        (crank, saddle),
        (crank, head),
        (saddle, head),
        (head, front),
    ] {
        figure.rod(a, b, 0.018, frame);
    }
    figure.rod(head, [0.3, 0.0, 1.02], 0.015, frame);
    figure.rod([0.28, -0.28, 1.04], [0.28, 0.28, 1.04], 0.016, kit.dark);
    figure.ball([-0.27, 0.0, 0.93], [0.14, 0.07, 0.04], kit.dark);
}

fn motorbike(figure: &mut Figure, rng: &mut ChaCha8Rng, kit: &Kit) {
    let paint = any(rng, &kit.metal);
    for x in [-0.68, 0.7] {
        figure.ring([x, 0.0, 0.32], 0.26, 0.07, kit.dark);
    }
    figure.ball([0.0, 0.0, 0.5], [0.42, 0.2, 0.24], kit.dark);
    figure.ball([0.2, 0.0, 0.82], [0.33, 0.17, 0.16], paint);
    figure.block([-0.4, 0.0, 0.72], [0.75, 0.28, 0.12], kit.dark);
    figure.rod([0.7, 0.0, 0.32], [0.45, 0.0, 0.98], 0.05, paint);
    figure.rod([0.42, -0.36, 1.04], [0.42, 0.36, 1.04], 0.022, kit.dark);
    figure.rod([-0.68, 0.12, 0.34], [0.1, 0.12, 0.4], 0.06, paint);
}

fn rider(figure: &mut Figure, rng: &mut ChaCha8Rng, kit: &Kit) {
    let (coat, legs) = (any(rng, &kit.cloth), any(rng, &kit.cloth));
    let (skin, helmet) = (any(rng, &kit.skin), any(rng, &kit.metal));
    let lean = rng.random_range(0.05..0.3);
    let shoulder = [lean - 0.15, 0.0, 1.45];
    figure.rod([-0.27, 0.0, 1.0], shoulder, 0.15, coat);
    for (side, up) in [(1.0, 0.16), (-1.0, -0.12)] {
        let knee = [0.16, side * 0.13, 0.75 + up];
        figure.rod([-0.24, side * 0.09, 0.98], knee, 0.075, legs);
        figure.rod(knee, [-0.02, side * 0.12, 0.3 + up], 0.055, legs);
        figure.rod(
            [-0.02, side * 0.12, 0.28 + up],
            [0.14, side * 0.12, 0.26 + up],
            0.042,
            kit.dark,
        );
        let elbow = [lean + 0.05, side * 0.26, 1.2];
        figure.rod([shoulder[0], side * 0.19, 1.42], elbow, 0.05, coat);
        figure.rod(elbow, [0.3, side * 0.25, 1.07], 0.042, coat);
    }
    head(figure, [shoulder[0] + 0.09, 0.0, 1.7], 0.115, skin, helmet);
}
