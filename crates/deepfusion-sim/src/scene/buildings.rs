//! Houses: walls, roofs, chimneys, balconies.

use super::{ObjectClass, World};
use crate::primitive::{Hull, Shape, V3};
use crate::texture::facade::{Facade, Wall};
use crate::texture::{Material, Rgb};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// Kind of a house.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Style {
    /// In a closed row, two to four floors.
    Terrace,
    /// Alone in a garden.
    Detached,
    /// Large, with shops or offices.
    Commercial,
}

/// Position and size of a house, metres.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plot {
    /// Size along the street.
    pub width: f64,
    /// Size away from the street.
    pub depth: f64,
    /// World x of the middle of the house.
    pub x: f64,
    /// World y of the middle of the house.
    pub y: f64,
    /// Heading along its front.
    pub heading: f64,
    /// Whether the street is to its left (+y); otherwise it is to its right.
    pub street_left: bool,
}

const WALLS: [[f32; 3]; 11] = [
    [0.62, 0.54, 0.40],
    [0.66, 0.64, 0.60],
    [0.50, 0.35, 0.16],
    [0.40, 0.20, 0.13],
    [0.36, 0.35, 0.33],
    [0.45, 0.35, 0.25],
    [0.30, 0.34, 0.37],
    [0.52, 0.42, 0.36],
    [0.33, 0.36, 0.26],
    [0.20, 0.16, 0.14],
    [0.56, 0.47, 0.27],
];
const BRICKS: [[f32; 3]; 4] = [
    [0.30, 0.115, 0.075],
    [0.36, 0.19, 0.11],
    [0.22, 0.10, 0.08],
    [0.42, 0.30, 0.18],
];
const ACCENTS: [[f32; 3]; 7] = [
    [0.08, 0.17, 0.09],
    [0.30, 0.05, 0.04],
    [0.05, 0.10, 0.25],
    [0.22, 0.12, 0.05],
    [0.45, 0.33, 0.05],
    [0.06, 0.06, 0.065],
    [0.35, 0.36, 0.36],
];
const ROOFS: [[f32; 3]; 4] = [
    [0.30, 0.10, 0.06],
    [0.20, 0.075, 0.05],
    [0.12, 0.115, 0.12],
    [0.24, 0.15, 0.10],
];

pub(super) fn pick(rng: &mut ChaCha8Rng, colours: &[[f32; 3]]) -> Rgb {
    let [r, g, b] = colours[rng.random_range(0..colours.len())];
    let mut tone = || rng.random_range(0.85..1.15f32);
    let all = tone();
    Rgb::new(
        r * all * (0.95 + 0.05 * tone()),
        g * all,
        b * all * (0.95 + 0.05 * tone()),
    )
}

/// Builds a house.
pub(super) fn build(world: &mut World, rng: &mut ChaCha8Rng, plot: &Plot, style: Style) {
    let floors = match style {
        Style::Terrace => rng.random_range(2..=4),
        Style::Detached => rng.random_range(1..=2),
        Style::Commercial => rng.random_range(1..=4),
    } as f32;
    let floor = match style {
        Style::Commercial => rng.random_range(3.2..4.0),
        _ => rng.random_range(2.75..3.3f32),
    };
    let height = floors * floor + rng.random_range(0.3..0.9f32);
    let wall = match rng.random_range(0..10) {
        0..=5 => Wall::Plaster,
        6..=7 => Wall::Brick,
        _ => Wall::Stone,
    };
    let colour = if wall == Wall::Brick {
        pick(rng, &BRICKS)
    } else {
        pick(rng, &WALLS)
    };
    let pale = rng.random_range(0.45..0.7f32);
    let trim = if rng.random_bool(0.75) {
        Rgb::new(pale, pale * 0.97, pale * 0.9)
    } else {
        colour * 0.5
    };
    let window = [
        rng.random_range(0.9..1.5f32),
        rng.random_range(1.2..1.75f32),
    ];
    let facade = Facade {
        half: [0.5 * plot.width as f32, 0.5 * plot.depth as f32],
        height,
        wall,
        colour,
        trim,
        accent: pick(rng, &ACCENTS),
        floor,
        pitch: window[0] + rng.random_range(0.9..2.0f32),
        window,
        shutters: style != Style::Commercial && rng.random_bool(0.4),
        shop: match style {
            Style::Commercial => rng.random_bool(0.6),
            Style::Terrace => rng.random_bool(0.25),
            Style::Detached => false,
        },
        ledges: rng.random_bool(0.45),
        grime: rng.random_range(0.2..1.0),
        skin: None,
    };
    let pitch = facade.pitch;
    let accent = facade.accent;
    let material = world.material(Material::Facade(Box::new(facade)));
    let shape = Shape::Box {
        half_x: 0.5 * plot.width as f32,
        half_y: 0.5 * plot.depth as f32,
        height,
    };
    let base = [plot.x, plot.y, 0.0];
    world.solid(shape, base, plot.heading, material, rng.random());
    let flat = style == Style::Commercial && rng.random_bool(0.7) || rng.random_bool(0.15);
    let mut top = f64::from(height);
    if !flat {
        top += add_roof(world, rng, plot, height);
    }
    if style != Style::Detached && floors > 1.5 && rng.random_bool(0.45) {
        add_balconies(world, rng, plot, floor, floors, pitch, &accent);
    }
    world.object(
        ObjectClass::Building,
        base,
        plot.heading,
        [plot.width, plot.depth, top],
    );
}

/// A gable roof along the street, with chimneys; returns its height.
fn add_roof(world: &mut World, rng: &mut ChaCha8Rng, plot: &Plot, height: f32) -> f64 {
    let overhang = 0.35f32;
    let half_x = 0.5 * plot.width as f32 + 0.12;
    let half_y = 0.5 * plot.depth as f32 + overhang;
    let angle = rng.random_range(0.5..0.9f32);
    let ridge = half_y * angle.tan();
    let (sin, cos) = angle.sin_cos();
    let hull = world.hull(Hull {
        planes: vec![
            (V3::new(0.0, sin, cos), half_y * sin),
            (V3::new(0.0, -sin, cos), half_y * sin),
            (V3::x(), half_x),
            (-V3::x(), half_x),
            (-V3::z(), 0.0),
        ],
        bounds: (half_x, half_y, 0.0, ridge),
    });
    let colour = pick(rng, &ROOFS);
    let material = world.material(Material::Roof(colour));
    let base = [plot.x, plot.y, f64::from(height)];
    world.solid(
        Shape::Hull(hull),
        base,
        plot.heading,
        material,
        rng.random(),
    );
    let brick = world.material(Material::Masonry(pick(rng, &BRICKS)));
    for _ in 0..rng.random_range(0..=2) {
        let along = rng.random_range(-0.4..0.4) * plot.width;
        let at = [
            plot.x + along * plot.heading.cos(),
            plot.y + along * plot.heading.sin(),
            f64::from(height + 0.55 * ridge),
        ];
        let shape = Shape::Box {
            half_x: 0.4,
            half_y: 0.3,
            height: 0.45 * ridge + 0.9,
        };
        world.solid(shape, at, plot.heading, brick, rng.random());
    }
    f64::from(ridge)
}

/// Balconies in front of some windows.
fn add_balconies(
    world: &mut World,
    rng: &mut ChaCha8Rng,
    plot: &Plot,
    floor: f32,
    floors: f32,
    pitch: f32,
    accent: &Rgb,
) {
    let material = if rng.random_bool(0.5) {
        world.material(Material::Planks(*accent))
    } else {
        world.material(Material::Masonry(Rgb::new(0.45, 0.43, 0.4)))
    };
    let columns = ((plot.width as f32 - 0.8) / pitch).floor().max(1.0);
    let out = if plot.street_left { 1.0 } else { -1.0 };
    let every = rng.random_range(2..=3);
    for level in 1..floors as i32 {
        for column in (0..columns as i32).step_by(every) {
            if rng.random_bool(0.35) {
                continue;
            }
            let u = f64::from((column as f32 + 0.5 - 0.5 * columns) * pitch);
            let v = out * (0.5 * plot.depth + 0.5);
            let (sin, cos) = plot.heading.sin_cos();
            let at = [
                plot.x + cos * u - sin * v,
                plot.y + sin * u + cos * v,
                f64::from(level as f32 * floor - 0.1),
            ];
            let shape = Shape::Box {
                half_x: 0.42 * pitch,
                half_y: 0.5,
                height: 1.05,
            };
            world.solid(shape, at, plot.heading, material, rng.random());
        }
    }
}
