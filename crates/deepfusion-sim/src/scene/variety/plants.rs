//! Trees, bushes and hedges made of lobes of leaves.

use super::site::{Site, Species, Spot};
use crate::scene::ObjectClass;
use rand::Rng;
use std::f64::consts::TAU;

impl Site<'_> {
    /// A tree `height` metres high on a spot, with a crown of `radius`; its lowest leaves are at `clear` metres.
    pub(super) fn tree(&mut self, spot: &Spot, height: f64, radius: f64, clear: f64) {
        let number = self.rng.random_range(0..self.kit.trees.len());
        let species = self.kit.trees[number];
        let mark = self.mark();
        if species.bare {
            self.bare_tree(spot, &species, height, radius, clear);
        } else if species.conifer {
            self.conifer(spot, &species, height, (0.28 * height).min(radius));
        } else {
            self.broad_tree(spot, &species, height, radius, clear);
        }
        self.close(ObjectClass::Tree, spot, mark);
    }

    fn trunk(&mut self, spot: &Spot, species: &Species, height: f64, thick: f64) -> [f64; 3] {
        let lean = [self.draw(-0.05, 0.05), self.draw(-0.05, 0.05)];
        let top = spot.at(lean[0] * height, lean[1] * height, height);
        let middle = spot.at(0.4 * lean[0] * height, 0.4 * lean[1] * height, 0.5 * height);
        self.rod(spot.at(0.0, 0.0, -0.2), middle, thick, species.bark);
        self.rod(middle, top, 0.8 * thick, species.bark);
        top
    }

    fn broad_tree(&mut self, spot: &Spot, species: &Species, height: f64, radius: f64, clear: f64) {
        let clear = clear.min(0.6 * height);
        let half = 0.5 * (height - clear);
        let radius = (radius * f64::from(species.spread).min(1.0)).min(1.3 * half);
        let middle = clear + half;
        let thick = (0.02 * height * self.draw(0.8, 1.5)).clamp(0.06, 0.45);
        let top = self.trunk(spot, species, clear + 0.35 * half, thick);
        let few = radius < 1.3;
        let count = if few {
            6
        } else {
            (7.0 + 3.2 * radius).min(19.0) as usize
        };
        // Behind the houses fewer, larger lobes are enough.
        let away = self.world.road.locate(spot.x, spot.y).lateral.abs();
        let (count, larger) = if away > 22.0 {
            (count / 2 + 1, 1.3)
        } else {
            (count, 1.0)
        };
        let twist = self.draw(0.0, TAU);
        for i in 0..count {
            // Spread evenly over an upright ellipsoid, some nearer its middle than others.
            let up = 1.0 - 2.0 * (i as f64 + 0.5) / count as f64;
            let angle = twist + 2.4 * i as f64;
            let out = self.draw(0.42, 0.74);
            let flat = (1.0 - up * up).sqrt() * out;
            let place = [
                radius * flat * angle.cos(),
                radius * flat * angle.sin(),
                middle + half * up * self.draw(0.45, 0.72),
            ];
            let size = larger * self.draw(0.36, 0.58) * if few { 1.15 } else { 1.0 };
            let (a, b) = (radius * size, radius * size * self.draw(0.75, 1.1));
            let c = (half * size * self.draw(0.7, 1.05)).min(1.25 * a);
            let at = spot.at(place[0], place[1], place[2]);
            let light = if up > 0.25 {
                2
            } else if up > -0.45 {
                1
            } else {
                0
            };
            self.lobe(at, [a, b, c], species, light);
            if i % 4 == 1 && !few {
                self.rod(top, at, 0.35 * thick, species.bark);
            }
        }
        self.lobe(
            spot.at(0.0, 0.0, middle),
            [0.6 * radius, 0.6 * radius, 0.62 * half],
            species,
            0,
        );
    }

    fn conifer(&mut self, spot: &Spot, species: &Species, height: f64, radius: f64) {
        self.trunk(spot, species, 0.8 * height, 0.012 * height + 0.05);
        let tiers = (4.0 + 0.45 * height).min(11.0);
        let foot = self.draw(0.3, 1.6);
        for i in 0..tiers as usize {
            let part = (i as f64 + 0.4) / tiers;
            let wide = radius * (1.05 - part) * self.draw(0.85, 1.15);
            let at = spot.at(
                self.draw(-0.1, 0.1),
                self.draw(-0.1, 0.1),
                foot + (height - foot) * part,
            );
            let tall = 0.75 * (height - foot) / tiers;
            self.lobe(at, [wide, wide, tall], species, usize::from(part > 0.3) + 1);
        }
    }

    fn bare_tree(&mut self, spot: &Spot, species: &Species, height: f64, radius: f64, clear: f64) {
        let thick = (0.016 * height).clamp(0.05, 0.35);
        let fork = clear.min(0.45 * height).max(0.25 * height);
        let top = self.trunk(spot, species, fork, thick);
        let mut ends = vec![(top, [0.0, 0.0, 1.0], 0.42 * (height - fork), 0.75 * thick)];
        for level in 0..3 {
            let mut next = Vec::new();
            for (from, along, length, thick) in ends {
                let arms = if level == 0 { 5 } else { 3 };
                let twist = self.draw(0.0, TAU);
                for arm in 0..arms {
                    let angle = twist + TAU * f64::from(arm) / f64::from(arms);
                    let out = self.draw(0.35, 0.95)
                        * if level == 0 {
                            radius / height * 2.2
                        } else {
                            1.0
                        };
                    let towards: [f64; 3] = [
                        along[0] + out * angle.cos(),
                        along[1] + out * angle.sin(),
                        along[2] + self.draw(-0.15, 0.5),
                    ];
                    let norm = towards.iter().map(|x| x * x).sum::<f64>().sqrt().max(0.1);
                    let towards = towards.map(|x| x / norm);
                    let reach = length * self.draw(0.7, 1.15);
                    let to = [0, 1, 2].map(|i| from[i] + reach * towards[i]);
                    self.rod(from, to, thick, species.bark);
                    next.push((to, towards, 0.62 * reach, (0.55 * thick).max(0.008)));
                }
            }
            ends = next;
        }
    }

    /// A bush of about this size.
    pub(super) fn bush(&mut self, spot: &Spot, size: f64) {
        let number = self.rng.random_range(0..self.kit.bushes.len());
        let species = self.kit.bushes[number];
        let mark = self.mark();
        let count = if size > 0.9 { 6 } else { 3 };
        for i in 0..count {
            let at = spot.at(
                size * self.draw(-0.7, 0.7),
                size * self.draw(-0.7, 0.7),
                size * self.draw(0.3, 0.85),
            );
            let wide = size * self.draw(0.45, 0.75);
            let tall = size * self.draw(0.4, 0.75);
            self.lobe(at, [wide, wide * 0.9, tall], &species, 1 + i % 2);
        }
        self.close(ObjectClass::Tree, spot, mark);
    }

    /// A hedge along the spot's heading.
    pub(super) fn hedge(&mut self, spot: &Spot, length: f64, height: f64) {
        let number = self.rng.random_range(0..self.kit.bushes.len());
        let species = self.kit.bushes[number];
        let mark = self.mark();
        let wide = self.draw(0.5, 1.0);
        // An opaque core with leaves around it.
        self.block(
            spot,
            [length, 0.55 * wide, 0.85 * height],
            species.leaves[0],
        );
        let lobes = (length / 0.9).ceil().max(1.0);
        let rows = (height / 0.8).ceil().max(1.0);
        for row in 0..rows as usize {
            for i in 0..lobes as usize {
                let x = (i as f64 + 0.5 + self.draw(-0.2, 0.2)) / lobes * length - 0.5 * length;
                let z = (row as f64 + 0.55) / rows * height;
                let at = spot.at(x, self.draw(-0.05, 0.05), z);
                let radii = [
                    0.72 * length / lobes,
                    0.5 * wide * self.draw(0.9, 1.15),
                    0.68 * height / rows * self.draw(0.9, 1.15),
                ];
                self.lobe(
                    at,
                    radii,
                    &species,
                    1 + usize::from(row + 1 == rows as usize),
                );
            }
        }
        self.close(ObjectClass::Fence, spot, mark);
    }

    /// Tall grass and weeds: a few flat tufts.
    pub(super) fn weeds(&mut self, spot: &Spot, size: f64) {
        let number = self.rng.random_range(0..self.kit.bushes.len());
        let species = self.kit.bushes[number];
        for _ in 0..3 {
            let at = spot.at(
                size * self.draw(-1.0, 1.0),
                size * self.draw(-0.5, 0.5),
                0.1 * size,
            );
            let tall = self.draw(0.15, 0.5) * size;
            self.lobe(at, [0.6 * size, 0.45 * size, tall], &species, 2);
        }
    }
}
