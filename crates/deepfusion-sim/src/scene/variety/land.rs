//! Large objects: hills on the horizon, banks beside the road, bridges over it, wires.

use super::site::{Site, Spot};
use crate::primitive::{Primitive, Shape};
use crate::scene::ObjectClass;
use crate::texture::Material;
use crate::texture::Rgb;
use crate::texture::pattern::{Kind, Pattern};
use rand::Rng;

impl Site<'_> {
    /// Adds distant hills on both sides and ahead, with this probability.
    pub(super) fn hills(&mut self, probability: f64) {
        if !self.chance(probability) {
            return;
        }
        let tone = self.rng.random_range(0.5..1.6f32);
        let mut forest = Pattern::plain(self.rng, Rgb::new(0.06, 0.09, 0.035) * tone);
        forest.kind = Kind::Blotches;
        forest.scale = 25.0;
        forest.colours[1] = Rgb::new(0.16, 0.17, 0.06) * tone;
        forest.grain = [4.0, 0.5];
        forest.dirt = 0.0;
        let material = self.world.material(Material::Pattern(Box::new(forest)));
        let (mut s, end) = (self.world.road.start - 200.0, self.world.road.end() + 300.0);
        let high = self.draw(8.0, 60.0);
        while s < end {
            for side in [-1.0, 1.0] {
                let (long, wide) = (self.draw(80.0, 220.0), self.draw(50.0, 90.0));
                let out = side * (wide + self.draw(90.0, 260.0));
                let clamped = s.clamp(self.world.road.start, self.world.road.end());
                let spot = self.beside(clamped, out).spot(s - clamped, 0.0, 0.0, 0.0);
                let position = [spot.x, spot.y, -0.3 * high];
                self.world.far.push(Primitive {
                    position,
                    heading: (spot.heading.cos() as f32, spot.heading.sin() as f32),
                    shape: Shape::Ellipsoid {
                        radii: [long, wide, high * 1.3].map(|r| r as f32),
                    },
                    material,
                    seed: self.rng.random(),
                    moving: false,
                });
            }
            s += self.draw(90.0, 260.0);
        }
        // A hill across the end of the road.
        let beyond = self.world.road.end();
        let spot = self.beside(beyond, 0.0).spot(260.0, 0.0, 0.0, 0.0);
        self.world.far.push(Primitive {
            position: [spot.x, spot.y, -0.3 * high],
            heading: (spot.heading.cos() as f32, spot.heading.sin() as f32),
            shape: Shape::Ellipsoid {
                radii: [90.0, 400.0, (1.1 * high) as f32],
            },
            material,
            seed: self.rng.random(),
            moving: false,
        });
    }

    /// Wires over the street, between its sides or along it.
    pub(super) fn wires(&mut self) {
        if !self.chance(0.3) {
            return;
        }
        let along = self.chance(0.5);
        let height = self.draw(5.0, 8.0);
        let (mut s, end) = (self.world.road.start + 5.0, self.world.road.end() - 40.0);
        let material = self.kit.dark;
        while s < end {
            if along {
                let step = 25.0;
                for lateral in [-1.65, 1.65] {
                    let a = self.world.road.world(s, lateral);
                    let b = self.world.road.world(s + step, lateral);
                    self.rod([a.0, a.1, height], [b.0, b.1, height], 0.012, material);
                }
                s += step;
            } else {
                let a = self.world.road.world(s, -9.0);
                let beyond = s + self.draw(-4.0, 4.0);
                let b = self.world.road.world(beyond, 9.0);
                self.rod([a.0, a.1, height], [b.0, b.1, height], 0.015, material);
                s += self.draw(15.0, 40.0);
            }
        }
    }

    /// A bridge over the road at `s`, with piers `out` metres from the centreline.
    pub(super) fn bridge(&mut self, s: f64, out: f64) {
        let kit = self.kit;
        let stone = self.any_or_wild(&kit.stone);
        let (height, deep) = (self.draw(4.6, 6.5), self.draw(5.0, 16.0));
        let middle = Spot {
            z: 0.0,
            ..self.beside(s, 0.0)
        };
        let mark = self.mark();
        for side in [-1.0, 1.0] {
            let pier = middle.spot(0.0, side * (out + 1.0), 0.0, 0.0);
            self.block(&pier, [deep, 2.0, height], stone);
            let bank = middle.spot(0.0, side * (out + 14.0), 0.0, 0.0);
            self.block(&bank, [deep, 24.0, height], stone);
        }
        let deck = middle.spot(0.0, 0.0, height, 0.0);
        self.block(&deck, [deep, 2.0 * out + 52.0, 1.1], stone);
        let metal = self.any(&kit.metal);
        for x in [-0.5, 0.5] {
            let rail = deck.spot(x * deep, 0.0, 1.1, 0.0);
            self.block(&rail, [0.1, 2.0 * out + 52.0, 1.0], metal);
        }
        self.close(ObjectClass::Building, &middle, mark);
    }

    /// A piece of bank beside the road, with this height and these widths of its slope and its top, metres.
    pub(super) fn bank(
        &mut self,
        spot: &Spot,
        length: f64,
        height: f64,
        [slope, top]: [f64; 2],
        material: u32,
    ) {
        // The prism's x axis points away from the road, so the slope rises along it.
        let whole = slope + top;
        let outline = [
            [-0.5 * whole, 0.0],
            [0.5 * whole, 0.0],
            [0.5 * whole, height],
            [0.5 * whole - top, height],
        ];
        self.prism(spot, &outline, length, material);
    }
}
