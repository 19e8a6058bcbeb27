//! Shared by the builders of varied worlds: spots, materials, and solids with sizes in metres.

use super::Variety;
use crate::crown::Crown;
use crate::primitive::{Hull, Primitive, Shape, V3};
use crate::scene::cars::CarModel;
use crate::scene::{ObjectClass, World};
use crate::texture::leaves::Leaves;
use crate::texture::pattern::{Kind, Pattern, colour, wall_colour};
use crate::texture::{Material, Rgb};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// A position and a heading in the world.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spot {
    /// World x, metres.
    pub x: f64,
    /// World y, metres.
    pub y: f64,
    /// World z, metres.
    pub z: f64,
    /// Heading of the spot's x axis, radians.
    pub heading: f64,
}

impl Spot {
    /// The world point with these coordinates in the spot's axes (x along its heading, y left, z up).
    pub(super) fn at(&self, x: f64, y: f64, z: f64) -> [f64; 3] {
        let (sin, cos) = self.heading.sin_cos();
        [
            self.x + cos * x - sin * y,
            self.y + sin * x + cos * y,
            self.z + z,
        ]
    }

    /// A spot given in this one's axes, turned by `turn`.
    pub(super) fn spot(&self, x: f64, y: f64, z: f64, turn: f64) -> Self {
        let [x, y, z] = self.at(x, y, z);
        Self {
            x,
            y,
            z,
            heading: self.heading + turn,
        }
    }
}

/// A kind of tree or bush.
#[derive(Debug, Clone, Copy)]
pub(super) struct Species {
    /// The leaves' materials, from the shaded ones below to those in the light.
    pub leaves: [u32; 3],
    /// Side of the cells that contain its clumps, metres.
    pub cell: f32,
    /// Density of the crown, 0 to 1.
    pub fill: f32,
    /// Whether it has no leaves.
    pub bare: bool,
    /// Whether it is a conifer, with needles in tiers.
    pub conifer: bool,
    /// Width of the crown divided by its height.
    pub spread: f32,
    /// Material of the trunk.
    pub bark: u32,
}

/// Materials of one world.
pub(super) struct Kit {
    /// Materials with random patterns.
    pub wild: Vec<u32>,
    /// Painted and bare metal.
    pub metal: Vec<u32>,
    /// Boards.
    pub wood: Vec<u32>,
    /// Garden walls, plinths, piers.
    pub stone: Vec<u32>,
    /// Clothes, awnings, cushions.
    pub cloth: Vec<u32>,
    /// Signs.
    pub signs: Vec<u32>,
    /// Roofs.
    pub roofs: Vec<u32>,
    /// Skin.
    pub skin: Vec<u32>,
    /// Nearly black.
    pub dark: u32,
    /// Nearly white.
    pub pale: u32,
    /// Wheels.
    pub tyre: u32,
    /// Trees.
    pub trees: Vec<Species>,
    /// Hedges and bushes.
    pub bushes: Vec<Species>,
}

fn plain(world: &mut World, rng: &mut ChaCha8Rng, tint: Rgb) -> u32 {
    let pattern = Pattern::plain(rng, tint);
    world.material(Material::Pattern(Box::new(pattern)))
}

impl Kit {
    /// Draws the materials of a world.
    pub(super) fn new(world: &mut World, rng: &mut ChaCha8Rng, variety: &Variety) -> Self {
        let wild = (0..26)
            .map(|_| {
                let pattern = Pattern::wild(rng);
                world.material(Material::Pattern(Box::new(pattern)))
            })
            .collect();
        let metal = (0..10)
            .map(|i| {
                let tone = 0.02 * 35f32.powf(rng.random_range(0.0..1.0));
                let tint = if i < 6 {
                    Rgb::new(tone, tone, tone)
                } else {
                    colour(rng, 1.0)
                };
                plain(world, rng, tint)
            })
            .collect();
        let wood = (0..6)
            .map(|_| {
                let painted = wall_colour(rng);
                let mut pattern = Pattern::plain(rng, painted);
                let tone = rng.random_range(0.06..0.45f32);
                let brown = Rgb::new(tone, tone * 0.68, tone * rng.random_range(0.3..0.6));
                if rng.random_bool(0.6) {
                    pattern.colours[0] = brown;
                }
                pattern.kind = Kind::Boards;
                pattern.scale = rng.random_range(0.06..0.25);
                pattern.colours[1] = pattern.colours[0] * 0.15;
                if rng.random_bool(0.3) {
                    pattern.turn = (0.0, 1.0);
                }
                world.material(Material::Pattern(Box::new(pattern)))
            })
            .collect();
        let stone = (0..7)
            .map(|_| {
                let mut pattern = Pattern::wall(rng);
                if rng.random_bool(0.3) {
                    pattern.posters = rng.random_range(0.0..0.5);
                }
                world.material(Material::Pattern(Box::new(pattern)))
            })
            .collect();
        let cloth = (0..22)
            .map(|i| {
                let tint = if i % 3 == 0 {
                    let tone = rng.random_range(0.015..0.12f32);
                    Rgb::new(tone, tone, tone * rng.random_range(0.9..1.6))
                } else {
                    colour(rng, 1.0)
                };
                let mut pattern = if rng.random_bool(0.25) {
                    Pattern::wild(rng)
                } else {
                    Pattern::plain(rng, tint)
                };
                pattern.scale = pattern.scale.clamp(0.03, 0.25);
                pattern.dirt = 0.0;
                world.material(Material::Pattern(Box::new(pattern)))
            })
            .collect();
        let signs = (0..12)
            .map(|i| {
                let bold: [[f32; 3]; 6] = [
                    [0.55, 0.02, 0.02],
                    [0.02, 0.07, 0.38],
                    [0.75, 0.55, 0.02],
                    [0.75, 0.75, 0.73],
                    [0.02, 0.25, 0.1],
                    [0.03, 0.03, 0.03],
                ];
                let [r, g, b] = bold[i % 6];
                let other = if rng.random_bool(0.6) {
                    Rgb::new(0.78, 0.78, 0.76)
                } else {
                    colour(rng, 1.0)
                };
                world.material(Material::Sign(Rgb::new(r, g, b), other))
            })
            .collect();
        let roofs = (0..8)
            .map(|_| {
                let tone = rng.random_range(0.03..0.4f32);
                let red = rng.random_range(0.0..0.7f32);
                let tint = Rgb::new(
                    tone * (1.0 + 0.5 * red),
                    tone * (1.0 - 0.4 * red),
                    tone * (1.0 - 0.6 * red),
                );
                if rng.random_bool(0.75) {
                    world.material(Material::Roof(tint))
                } else {
                    let mut pattern = Pattern::plain(rng, tint);
                    pattern.kind = Kind::Corrugated;
                    pattern.scale = rng.random_range(0.1..0.5);
                    world.material(Material::Pattern(Box::new(pattern)))
                }
            })
            .collect();
        let skin = (0..4)
            .map(|_| {
                let tone = rng.random_range(0.08..0.55f32);
                plain(world, rng, Rgb::new(tone, tone * 0.68, tone * 0.52))
            })
            .collect();
        let (dark, pale) = (
            plain(world, rng, Rgb::new(0.02, 0.02, 0.022)),
            plain(world, rng, Rgb::new(0.72, 0.72, 0.7)),
        );
        let tyre = world.material(Material::Tyre);
        let trees = (0..7)
            .map(|_| species(world, rng, variety, false))
            .collect();
        let bushes = (0..5).map(|_| species(world, rng, variety, true)).collect();
        Self {
            wild,
            metal,
            wood,
            stone,
            cloth,
            signs,
            roofs,
            skin,
            dark,
            pale,
            tyre,
            trees,
            bushes,
        }
    }
}

fn species(world: &mut World, rng: &mut ChaCha8Rng, variety: &Variety, bush: bool) -> Species {
    let bare = !bush && rng.random_bool(variety.bare);
    let conifer = !bush && !bare && rng.random_bool(0.15);
    let turned = !conifer && rng.random_bool(variety.autumn);
    let tone = rng.random_range(0.55..1.7f32);
    let green = Rgb::new(
        rng.random_range(0.045..0.12),
        rng.random_range(0.09..0.15),
        rng.random_range(0.015..0.05),
    );
    let red = Rgb::new(
        rng.random_range(0.25..0.45),
        rng.random_range(0.07..0.3),
        0.03,
    );
    let colour = if turned { red } else { green } * tone;
    let other = match rng.random_range(0..6) {
        0 => Rgb::new(0.4, 0.3, 0.05),
        1 => Rgb::new(0.55, 0.4, 0.42),
        _ => colour * 1.5,
    };
    let share = if rng.random_bool(0.3) {
        rng.random_range(0.0..0.4)
    } else {
        0.05
    };
    let (cell, fill) = if bush {
        (rng.random_range(0.1..0.22), rng.random_range(0.7..1.0))
    } else {
        (rng.random_range(0.2..0.5), rng.random_range(0.45..1.0f32))
    };
    let leaves = [0.55, 0.85, 1.15].map(|light| {
        world.material(Material::Leaves(Leaves {
            colour: colour * light,
            other: other * light,
            turned: share,
            cell,
            fill,
        }))
    });
    let tone = 0.03 * 10f32.powf(rng.random_range(0.0..1.0));
    let bark = world.material(Material::Bark(Rgb::new(
        tone,
        tone * rng.random_range(0.75..1.0),
        tone * rng.random_range(0.55..0.95),
    )));
    Species {
        leaves,
        cell,
        fill,
        bare,
        conifer,
        spread: if rng.random_bool(0.15) {
            0.35
        } else {
            rng.random_range(0.6..1.3)
        },
        bark,
    }
}

/// A world being built.
pub(super) struct Site<'a> {
    /// The world.
    pub world: &'a mut World,
    /// Source of all random draws.
    pub rng: &'a mut ChaCha8Rng,
    /// Materials of the world.
    pub kit: &'a Kit,
    /// Variety of the world.
    pub variety: &'a Variety,
}

impl Site<'_> {
    /// One of these materials.
    pub(super) fn any(&mut self, of: &[u32]) -> u32 {
        of[self.rng.random_range(0..of.len())]
    }

    /// One of these materials, or sometimes a wild one.
    pub(super) fn any_or_wild(&mut self, of: &[u32]) -> u32 {
        if self.rng.random_bool(self.variety.wild) {
            let kit = self.kit;
            self.any(&kit.wild)
        } else {
            self.any(of)
        }
    }

    /// A uniform draw.
    pub(super) fn draw(&mut self, from: f64, to: f64) -> f64 {
        self.rng.random_range(from..to)
    }

    /// True with this probability.
    pub(super) fn chance(&mut self, probability: f64) -> bool {
        self.rng.random_bool(probability.clamp(0.0, 1.0))
    }

    /// The spot `lateral` metres left of the centreline at `s`, on the ground.
    pub(super) fn beside(&self, s: f64, lateral: f64) -> Spot {
        let (x, y, heading) = self.world.road.world(s, lateral);
        let p = self.world.road.locate(x, y);
        let z = if self.world.road.kerb_distance(&p) > 0.0 {
            f64::from(self.world.road.kerb)
        } else {
            0.0
        };
        Spot { x, y, z, heading }
    }

    /// Whether a rectangle around a spot keeps `clear` metres from every kerb.
    pub(super) fn is_clear(&self, spot: &Spot, half: [f64; 2], clear: f32) -> bool {
        self.world
            .is_clear(spot.x, spot.y, spot.heading, half, clear)
    }

    /// A box of this length, width and height that stands on a spot.
    pub(super) fn block(&mut self, spot: &Spot, size: [f64; 3], material: u32) {
        let seed = self.rng.random();
        let shape = Shape::Box {
            half_x: 0.5 * size[0] as f32,
            half_y: 0.5 * size[1] as f32,
            height: size[2] as f32,
        };
        self.world
            .solid(shape, spot.at(0.0, 0.0, 0.0), spot.heading, material, seed);
    }

    /// An upright cylinder.
    pub(super) fn column(&mut self, spot: &Spot, radius: f64, height: f64, material: u32) {
        let seed = self.rng.random();
        let shape = Shape::Cylinder {
            radius: radius as f32,
            height: height as f32,
        };
        self.world
            .solid(shape, spot.at(0.0, 0.0, 0.0), spot.heading, material, seed);
    }

    /// An ellipsoid around a spot.
    pub(super) fn ball(&mut self, spot: &Spot, radii: [f64; 3], material: u32) {
        let seed = self.rng.random();
        let shape = Shape::Ellipsoid {
            radii: radii.map(|r| r as f32),
        };
        self.world
            .solid(shape, spot.at(0.0, 0.0, 0.0), spot.heading, material, seed);
    }

    /// A round-ended rod between two points of the world.
    pub(super) fn rod(&mut self, a: [f64; 3], b: [f64; 3], radius: f64, material: u32) {
        let seed = self.rng.random();
        let middle = [0, 1, 2].map(|i| 0.5 * (a[i] + b[i]));
        let half_axis = [0, 1, 2].map(|i| (0.5 * (b[i] - a[i])) as f32);
        if half_axis.iter().map(|x| x * x).sum::<f32>() < 1e-8 {
            return;
        }
        let shape = Shape::Capsule {
            half_axis,
            radius: radius as f32,
        };
        self.world.solid(shape, middle, 0.0, material, seed);
    }

    /// A lobe of leaves around a point; `light` chooses its brightness, from 0 to 2.
    pub(super) fn lobe(&mut self, at: [f64; 3], radii: [f64; 3], species: &Species, light: usize) {
        let salt = self.rng.random();
        let crown = Crown {
            radii: radii.map(|r| r as f32),
            cell: species.cell,
            fill: species.fill,
            salt,
        };
        let heading = self.draw(0.0, std::f64::consts::TAU);
        let material = species.leaves[light.min(2)];
        self.world
            .solid(Shape::Crown(crown), at, heading, material, salt);
    }

    /// A convex solid with this outline in its x–z plane (counter-clockwise seen from −y) and this width along y.
    pub(super) fn prism(&mut self, spot: &Spot, outline: &[[f64; 2]], width: f64, material: u32) {
        let count = outline.len();
        let mut planes: Vec<(V3, f32)> = (0..count)
            .map(|i| {
                let (a, b) = (outline[i], outline[(i + 1) % count]);
                // The outside is to the right of the way from a to b.
                let normal = V3::new((b[1] - a[1]) as f32, 0.0, (a[0] - b[0]) as f32).normalize();
                (normal, normal.x * a[0] as f32 + normal.z * a[1] as f32)
            })
            .collect();
        let half = 0.5 * width as f32;
        planes.push((V3::y(), half));
        planes.push((-V3::y(), half));
        let reach = |i: usize| outline.iter().map(move |p| p[i] as f32);
        let hull = self.world.hull(Hull {
            planes,
            bounds: (
                reach(0).map(f32::abs).fold(0.0, f32::max),
                half,
                reach(1).fold(f32::MAX, f32::min),
                reach(1).fold(f32::MIN, f32::max),
            ),
        });
        let seed = self.rng.random();
        self.world.solid(
            Shape::Hull(hull),
            spot.at(0.0, 0.0, 0.0),
            spot.heading,
            material,
            seed,
        );
    }

    /// Number of solids so far: the index of the next object's first solid.
    pub(super) fn mark(&self) -> usize {
        self.world.primitives.len()
    }

    /// Adds the solids since `mark` as one object; its box is along the spot's axes and contains them.
    pub(super) fn close(&mut self, class: ObjectClass, spot: &Spot, mark: usize) {
        let solids = &self.world.primitives[mark..];
        if let Some((base, size)) = boxed(self.world, spot, solids) {
            self.world.object(class, base, spot.heading, size);
        }
    }

    /// Puts a model (a car, a person) on a spot.
    pub(super) fn put(&mut self, model: &CarModel, spot: &Spot) {
        let seed = self.rng.random();
        let base = [spot.x, spot.y, spot.z];
        let solids = model.solids(base, spot.heading, seed, false);
        self.world.primitives.extend(solids);
        let size = model.size.map(f64::from);
        self.world.object(model.class, base, spot.heading, size);
    }

    /// A vehicle among the world's models for which `fits` is true.
    pub(super) fn vehicle(&mut self, fits: impl Fn(&CarModel) -> bool) -> Option<CarModel> {
        let count = self.world.models.len();
        let from = self.rng.random_range(0..count.max(1));
        (0..count)
            .map(|i| &self.world.models[(from + i * 7) % count])
            .find(|model| fits(model))
            .cloned()
    }

    /// A person of this class from the world's crowd.
    pub(super) fn person(&mut self, class: ObjectClass) -> Option<CarModel> {
        let those: Vec<usize> = (0..self.world.crowd.len())
            .filter(|i| self.world.crowd[*i].class == class)
            .collect();
        let index = *those.get(self.rng.random_range(0..those.len().max(1)))?;
        Some(self.world.crowd[index].clone())
    }
}

/// Middle of the underside and size of the least box along a spot's axes that contains these solids.
pub(super) fn boxed(
    world: &World,
    spot: &Spot,
    solids: &[Primitive],
) -> Option<([f64; 3], [f64; 3])> {
    let (mut low, mut high) = ([f64::MAX; 3], [f64::MIN; 3]);
    for solid in solids {
        let (half_x, half_y, from, to) = solid.bounds(&world.hulls);
        let (c, s) = (f64::from(solid.heading.0), f64::from(solid.heading.1));
        for corner in 0..8 {
            let x = f64::from(if corner & 1 == 0 { -half_x } else { half_x });
            let y = f64::from(if corner & 2 == 0 { -half_y } else { half_y });
            let z = f64::from(if corner & 4 == 0 { from } else { to });
            let (dx, dy) = (
                solid.position[0] + c * x - s * y - spot.x,
                solid.position[1] + s * x + c * y - spot.y,
            );
            let (sin, cos) = spot.heading.sin_cos();
            let p = [
                cos * dx + sin * dy,
                cos * dy - sin * dx,
                solid.position[2] + z - spot.z,
            ];
            for i in 0..3 {
                low[i] = low[i].min(p[i]);
                high[i] = high[i].max(p[i]);
            }
        }
    }
    if solids.is_empty() {
        return None;
    }
    let size = [0, 1, 2].map(|i| high[i] - low[i]);
    let base = spot.at(0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), low[2]);
    Some((base, size))
}
