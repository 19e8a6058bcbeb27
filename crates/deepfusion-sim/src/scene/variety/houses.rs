//! Buildings of many kinds: rows, villas, blocks, halls, with roofs and attachments to their walls.

use super::site::{Site, Spot};
use crate::primitive::{Hull, Shape, V3};
use crate::scene::ObjectClass;
use crate::texture::facade::{Facade, Wall};
use crate::texture::pattern::{Pattern, colour, wall_colour};
use crate::texture::{Material, Rgb};
use rand::Rng;

/// Kind of a building.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// In a closed row, two to five floors.
    Row,
    /// Alone in a garden.
    Villa,
    /// Shops and flats, three to eight floors.
    Block,
    /// A hall without windows, or with gates.
    Hall,
    /// A shed or a garage.
    Shed,
}

/// Height of the walls and of a floor.
struct Storeys {
    floors: f64,
    floor: f64,
    height: f64,
}

impl Site<'_> {
    /// Builds a house around a spot: `size` is along its heading and across it. The street is to its left if `street_left`. Houses at the
    /// back are plainer.
    pub(super) fn house(
        &mut self,
        spot: &Spot,
        size: [f64; 2],
        kind: Kind,
        street_left: bool,
        back: bool,
    ) {
        let mark = self.mark();
        let spot = Spot { z: 0.0, ..*spot };
        let storeys = self.storeys(kind);
        let (wall, pitch, accent) = self.walls(&spot, size, kind, &storeys);
        let flat = match kind {
            Kind::Block => self.chance(0.6),
            Kind::Hall => self.chance(0.6),
            Kind::Shed => self.chance(0.7),
            _ => self.chance(0.1),
        };
        if flat {
            self.parapet(&spot, size, storeys.height, wall);
        } else {
            self.roof(&spot, size, storeys.height, wall, back);
        }
        if !back {
            let out = if street_left { 1.0 } else { -1.0 };
            self.front(&spot, size, out, kind, &storeys, pitch, accent);
        }
        self.close(ObjectClass::Building, &spot, mark);
    }

    fn storeys(&mut self, kind: Kind) -> Storeys {
        let (low, high) = match kind {
            Kind::Row => (2, 5),
            Kind::Villa => (1, 3),
            Kind::Block => (3, 8),
            Kind::Hall => (1, 3),
            Kind::Shed => (1, 1),
        };
        let floors = f64::from(self.rng.random_range(low..=high));
        let floor = match kind {
            Kind::Hall => self.draw(3.5, 5.0),
            Kind::Shed => self.draw(2.2, 2.9),
            _ => self.draw(2.6, 3.7),
        };
        Storeys {
            floors,
            floor,
            height: floors * floor + self.draw(0.2, 1.0),
        }
    }

    /// Builds the walls; returns their material, the distance between windows and the colour of doors.
    fn walls(
        &mut self,
        spot: &Spot,
        size: [f64; 2],
        kind: Kind,
        storeys: &Storeys,
    ) -> (u32, f64, Rgb) {
        let window = [
            self.rng.random_range(0.7..2.2f32),
            self.rng.random_range(0.9..1.0f32) * (0.52 * storeys.floor as f32),
        ];
        let pitch = window[0] + self.rng.random_range(0.4..2.4f32);
        let accent = colour(self.rng, 0.9);
        let mut skin = if self.rng.random_bool(0.4 * self.variety.wild) {
            Pattern::wild(self.rng)
        } else {
            Pattern::wall(self.rng)
        };
        if self.rng.random_bool(0.12) {
            skin.posters = self.rng.random_range(0.0..0.7);
        }
        let pale = self.rng.random_range(0.1..0.8f32);
        let trim = if self.rng.random_bool(0.75) {
            Rgb::new(pale, pale * 0.98, pale * 0.93)
        } else {
            wall_colour(self.rng)
        };
        let blind = matches!(kind, Kind::Hall | Kind::Shed) && self.rng.random_bool(0.7);
        let material = if blind {
            Material::Pattern(Box::new(skin))
        } else {
            Material::Facade(Box::new(Facade {
                half: [0.5 * size[0] as f32, 0.5 * size[1] as f32],
                height: storeys.height as f32,
                wall: Wall::Plaster,
                colour: skin.colours[0],
                trim,
                accent,
                floor: storeys.floor as f32,
                pitch,
                window,
                shutters: matches!(kind, Kind::Row | Kind::Villa) && self.rng.random_bool(0.35),
                shop: match kind {
                    Kind::Block => self.rng.random_bool(0.6),
                    Kind::Row => self.rng.random_bool(0.2),
                    _ => false,
                },
                ledges: self.rng.random_bool(0.4),
                grime: self.rng.random_range(0.0..1.0),
                skin: Some(skin),
            }))
        };
        let wall = self.world.material(material);
        self.block(spot, [size[0], size[1], storeys.height], wall);
        (wall, f64::from(pitch), accent)
    }

    /// A flat roof with objects on it.
    fn parapet(&mut self, spot: &Spot, size: [f64; 2], height: f64, wall: u32) {
        if self.chance(0.5) {
            let (over, thick) = (self.draw(0.1, 0.5), self.draw(0.15, 0.6));
            let edge = self.kit.metal[0];
            let top = spot.spot(0.0, 0.0, height, 0.0);
            self.block(&top, [size[0] + over, size[1] + over, thick], edge);
        }
        for _ in 0..self.rng.random_range(0..3) {
            let at = spot.spot(
                self.draw(-0.35, 0.35) * size[0],
                self.draw(-0.35, 0.35) * size[1],
                height,
                0.0,
            );
            let box_size = [
                self.draw(0.8, 0.35 * size[0].max(3.0)),
                self.draw(0.8, 0.35 * size[1].max(3.0)),
                self.draw(0.6, 2.6),
            ];
            self.block(&at, box_size, wall);
        }
    }

    /// A gable roof along or across the street, a hip roof, or a lean-to, with chimneys and dormers.
    fn roof(&mut self, spot: &Spot, size: [f64; 2], height: f64, wall: u32, back: bool) {
        let kit = self.kit;
        let material = self.any_or_wild(&kit.roofs);
        let across = self.chance(0.3);
        let (turn, [length, width]) = if across {
            (std::f64::consts::FRAC_PI_2, [size[1], size[0]])
        } else {
            (0.0, size)
        };
        let spot = spot.spot(0.0, 0.0, height, turn);
        let angle = self.draw(0.4, 1.0) as f32;
        let (half_x, half_y) = (
            0.5 * length as f32 + self.rng.random_range(0.0..0.6f32),
            0.5 * width as f32 + self.rng.random_range(0.05..0.6f32),
        );
        let (sin, cos) = angle.sin_cos();
        let ridge = (half_y * angle.tan()).min(6.5);
        let hip = self.chance(0.3);
        let mut planes = vec![
            (V3::new(0.0, sin, cos), half_y * sin),
            (V3::new(0.0, -sin, cos), half_y * sin),
            (-V3::z(), 0.0),
            (V3::z(), ridge),
        ];
        if hip {
            planes.push((V3::new(sin, 0.0, cos), half_x * sin));
            planes.push((V3::new(-sin, 0.0, cos), half_x * sin));
        } else {
            planes.push((V3::x(), half_x));
            planes.push((-V3::x(), half_x));
        }
        let hull = self.world.hull(Hull {
            planes,
            bounds: (half_x, half_y, 0.0, ridge),
        });
        let seed = self.rng.random();
        self.world.solid(
            Shape::Hull(hull),
            spot.at(0.0, 0.0, 0.0),
            spot.heading,
            material,
            seed,
        );
        if back {
            return;
        }
        let brick = self.any(&kit.stone);
        for _ in 0..self.rng.random_range(0..3) {
            let at = spot.spot(
                self.draw(-0.4, 0.4) * length,
                self.draw(-0.15, 0.15) * width,
                0.4 * f64::from(ridge),
                0.0,
            );
            let tall = 0.6 * f64::from(ridge) + self.draw(0.4, 1.2);
            let wide = self.draw(0.4, 0.9);
            self.block(&at, [wide, 0.5, tall], brick);
        }
        if ridge > 2.0 && self.chance(0.5) {
            let count = (length / 4.0) as i32;
            for side in [-1.0, 1.0] {
                for i in 0..count {
                    let x = (f64::from(i) + 0.5) / f64::from(count) * 0.8 * length - 0.4 * length;
                    let at = spot.spot(x, side * 0.28 * width, 0.15 * f64::from(ridge), 0.0);
                    let tall = (0.45 * f64::from(ridge)).min(2.0);
                    self.block(&at, [1.5, 0.25 * width, tall], wall);
                }
            }
        }
    }

    /// Attachments to the front: balconies, awnings, bays, steps, pipes.
    fn front(
        &mut self,
        spot: &Spot,
        size: [f64; 2],
        out: f64,
        kind: Kind,
        storeys: &Storeys,
        pitch: f64,
        accent: Rgb,
    ) {
        let kit = self.kit;
        let face = out * 0.5 * size[1];
        if matches!(kind, Kind::Row | Kind::Block) && self.chance(0.45) {
            let material = match self.rng.random_range(0..3) {
                0 => self.any(&kit.metal),
                1 => self.any(&kit.stone),
                _ => self.any(&kit.wild),
            };
            let columns = ((size[0] - 0.8) / pitch).floor().max(1.0) as i32;
            let every = self.rng.random_range(1..4usize);
            let deep = self.draw(0.6, 1.5);
            let gaps = self.draw(0.0, 0.5);
            for level in 1..storeys.floors as i32 {
                for column in (0..columns).step_by(every) {
                    if self.chance(gaps) {
                        continue;
                    }
                    let x = (f64::from(column) + 0.5 - 0.5 * f64::from(columns)) * pitch;
                    let at = spot.spot(
                        x,
                        face + out * 0.5 * deep,
                        f64::from(level) * storeys.floor - 0.1,
                        0.0,
                    );
                    self.block(&at, [0.85 * pitch, deep, 1.05], material);
                }
            }
        }
        if matches!(kind, Kind::Row | Kind::Villa) && self.chance(0.25) {
            // A bay from the ground up.
            let material = self.any(&kit.stone);
            let wide = self.draw(1.8, 3.5).min(0.5 * size[0]);
            let at = spot.spot(self.draw(-0.25, 0.25) * size[0], face + out * 0.4, 0.0, 0.0);
            let tall = self.draw(0.5, 1.0) * storeys.height;
            self.block(&at, [wide, 0.9, tall], material);
        }
        if kind == Kind::Block && self.chance(0.5) {
            // An awning, approximated by two steps, or a canopy.
            let material = self.any(&kit.cloth);
            let wide = self.draw(0.3, 0.95) * size[0];
            let deep = self.draw(0.8, 1.8);
            let at = spot.spot(0.0, face + out * 0.5 * deep, 2.45, 0.0);
            let outline = [
                [-0.5 * deep, 0.0],
                [0.5 * deep, 0.0],
                [0.5 * deep, 0.15],
                [-0.5 * deep, 0.7],
            ];
            let turned = at.spot(0.0, 0.0, 0.0, out * std::f64::consts::FRAC_PI_2);
            self.prism(&turned, &outline, wide, material);
        }
        if matches!(kind, Kind::Villa) && self.chance(0.5) {
            let step = self.any(&kit.stone);
            let x = self.draw(-0.3, 0.3) * size[0];
            for i in 0..3 {
                let at = spot.spot(x, face + out * (0.2 + 0.3 * f64::from(i)), 0.0, 0.0);
                self.block(&at, [1.6, 0.3, 0.6 - 0.17 * f64::from(i)], step);
            }
            if self.chance(0.5) {
                let roof = spot.spot(x, face + out * 0.6, 2.5, 0.0);
                let cover = self.any(&kit.roofs);
                self.block(&roof, [2.0, 1.2, 0.15], cover);
            }
        }
        if kind == Kind::Hall || kind == Kind::Shed {
            // Gates.
            let mut gate = Pattern::plain(self.rng, accent);
            gate.kind = crate::texture::pattern::Kind::Corrugated;
            gate.scale = 0.15;
            gate.turn = (0.0, 1.0);
            let gate = self.world.material(Material::Pattern(Box::new(gate)));
            let count = (size[0] / 6.0).ceil() as i32;
            for i in 0..count {
                let x = (f64::from(i) + 0.5) / f64::from(count) * size[0] - 0.5 * size[0];
                let at = spot.spot(x, face, 0.0, 0.0);
                let wide = (0.7 * size[0] / f64::from(count)).min(4.0);
                self.block(&at, [wide, 0.12, (0.8 * storeys.height).min(3.6)], gate);
            }
        }
        if self.chance(0.3) {
            // A sign or a lamp that projects from the wall.
            let material = self.any(&kit.signs);
            let at = spot.spot(self.draw(-0.4, 0.4) * size[0], face + out * 0.5, 2.8, 0.0);
            self.block(&at, [0.1, 0.9, 0.8], material);
        }
    }
}
