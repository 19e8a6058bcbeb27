//! Furniture along walls, in the middle of rooms, and on tables.

use super::site::{Site, Spot};
use crate::scene::ObjectClass;
use crate::texture::Material;
use crate::texture::pattern::{Kind, Pattern, colour};
use rand::Rng;
use std::f64::consts::FRAC_PI_2;

impl Site<'_> {
    /// Objects along a wall: x runs along it from the spot, y into the room. They are at most `deep` metres deep.
    pub(super) fn along(&mut self, wall: &Spot, length: f64, deep: f64, height: f64) {
        let mut x = self.draw(0.05, 0.4);
        let full = 0.35 + 0.6 * self.variety.clutter;
        while x + 0.5 < length {
            let wide = self.draw(0.5, 2.2).min(length - x);
            let middle = wall.spot(x + 0.5 * wide, 0.0, 0.0, 0.0);
            self.hanging(&middle, wide, height);
            if self.chance(full) && deep > 0.2 {
                let mark = self.mark();
                self.standing(&middle, wide, deep, height);
                self.close(ObjectClass::Misc, &middle, mark);
            }
            x += wide + self.draw(0.0, 0.5);
        }
    }

    /// Pictures, windows, boards, curtains on a wall.
    fn hanging(&mut self, wall: &Spot, wide: f64, height: f64) {
        let kit = self.kit;
        match self.rng.random_range(0..9) {
            0..=1 => {
                let (w, h) = (self.draw(0.2, 0.9) * wide, self.draw(0.25, 1.0));
                let z = self.draw(1.0, (height - h).max(1.1));
                let picture = self.any(&kit.wild);
                self.block(&wall.spot(0.0, 0.015, z, 0.0), [w, 0.03, h], picture);
            }
            2..=3 => {
                // A window: brighter than anything in the room.
                let (w, low) = (0.85 * wide, self.draw(0.3, 1.1));
                let h = (height - low - 0.25).min(1.6);
                let tone = self.rng.random_range(0.7..2.5f32);
                let mut glass = Pattern::plain(
                    self.rng,
                    crate::texture::Rgb::new(tone, tone * 1.02, tone * 1.05),
                );
                glass.kind = Kind::Blotches;
                glass.scale = self.rng.random_range(0.2..1.0);
                glass.colours[1] = colour(self.rng, 0.4);
                let glass = self.world.material(Material::Pattern(Box::new(glass)));
                let frame = self.any(&[kit.pale, kit.dark, kit.metal[0]]);
                self.block(&wall.spot(0.0, 0.01, low, 0.0), [w, 0.02, h], glass);
                for x in [-0.5, 0.0, 0.5] {
                    self.block(&wall.spot(x * w, 0.03, low, 0.0), [0.06, 0.06, h], frame);
                }
                for z in [low, low + h] {
                    self.block(
                        &wall.spot(0.0, 0.04, z - 0.03, 0.0),
                        [w + 0.06, 0.08, 0.06],
                        frame,
                    );
                }
                if self.chance(0.5) {
                    let cloth = self.any(&kit.cloth);
                    for side in [-1.0, 1.0] {
                        let at = wall.spot(side * 0.5 * w, 0.08, 0.1, 0.0);
                        self.block(&at, [0.3 * w, 0.08, low + h], cloth);
                    }
                }
            }
            4 => {
                let pale = kit.pale;
                let (w, h) = (0.9 * wide, self.draw(0.6, 1.2));
                self.block(
                    &wall.spot(0.0, 0.02, 1.0, 0.0),
                    [w, 0.04, h.min(height - 1.1)],
                    pale,
                );
            }
            5 => {
                // A shelf on the wall.
                let wood = self.any_or_wild(&kit.wood);
                let z = self.draw(1.2, 1.9);
                let at = wall.spot(0.0, 0.13, z, 0.0);
                self.block(&at, [0.9 * wide, 0.24, 0.03], wood);
                self.clutter(&at.spot(0.0, 0.0, 0.03, 0.0), [0.85 * wide, 0.2], 0.35);
            }
            _ => {}
        }
    }

    /// Furniture on the floor in front of a wall.
    fn standing(&mut self, wall: &Spot, wide: f64, deep: f64, height: f64) {
        let kit = self.kit;
        let kind = self.rng.random_range(0..12);
        let deep = deep.min(match kind {
            0..=2 => 0.4,
            3..=5 => 0.8,
            6 => 1.0,
            _ => 0.65,
        });
        let at = wall.spot(0.0, 0.5 * deep, 0.0, 0.0);
        match kind {
            0..=2 => self.shelf(&at, [wide, deep, height]),
            3..=5 => {
                // A desk with a screen, and a chair.
                let top = self.draw(0.7, 0.78);
                self.table(&at, [wide, deep], top);
                if self.chance(0.6) {
                    let screen =
                        at.spot(self.draw(-0.2, 0.2) * wide, -0.1, top, self.draw(-0.4, 0.4));
                    let (w, h) = (self.draw(0.35, 0.65), self.draw(0.28, 0.4));
                    self.block(&screen, [0.22, 0.18, 0.02], kit.dark);
                    self.block(
                        &screen.spot(0.0, -0.03, 0.0, 0.0),
                        [0.05, 0.03, 0.2],
                        kit.dark,
                    );
                    self.block(&screen.spot(0.0, 0.0, 0.12, 0.0), [w, 0.04, h], kit.dark);
                    let shown = if self.chance(0.5) {
                        self.any(&kit.wild)
                    } else {
                        kit.dark
                    };
                    self.block(
                        &screen.spot(0.0, 0.02, 0.135, 0.0),
                        [w - 0.04, 0.01, h - 0.04],
                        shown,
                    );
                    self.block(
                        &at.spot(0.0, 0.18, top, 0.05),
                        [0.42, 0.14, 0.02],
                        kit.metal[0],
                    );
                }
                self.clutter(&at.spot(0.0, 0.0, top, 0.0), [0.95 * wide, 0.8 * deep], 0.4);
            }
            6 => {
                // A sofa or a bed.
                let cloth = self.any(&kit.cloth);
                let seat = self.draw(0.35, 0.5);
                self.block(&at, [wide, deep, seat], cloth);
                if self.chance(0.6) {
                    let back = at.spot(0.0, -0.5 * deep + 0.1, seat, 0.0);
                    self.block(&back, [wide, 0.2, 0.45], cloth);
                    for x in [-0.5, 0.5] {
                        let arm = at.spot(x * (wide - 0.15), 0.0, seat, 0.0);
                        self.block(&arm, [0.15, deep, 0.2], cloth);
                    }
                }
                for _ in 0..self.rng.random_range(0..4) {
                    let pillow = self.any(&kit.cloth);
                    let p = at.spot(
                        self.draw(-0.4, 0.4) * wide,
                        self.draw(-0.2, 0.2),
                        seat + 0.1,
                        0.0,
                    );
                    self.ball(&p, [0.24, 0.16, 0.12], pillow);
                }
            }
            7 => {
                // A counter or a cabinet.
                let wood = self.any_or_wild(&kit.wood);
                let high = self.draw(0.6, 1.1);
                self.block(&at, [wide, 0.95 * deep, high], wood);
                let top = self.any(&kit.stone);
                self.block(
                    &at.spot(0.0, 0.0, high, 0.0),
                    [wide + 0.02, deep, 0.035],
                    top,
                );
                self.clutter(
                    &at.spot(0.0, 0.0, high + 0.035, 0.0),
                    [0.9 * wide, 0.7 * deep],
                    0.45,
                );
            }
            8 => {
                // A cupboard, a fridge.
                let paint = self.any_or_wild(&[
                    kit.pale,
                    kit.wood[0],
                    kit.wood[1],
                    kit.metal[0],
                    kit.metal[6],
                ]);
                let high = self.draw(1.3, 2.2).min(height - 0.05);
                self.block(&at, [wide.min(1.6), deep, high], paint);
                let handle = at.spot(0.02, 0.5 * deep + 0.02, 0.5 * high, 0.0);
                self.block(&handle, [0.02, 0.03, 0.25], kit.metal[0]);
            }
            9 => {
                // A radiator.
                let mut ribs = Pattern::plain(self.rng, crate::texture::Rgb::new(0.7, 0.7, 0.67));
                ribs.kind = Kind::Corrugated;
                ribs.scale = 0.06;
                let ribs = self.world.material(Material::Pattern(Box::new(ribs)));
                self.block(&wall.spot(0.0, 0.08, 0.12, 0.0), [wide, 0.1, 0.6], ribs);
            }
            10 => {
                let size = 0.3f64.min(0.4 * deep);
                let pot = self.any(&kit.stone);
                self.column(&at, size, 0.4, pot);
                let plant = self.kit.bushes[0];
                let tall = self.draw(0.3, 0.8);
                for _ in 0..4 {
                    let p = at.at(
                        self.draw(-0.15, 0.15),
                        self.draw(-0.1, 0.1),
                        0.4 + tall * self.draw(0.3, 1.0),
                    );
                    self.lobe(p, [0.8 * size, 0.8 * size, 0.3], &plant, 2);
                }
            }
            _ => {
                for _ in 0..self.rng.random_range(1..6) {
                    let paper = self.any(&kit.wild);
                    let side = self.draw(0.2, 0.5).min(deep);
                    let p = at.spot(
                        self.draw(-0.4, 0.4) * wide,
                        self.draw(-0.1, 0.1),
                        0.0,
                        self.draw(-0.3, 0.3),
                    );
                    let tall = self.draw(0.15, 0.6);
                    self.block(&p, [side, 0.8 * side, tall], paper);
                }
            }
        }
    }

    /// Boards with books and boxes between two sides of a shelf.
    fn shelf(&mut self, at: &Spot, [wide, deep, height]: [f64; 3]) {
        let kit = self.kit;
        let wood = self.any_or_wild(&[kit.wood[0], kit.wood[1], kit.pale, kit.dark, kit.metal[0]]);
        let high = self.draw(0.8, 2.3).min(height - 0.05);
        for x in [-0.5, 0.5] {
            self.block(&at.spot(x * wide, 0.0, 0.0, 0.0), [0.03, deep, high], wood);
        }
        if self.chance(0.7) {
            let back = at.spot(0.0, -0.5 * deep + 0.01, 0.0, 0.0);
            self.block(&back, [wide, 0.02, high], wood);
        }
        let step = self.draw(0.27, 0.42);
        let mut z = 0.06;
        while z < high {
            let board = at.spot(0.0, 0.0, z, 0.0);
            self.block(&board, [wide, deep, 0.025], wood);
            if z + step < high + 0.2 {
                self.books(
                    &board.spot(0.0, 0.0, 0.025, 0.0),
                    [0.95 * wide, 0.8 * deep],
                    0.85 * step,
                );
            }
            z += step;
        }
    }

    /// Books in a row, some of them leaning or lying.
    fn books(&mut self, at: &Spot, [wide, deep]: [f64; 2], high: f64) {
        let kit = self.kit;
        let mut x = -0.5 * wide;
        while x < 0.5 * wide - 0.03 {
            if self.chance(0.15) {
                x += self.draw(0.05, 0.4);
                continue;
            }
            // Several equal books are one box.
            let thick = self.draw(0.02, 0.22).min(0.5 * wide - x);
            let tall = high * self.draw(0.5, 0.98);
            let cover = if self.chance(0.5) {
                self.any(&kit.cloth)
            } else {
                self.any(&kit.wild)
            };
            let book = at.spot(x + 0.5 * thick, self.draw(-0.1, 0.1) * deep, 0.0, 0.0);
            let out = self.draw(0.6, 0.95) * deep;
            self.block(&book, [0.96 * thick, out, tall], cover);
            x += thick;
        }
    }

    /// A table with a top of this size.
    fn table(&mut self, at: &Spot, [wide, deep]: [f64; 2], high: f64) {
        let kit = self.kit;
        let top = self.any_or_wild(&[
            kit.wood[0],
            kit.wood[1],
            kit.wood[2],
            kit.pale,
            kit.stone[0],
        ]);
        self.block(
            &at.spot(0.0, 0.0, high - 0.03, 0.0),
            [wide, deep, 0.03],
            top,
        );
        let leg = self.any(&kit.metal);
        for x in [-0.46, 0.46] {
            for y in [-0.44, 0.44] {
                let foot = at.spot(x * wide, y * deep, 0.0, 0.0);
                self.block(&foot, [0.05, 0.05, high - 0.03], leg);
            }
        }
        if self.chance(0.3) {
            let drawers = at.spot(0.3 * wide, 0.0, 0.05, 0.0);
            self.block(&drawers, [0.3 * wide, 0.85 * deep, high - 0.1], top);
        }
    }

    /// Objects on a surface of this size: cups, books, bottles, boxes, fruit.
    pub(super) fn clutter(&mut self, at: &Spot, [wide, deep]: [f64; 2], tall: f64) {
        let kit = self.kit;
        let most = 1.0 + 9.0 * self.variety.clutter * wide.min(1.5);
        for _ in 0..self.rng.random_range(0..=most as usize) {
            let p = at.spot(
                self.draw(-0.48, 0.48) * wide,
                self.draw(-0.45, 0.45) * deep,
                0.0,
                self.draw(-1.5, 1.5),
            );
            let material = if self.chance(0.5) {
                self.any(&kit.wild)
            } else {
                self.any(&kit.cloth)
            };
            let size = self.draw(0.03, 0.12);
            match self.rng.random_range(0..6) {
                0 => self.column(&p, 0.04, 0.1, material),
                1 => {
                    let high = self.draw(0.15, 0.32).min(tall);
                    self.column(&p, 0.035, high, material);
                }
                2 => self.ball(&p.spot(0.0, 0.0, size, 0.0), [size; 3], material),
                3..=4 => {
                    let thick = self.draw(0.01, 0.12);
                    self.block(&p, [0.29, 0.21, thick], material);
                }
                _ => {
                    let high = (size * 3.0).min(tall);
                    self.block(&p, [2.0 * size, 1.5 * size, high], material);
                }
            }
        }
    }

    /// Furniture in the open, where `room` metres are free.
    pub(super) fn island(&mut self, spot: &Spot, room: f64, height: f64) {
        let kit = self.kit;
        if !self.chance(0.3 + 0.6 * self.variety.clutter) {
            return;
        }
        let mark = self.mark();
        let class = match self.rng.random_range(0..10) {
            0..=3 => {
                let size = [room.min(1.7) * 0.8, (room * 0.6).min(0.95)];
                let high = if self.chance(0.3) { 0.42 } else { 0.74 };
                self.table(spot, size, high);
                self.clutter(&spot.spot(0.0, 0.0, high, 0.0), size, 0.5);
                if high > 0.6 {
                    for side in [-1.0, 1.0] {
                        if self.chance(0.7) {
                            let cloth = self.any(&kit.cloth);
                            let chair = spot.spot(
                                self.draw(-0.3, 0.3),
                                side * (0.5 * size[1] + 0.1),
                                0.0,
                                -side * FRAC_PI_2 + self.draw(-0.5, 0.5),
                            );
                            self.chair(&chair, cloth);
                        }
                    }
                }
                ObjectClass::Misc
            }
            4..=5 => {
                let cloth = self.any(&kit.cloth);
                let turned = spot.spot(0.0, 0.0, 0.0, self.draw(0.0, std::f64::consts::TAU));
                self.chair(&turned, cloth);
                ObjectClass::Misc
            }
            6 => {
                if let Some(model) = self.person(ObjectClass::Pedestrian)
                    && f64::from(model.size[2]) < height
                {
                    let turned = spot.spot(0.0, 0.0, 0.0, self.draw(0.0, std::f64::consts::TAU));
                    self.put(&model, &turned);
                }
                return;
            }
            7 => {
                // A rug.
                let cloth = self.any(&kit.wild);
                self.block(spot, [room, 0.7 * room, 0.012], cloth);
                ObjectClass::Misc
            }
            8 => {
                let pillar = self.any(&kit.stone);
                let side = self.draw(0.25, 0.45);
                self.block(spot, [side, side, height], pillar);
                ObjectClass::Pole
            }
            _ => {
                for _ in 0..self.rng.random_range(1..6) {
                    let material = self.any(&kit.wild);
                    let p = spot.spot(
                        self.draw(-0.35, 0.35) * room,
                        self.draw(-0.3, 0.3) * room,
                        0.0,
                        self.draw(-1.5, 1.5),
                    );
                    let side = self.draw(0.1, 0.35);
                    if self.chance(0.3) {
                        self.ball(
                            &p.spot(0.0, 0.0, 0.6 * side, 0.0),
                            [0.6 * side; 3],
                            material,
                        );
                    } else {
                        let tall = side * self.draw(0.4, 1.5);
                        self.block(&p, [side, 0.7 * side, tall], material);
                    }
                }
                ObjectClass::Misc
            }
        };
        self.close(class, spot, mark);
    }
}
