//! Street furniture: lamps, signs, lights, bollards, bins, benches, shelters, building sites.

use super::site::{Site, Spot};
use crate::scene::ObjectClass;
use crate::texture::Rgb;
use rand::Rng;

impl Site<'_> {
    /// A lamp post with an arm that reaches `arm` metres along the spot's heading.
    pub(super) fn lamp(&mut self, spot: &Spot) {
        let kit = self.kit;
        let mark = self.mark();
        let metal = self.any_or_wild(&kit.metal);
        let height = self.draw(3.5, 9.0);
        let thick = self.draw(0.04, 0.1);
        self.column(spot, thick, height, metal);
        let foot = self.draw(0.4, 1.2);
        self.column(spot, 1.7 * thick, foot, metal);
        let top = spot.at(0.0, 0.0, height);
        let head = if self.chance(0.6) {
            let arm = self.draw(0.6, 2.5);
            let end = spot.spot(arm, 0.0, height + 0.15 * arm, 0.0);
            self.rod(top, end.at(0.0, 0.0, 0.0), 0.6 * thick, metal);
            let pale = self.any(&[kit.pale, kit.metal[0], kit.dark]);
            self.block(&end, [0.7, 0.26, 0.12], pale);
            end
        } else {
            let end = spot.spot(0.0, 0.0, height, 0.0);
            self.ball(&end, [0.22, 0.22, 0.26], kit.pale);
            end
        };
        let strength = Rgb::new(1.0, 0.8, 0.55) * (1.2 * (height * height) as f32);
        self.world.light_lamp(head.at(0.0, 0.0, -0.3), strength);
        self.close(ObjectClass::Pole, spot, mark);
    }

    /// A traffic sign that faces the spot's heading.
    pub(super) fn sign(&mut self, spot: &Spot) {
        let kit = self.kit;
        let mark = self.mark();
        let metal = self.any(&kit.metal);
        let height = self.draw(1.9, 3.0);
        self.column(spot, 0.035, height, metal);
        let board = self.any_or_wild(&kit.signs);
        let mut top = height;
        for _ in 0..self.rng.random_range(1..3) {
            let half = self.draw(0.2, 0.45);
            let low = top - 2.0 * half;
            let at = spot.spot(0.06, 0.0, low, 0.0);
            match self.rng.random_range(0..4) {
                0 => {
                    // A disc.
                    let middle = spot.spot(0.06, 0.0, low + half, 0.0);
                    self.ball(&middle, [0.02, half, half], board);
                }
                1 => {
                    let turned = at.spot(0.0, 0.0, 0.0, std::f64::consts::FRAC_PI_2);
                    let outline = [[-half, 0.0], [half, 0.0], [0.0, 1.75 * half]];
                    self.prism(&turned, &outline, 0.03, board);
                }
                2 => {
                    let wide = self.draw(1.0, 3.0) * half;
                    self.block(&at, [0.03, wide, 2.0 * half], board);
                }
                _ => self.block(&at, [0.03, 2.0 * half, 2.0 * half], board),
            }
            top = low - 0.05;
            if top < 1.5 {
                break;
            }
        }
        self.close(ObjectClass::Pole, spot, mark);
    }

    /// Traffic lights.
    pub(super) fn lights(&mut self, spot: &Spot) {
        let kit = self.kit;
        let mark = self.mark();
        let metal = self.any(&kit.metal);
        let height = self.draw(2.8, 3.6);
        self.column(spot, 0.06, height, metal);
        let housing = spot.spot(0.12, 0.0, height - 0.95, 0.0);
        self.block(&housing, [0.2, 0.3, 0.9], kit.dark);
        for (i, sign) in [0, 2, 4].iter().enumerate() {
            let lamp = housing.spot(0.1, 0.0, 0.16 + 0.29 * i as f64, 0.0);
            self.ball(&lamp, [0.04, 0.1, 0.1], kit.signs[*sign]);
        }
        self.close(ObjectClass::Pole, spot, mark);
    }

    /// A random object of those found on pavements.
    pub(super) fn random_prop(&mut self, spot: &Spot) {
        let kit = self.kit;
        let mark = self.mark();
        let class = match self.rng.random_range(0..15) {
            0 => {
                let metal = self.any_or_wild(&kit.metal);
                let (r, h) = (self.draw(0.04, 0.16), self.draw(0.5, 1.2));
                self.column(spot, r, h, metal);
                if self.chance(0.4) {
                    self.ball(&spot.spot(0.0, 0.0, h, 0.0), [1.2 * r; 3], metal);
                }
                ObjectClass::Pole
            }
            1 => {
                // A bin.
                let metal = self.any_or_wild(&kit.metal);
                let (r, h) = (self.draw(0.16, 0.35), self.draw(0.7, 1.15));
                self.column(spot, r, h, metal);
                ObjectClass::Misc
            }
            2..=3 => {
                // Wheeled bins in a row.
                for i in 0..self.rng.random_range(1..5) {
                    let metal = self.any(&kit.metal);
                    let at = spot.spot(0.65 * f64::from(i), self.draw(-0.1, 0.1), 0.0, 0.0);
                    self.block(&at, [0.55, 0.6, 0.95], metal);
                    self.block(&at.spot(0.0, 0.0, 0.95, 0.0), [0.6, 0.66, 0.08], kit.dark);
                }
                ObjectClass::Misc
            }
            4..=5 => {
                // A cabinet.
                let metal = self.any_or_wild(&kit.metal);
                let size = [
                    self.draw(0.4, 1.8),
                    self.draw(0.3, 0.7),
                    self.draw(0.7, 1.9),
                ];
                self.block(spot, size, metal);
                ObjectClass::Misc
            }
            6 => {
                self.bench(spot);
                ObjectClass::Misc
            }
            7 => {
                // A planter.
                let stone = self.any_or_wild(&kit.stone);
                let size = self.draw(0.5, 1.6);
                self.block(spot, [size, 0.6 * size, 0.55], stone);
                self.bush(&spot.spot(0.0, 0.0, 0.5, 0.0), 0.3 * size + 0.2);
                ObjectClass::Misc
            }
            8 => {
                // A column with posters.
                let poster = self.any(&kit.wild);
                self.column(spot, 0.6, 2.8, poster);
                ObjectClass::Pole
            }
            9..=10 => {
                // Bicycles at a rack.
                for i in 0..self.rng.random_range(1..6) {
                    let turn = self.draw(-0.15, 0.15) + std::f64::consts::FRAC_PI_2;
                    let at = spot.spot(0.55 * f64::from(i), 0.0, 0.0, turn);
                    if let Some(model) = self.person(ObjectClass::Bicycle) {
                        self.put(&model, &at);
                    }
                }
                return;
            }
            11 => {
                // Boxes, sacks and a ball left behind.
                for _ in 0..self.rng.random_range(1..5) {
                    let material = self.any(&kit.wild);
                    let at = spot.spot(
                        self.draw(-0.8, 0.8),
                        self.draw(-0.3, 0.3),
                        0.0,
                        self.rng_turn(),
                    );
                    let side = self.draw(0.2, 0.7);
                    let size = [side, side * self.draw(0.6, 1.4), side * self.draw(0.5, 1.3)];
                    self.block(&at, size, material);
                }
                let material = self.any(&kit.cloth);
                let r = self.draw(0.08, 0.25);
                self.ball(&spot.spot(0.5, 0.4, r, 0.0), [r; 3], material);
                ObjectClass::Misc
            }
            12 => {
                self.barrier(spot);
                ObjectClass::Misc
            }
            13 => {
                self.tables(spot);
                ObjectClass::Misc
            }
            _ => {
                self.shelter(spot);
                ObjectClass::Misc
            }
        };
        self.close(class, spot, mark);
    }

    fn rng_turn(&mut self) -> f64 {
        self.draw(-1.5, 1.5)
    }

    /// A bench along the spot's heading.
    pub(super) fn bench(&mut self, spot: &Spot) {
        let kit = self.kit;
        let (wood, metal) = (self.any_or_wild(&kit.wood), self.any(&kit.metal));
        self.block(&spot.spot(0.0, 0.0, 0.42, 0.0), [1.7, 0.45, 0.06], wood);
        self.block(&spot.spot(0.0, -0.22, 0.5, 0.0), [1.7, 0.06, 0.4], wood);
        for x in [-0.7, 0.7] {
            self.block(&spot.spot(x, 0.0, 0.0, 0.0), [0.07, 0.42, 0.42], metal);
        }
    }

    /// Red and white boards and cones of a building site.
    fn barrier(&mut self, spot: &Spot) {
        let kit = self.kit;
        let board = self.any(&[kit.signs[0], kit.signs[2], kit.signs[6]]);
        for i in 0..self.rng.random_range(1..4) {
            let at = spot.spot(
                2.1 * f64::from(i),
                self.draw(-0.2, 0.2),
                0.0,
                self.draw_little(),
            );
            self.block(&at.spot(0.0, 0.0, 0.75, 0.0), [2.0, 0.04, 0.25], board);
            for x in [-0.9, 0.9] {
                self.block(&at.spot(x, 0.0, 0.0, 0.0), [0.06, 0.3, 1.0], kit.dark);
            }
        }
    }

    fn draw_little(&mut self) -> f64 {
        self.draw(-0.15, 0.15)
    }

    /// Tables, chairs and a parasol of a café.
    fn tables(&mut self, spot: &Spot) {
        let kit = self.kit;
        let (top, cloth) = (self.any(&kit.wood), self.any(&kit.cloth));
        for i in 0..self.rng.random_range(1..4) {
            let at = spot.spot(1.9 * f64::from(i), self.draw(-0.2, 0.2), 0.0, 0.0);
            self.column(&at, 0.03, 0.72, kit.dark);
            self.column(&at.spot(0.0, 0.0, 0.72, 0.0), 0.38, 0.03, top);
            for side in [-1.0, 1.0] {
                let turn = side * std::f64::consts::FRAC_PI_2;
                let chair = at.spot(self.draw(-0.2, 0.2), side * 0.65, 0.0, turn);
                self.chair(&chair, cloth);
            }
            if self.chance(0.4) {
                self.column(&at, 0.025, 2.4, kit.pale);
                let canopy = at.spot(0.0, 0.0, 2.3, 0.0);
                self.ball(&canopy, [1.3, 1.3, 0.32], cloth);
            }
        }
    }

    /// A chair with its back towards −x of the spot.
    pub(super) fn chair(&mut self, spot: &Spot, material: u32) {
        let metal = self.kit.metal[1];
        let seat = self.draw(0.42, 0.48);
        self.block(
            &spot.spot(0.0, 0.0, seat, 0.0),
            [0.44, 0.44, 0.05],
            material,
        );
        let back = self.draw(0.3, 0.55);
        self.block(
            &spot.spot(-0.21, 0.0, seat, 0.0),
            [0.04, 0.42, back],
            material,
        );
        for (x, y) in [(-0.18, -0.18), (-0.18, 0.18), (0.18, -0.18), (0.18, 0.18)] {
            self.rod(spot.at(x, y, 0.0), spot.at(x, y, seat), 0.016, metal);
        }
    }

    /// A bus shelter.
    fn shelter(&mut self, spot: &Spot) {
        let kit = self.kit;
        let (metal, back) = (self.any(&kit.metal), self.any(&kit.wild));
        let length = self.draw(2.5, 4.5);
        self.block(&spot.spot(0.0, 0.0, 2.3, 0.0), [length, 1.4, 0.1], metal);
        self.block(&spot.spot(0.0, 0.65, 0.2, 0.0), [length, 0.05, 2.0], back);
        for x in [-0.5, 0.5] {
            for y in [-0.6, 0.6] {
                self.rod(
                    spot.at(x * length, y, 0.0),
                    spot.at(x * length, y, 2.3),
                    0.04,
                    metal,
                );
            }
        }
        self.block(
            &spot.spot(0.0, 0.4, 0.4, 0.0),
            [0.7 * length, 0.3, 0.06],
            metal,
        );
    }

    /// A fence, a railing or a wall along the spot's heading.
    pub(super) fn enclosure(&mut self, spot: &Spot, length: f64) {
        let kit = self.kit;
        match self.rng.random_range(0..12) {
            0..=3 => {
                let height = self.draw(0.7, 2.2);
                self.hedge(spot, length, height);
            }
            4..=5 => {
                let mark = self.mark();
                let wood = self.any_or_wild(&kit.wood);
                let height = self.draw(0.7, 2.0);
                self.block(spot, [length, 0.05, height], wood);
                for x in [-0.5, 0.0] {
                    let post = spot.spot(x * length, 0.0, 0.0, 0.0);
                    self.block(&post, [0.12, 0.12, height + 0.08], wood);
                }
                self.close(ObjectClass::Fence, spot, mark);
            }
            6..=8 => {
                let mark = self.mark();
                let stone = self.any_or_wild(&kit.stone);
                let height = self.draw(0.3, 2.4);
                self.block(spot, [length, 0.25, height], stone);
                if self.chance(0.5) {
                    let coping = spot.spot(0.0, 0.0, height, 0.0);
                    self.block(&coping, [length, 0.33, 0.07], kit.metal[2]);
                }
                self.close(ObjectClass::Fence, spot, mark);
            }
            _ => {
                // Bars or pickets with gaps.
                let mark = self.mark();
                let metal = self.any_or_wild(&kit.metal);
                let foot = if self.chance(0.4) {
                    let stone = self.any(&kit.stone);
                    self.block(spot, [length, 0.25, 0.4], stone);
                    0.4
                } else {
                    0.0
                };
                let height = foot + self.draw(0.7, 1.3);
                for z in [foot + 0.15, height - 0.12] {
                    let (a, b) = (
                        spot.at(-0.5 * length, 0.0, z),
                        spot.at(0.5 * length, 0.0, z),
                    );
                    self.rod(a, b, 0.02, metal);
                }
                let apart = self.draw(0.13, 0.35);
                let count = (length / apart) as i32;
                let half = self.draw(0.01, 0.05);
                for i in 0..count {
                    let x = (f64::from(i) + 0.5) * apart - 0.5 * length;
                    let bar = spot.spot(x, 0.0, foot, 0.0);
                    self.block(&bar, [2.0 * half, 0.02, height - foot], metal);
                }
                self.close(ObjectClass::Fence, spot, mark);
            }
        }
    }
}
