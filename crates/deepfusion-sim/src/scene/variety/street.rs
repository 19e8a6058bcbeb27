//! Streets: rows of houses, gardens, parked cars on both sides, trees over the road, people.

use super::houses::Kind;
use super::sections::{Frontage, Parking, ROOM, Section, Side, apply_widths, sections};
use super::site::{Site, Spot};
use crate::config::Scene;
use crate::road::{KERB_HEIGHT, SIDE_STREET_LENGTH, SideStreet};
use crate::scene::ObjectClass;
use rand::Rng;
use std::f64::consts::{FRAC_PI_2, PI};

/// Furnishes a street.
pub(super) fn furnish(site: &mut Site) {
    let sections = sections(site);
    apply_widths(site, &sections);
    side_streets(site);
    for section in &sections {
        for side in 0..2 {
            let mut row = Row {
                site,
                section,
                plan: section.sides[side],
                side,
            };
            row.houses();
            row.background();
            row.park();
            row.avenue();
            row.gardens();
            row.furniture();
            row.people();
        }
    }
    line_side_streets(site);
    site.wires();
    site.hills(0.25);
}

fn side_streets(site: &mut Site) {
    let mut s = site.world.road.start + 25.0;
    loop {
        s += site.draw(22.0, 90.0);
        if s > site.world.road.end() - 30.0 {
            return;
        }
        let road = &site.world.road;
        let straight = (-6..=6).all(|i| road.centre(s + 2.0 * f64::from(i)).3.abs() < 0.012);
        if !straight {
            continue;
        }
        for side in 0..2 {
            if site.chance(0.55) {
                let half_width = site.draw(2.3, 5.5) as f32;
                site.world.road.add_side_street(SideStreet {
                    s: s as f32,
                    side,
                    half_width,
                });
            }
        }
    }
}

/// One side of one section, being built.
struct Row<'a, 'b> {
    site: &'a mut Site<'b>,
    section: &'a Section,
    plan: Side,
    side: usize,
}

impl Row<'_, '_> {
    /// +1 to the left of the road, −1 to the right.
    fn sign(&self) -> f64 {
        if self.side == 1 { 1.0 } else { -1.0 }
    }

    /// Distance of the kerb and of the pavement's outer edge from the centreline, metres.
    fn edges(&self, s: f64) -> (f64, f64) {
        let road = &self.site.world.road;
        let sample = road.sample(road.index_at(s));
        let kerb = f64::from(sample.half_width);
        let wide = sample.verge[self.side] + sample.pavement[self.side];
        (kerb, kerb + 0.16 + f64::from(wide))
    }

    /// The spot `out` metres from the centreline on this side.
    fn spot(&self, s: f64, out: f64) -> Spot {
        self.site.beside(s, self.sign() * out)
    }

    /// The spot `beyond` metres beyond the kerb, if no road is within `clear` metres of it.
    fn free(&self, s: f64, beyond: f64, clear: f32) -> Option<Spot> {
        let spot = self.spot(s, self.edges(s).0 + beyond);
        self.site.is_clear(&spot, [0.1, 0.1], clear).then_some(spot)
    }

    /// Direction towards the road, relative to the road's own heading.
    fn inward(&self) -> f64 {
        -self.sign() * FRAC_PI_2
    }

    fn houses(&mut self) {
        let plan = self.plan;
        let kind = match plan.frontage {
            Frontage::Row => Kind::Row,
            Frontage::Villas => Kind::Villa,
            Frontage::Blocks => Kind::Block,
            Frontage::Works => Kind::Hall,
            Frontage::Wall if self.site.chance(0.6) => Kind::Block,
            _ => return,
        };
        let mut s = self.section.from + self.site.draw(0.0, 4.0);
        while s < self.section.to - 5.0 {
            let site = &mut *self.site;
            let (width, depth) = match kind {
                Kind::Row => (site.draw(5.0, 15.0), site.draw(8.0, 12.0)),
                Kind::Villa => (site.draw(7.0, 14.0), site.draw(7.0, 12.0)),
                Kind::Shed => (site.draw(3.0, 6.0), site.draw(3.0, 6.0)),
                _ => (site.draw(11.0, 30.0), site.draw(10.0, 18.0)),
            };
            let uneven = if kind == Kind::Row { 0.4 } else { 2.5 };
            let setback = plan.setback + site.draw(0.0, uneven);
            let turn = if kind == Kind::Row || !site.chance(0.15) {
                0.0
            } else {
                site.draw(-0.25, 0.25)
            };
            let gap = match kind {
                Kind::Row if site.chance(0.8) => 0.05,
                Kind::Row => site.draw(1.5, 6.0),
                Kind::Villa => site.draw(2.0, 11.0),
                _ => site.draw(0.1, 14.0),
            };
            let built = self.house(s, [width, depth], setback, turn, kind);
            s += if built { width + gap } else { 1.5 };
        }
    }

    fn house(&mut self, s: f64, size: [f64; 2], setback: f64, turn: f64, kind: Kind) -> bool {
        let middle = s + 0.5 * size[0];
        let (_, edge) = self.edges(middle);
        let curvature = self.site.world.road.centre(middle).3 * self.sign();
        let bulge = (curvature.max(0.0) * size[0] * size[0] / 8.0).min(4.0);
        let out = edge + setback + bulge + 0.5 * size[1] + turn.abs() * 0.5 * size[0];
        if curvature > 0.0 && out > 0.8 / curvature {
            return false;
        }
        let mut spot = self.spot(middle, out);
        spot.heading += turn;
        let half = [0.5 * size[0], 0.5 * size[1]];
        if !self.site.is_clear(&spot, half, 1.0) {
            return false;
        }
        self.site.house(&spot, size, kind, self.side == 0, false);
        // A garage or a shed beside a villa.
        if kind == Kind::Villa && self.site.chance(0.35) {
            let shed = spot.spot(0.5 * size[0] + 2.2, self.site.draw(-2.0, 2.0), 0.0, 0.0);
            if self.site.is_clear(&shed, [1.8, 2.8], 1.0) {
                self.site
                    .house(&shed, [3.2, 5.4], Kind::Shed, self.side == 0, false);
            }
        }
        true
    }

    /// Houses and trees that close the view between and behind the houses.
    fn background(&mut self) {
        let green = matches!(self.plan.frontage, Frontage::Green | Frontage::Wall);
        let mut s = self.section.from + self.site.draw(0.0, 10.0);
        while s < self.section.to {
            let base = if green { 22.0 } else { 30.0 };
            let out = base + self.site.draw(0.0, 30.0);
            let mut spot = self.spot(s, out);
            spot.heading += self.site.draw(-0.5, 0.5);
            let size = [self.site.draw(8.0, 26.0), self.site.draw(8.0, 14.0)];
            let leafy = if self.site.world.scene == Scene::Park {
                0.85
            } else {
                0.25 + 0.5 * self.site.variety.trees
            };
            if self.site.chance(leafy) {
                if self.site.is_clear(&spot, [2.0, 2.0], 3.0) {
                    let (h, r) = (self.site.draw(7.0, 18.0), self.site.draw(2.5, 5.5));
                    self.site.tree(&spot, h, r, 2.0);
                }
            } else if self
                .site
                .is_clear(&spot, [0.5 * size[0], 0.5 * size[1]], 4.0)
            {
                let kind = [Kind::Row, Kind::Block, Kind::Villa][self.site.rng.random_range(0..3)];
                self.site.house(&spot, size, kind, self.side == 0, true);
            }
            s += self.site.draw(6.0, 20.0);
        }
    }

    /// False in a junction.
    fn may_park(&self, s: f64) -> bool {
        !self.site.world.road.side_streets().iter().any(|street| {
            street.side == self.side
                && (f64::from(street.s) - s).abs() < f64::from(street.half_width) + 6.5
        })
    }

    fn park(&mut self) {
        let plan = self.plan;
        if plan.parking != Parking::None {
            let mut s = self.section.from + self.site.draw(2.0, 5.0);
            while s < self.section.to - 3.0 {
                let step = match plan.parking {
                    Parking::Bays(_) => 2.75 + self.site.draw(0.0, 0.3),
                    _ => 0.0,
                };
                let length = self.park_one(s);
                s += if step > 0.0 {
                    step
                } else {
                    length + self.site.draw(0.35, 1.3)
                };
            }
        }
        // Cars on drives and forecourts.
        if plan.setback > 5.0 && plan.frontage != Frontage::Green {
            let mut s = self.section.from + self.site.draw(2.0, 14.0);
            while s < self.section.to - 2.0 {
                let (kerb, edge) = self.edges(s);
                if let Some(mut spot) = self.free(s, edge - kerb + 2.9, 3.4) {
                    spot.heading += self.inward() + if self.site.chance(0.5) { PI } else { 0.0 };
                    if let Some(model) = self.site.vehicle(|m| m.size[0] < 5.2)
                        && self.site.chance(0.3 + 0.5 * self.site.variety.parked)
                    {
                        self.site.put(&model, &spot);
                    }
                }
                s += self.site.draw(4.0, 24.0);
            }
        }
    }

    /// Parks a car at `s` with the section's probability; returns the length of the place.
    fn park_one(&mut self, s: f64) -> f64 {
        let plan = self.plan;
        let large = self.site.chance(0.06);
        let bays = matches!(plan.parking, Parking::Bays(_));
        let model = self.site.vehicle(|m| {
            if large && !bays {
                m.size[0] < 8.5
            } else {
                m.size[0] < 5.3 && m.size[2] < 2.3
            }
        });
        let Some(model) = model else { return 6.0 };
        let (length, width) = (f64::from(model.size[0]), f64::from(model.size[1]));
        let middle = s + 0.5 * length;
        let (kerb, edge) = self.edges(middle);
        let uneven = self.site.draw(-0.12, 0.12);
        let (out, turn, z) = match plan.parking {
            Parking::Road => (kerb - 0.22 - 0.5 * width, 0.0, 0.0),
            Parking::Half => (
                kerb + 0.42 - 0.5 * (width - 1.7),
                0.0,
                0.5 * f64::from(KERB_HEIGHT),
            ),
            Parking::Pavement => (
                kerb + 0.2 + 0.5 * width,
                0.0,
                f64::from(self.site.world.road.kerb),
            ),
            Parking::Bays(angle) => (
                edge + 0.4 + 0.5 * length,
                angle,
                f64::from(self.site.world.road.kerb),
            ),
            Parking::None => return 6.0,
        };
        let room = if self.side == 0 { ROOM } else { 0.35 };
        if !self.site.chance(plan.parked) || !self.may_park(middle) || out - 0.5 * width < room {
            return length;
        }
        let mut spot = self.spot(middle, out + uneven);
        spot.z = z;
        let against = self.side == 1 && self.site.chance(0.85) || self.site.chance(0.08);
        spot.heading +=
            self.sign() * turn + self.site.draw(-0.03, 0.03) + if against { PI } else { 0.0 };
        self.site.put(&model, &spot);
        length
    }

    /// The trees along the kerb; their crowns reach over the road.
    fn avenue(&mut self) {
        let plan = self.plan;
        if plan.avenue == 0.0 || plan.frontage == Frontage::Row && plan.setback < 0.6 {
            return;
        }
        let (height, radius) = (self.site.draw(4.5, 16.0), self.site.draw(1.6, 5.5));
        let clear = self.site.draw(2.2, 4.0);
        let mut s = self.section.from + self.site.draw(0.0, plan.avenue);
        while s < self.section.to {
            let beyond = if plan.verge > 0.7 {
                0.16 + 0.5 * f64::from(plan.verge)
            } else if plan.parking == Parking::Pavement {
                f64::from(plan.pavement) + 0.4
            } else {
                0.7
            };
            if let Some(spot) = self.free(s, beyond, 0.5) {
                let size = self.site.draw(0.75, 1.2);
                self.site.tree(&spot, height * size, radius * size, clear);
            }
            s += plan.avenue * self.site.draw(0.8, 1.3);
        }
    }

    /// Hedges, fences and walls along the pavement, with gaps; plants behind them.
    fn gardens(&mut self) {
        let plan = self.plan;
        let open = matches!(plan.frontage, Frontage::Blocks) && !self.site.chance(0.2);
        if plan.setback < 1.2 || open || matches!(plan.parking, Parking::Bays(_)) {
            return;
        }
        let mut s = self.section.from + 1.0;
        while s < self.section.to - 2.0 {
            let length = self.site.draw(2.5, 9.0);
            let middle = s + 0.5 * length;
            let (_, edge) = self.edges(middle);
            let spot = self.spot(middle, edge + 0.45);
            let wanted = match plan.frontage {
                Frontage::Wall => 0.95,
                Frontage::Green => 0.35,
                Frontage::Works => 0.6,
                _ => 0.8,
            };
            if self.site.chance(wanted) && self.site.is_clear(&spot, [0.5 * length, 0.5], 0.8) {
                self.site.enclosure(&spot, length);
            } else {
                s += self.site.draw(1.0, 4.0);
            }
            s += length + 0.02;
        }
        let deep = plan.setback.min(22.0);
        let woods = if plan.frontage == Frontage::Green {
            0.45
        } else {
            1.0
        };
        let mut s = self.section.from + self.site.draw(0.0, 4.0);
        while s < self.section.to {
            let (kerb, edge) = self.edges(s);
            let beyond = edge - kerb + self.site.draw(1.0, (deep - 0.3).max(1.1));
            if let Some(spot) = self.free(s, beyond, 1.2) {
                let tall = deep > 3.0 && self.site.chance(0.35 + 0.4 * self.site.variety.trees);
                if tall {
                    let (h, r) = (self.site.draw(3.0, 15.0), self.site.draw(1.2, 4.5));
                    let clear = self.site.draw(0.6, 3.0);
                    self.site.tree(&spot, h, r, clear);
                } else {
                    let size = self.site.draw(0.4, 1.5);
                    self.site.bush(&spot, size);
                }
            }
            s += self.site.draw(1.5, 7.0) * woods / (0.5 + self.site.variety.trees);
        }
    }

    fn furniture(&mut self) {
        let plan = self.plan;
        if self.site.chance(0.65) {
            let apart = self.site.draw(16.0, 34.0);
            let mut s = self.section.from + self.site.draw(0.0, apart);
            while s < self.section.to {
                if let Some(mut spot) = self.free(s, 0.45, 0.3) {
                    spot.heading += self.inward();
                    self.site.lamp(&spot);
                }
                s += apart;
            }
        }
        let often = 3.0 + 14.0 * (1.0 - self.site.variety.clutter);
        let mut s = self.section.from + self.site.draw(0.0, often);
        while s < self.section.to {
            let wide = f64::from(plan.pavement + plan.verge);
            match self.site.rng.random_range(0..10) {
                0..=2 => {
                    if let Some(mut spot) = self.free(s, 0.4, 0.3) {
                        spot.heading += if self.side == 0 { PI } else { 0.0 };
                        self.site.sign(&spot);
                    }
                }
                3 => {
                    for i in 0..self.site.rng.random_range(2..9) {
                        let at = s + 1.6 * f64::from(i);
                        if let Some(spot) = self.free(at, 0.35, 0.25) {
                            let mark = self.site.mark();
                            let metal = self.site.kit.metal[3];
                            self.site.column(&spot, 0.07, 0.9, metal);
                            self.site.close(ObjectClass::Pole, &spot, mark);
                        }
                    }
                }
                4 => {
                    let junction = self
                        .site
                        .world
                        .road
                        .side_streets()
                        .iter()
                        .any(|street| (f64::from(street.s) - s).abs() < 14.0);
                    if junction && let Some(mut spot) = self.free(s, 0.5, 0.3) {
                        spot.heading += PI;
                        self.site.lights(&spot);
                    }
                }
                _ => {
                    let beyond = if self.site.chance(0.5) {
                        wide - 0.3
                    } else {
                        0.7
                    };
                    if let Some(mut spot) = self.free(s, beyond.max(0.6), 0.45) {
                        if self.site.chance(0.2) {
                            spot.heading += self.inward();
                        }
                        self.site.random_prop(&spot);
                    }
                }
            }
            s += often * self.site.draw(0.4, 1.6);
        }
    }

    /// People on the pavement, alone and in groups.
    fn people(&mut self) {
        let often = 4.0 / (0.05 + self.site.variety.people);
        let mut s = self.section.from + self.site.draw(0.0, often);
        while s < self.section.to {
            let wide = f64::from(self.plan.pavement + self.plan.verge).max(1.0);
            for _ in 0..[1, 1, 1, 2, 2, 3, 5][self.site.rng.random_range(0..7)] {
                let at = s + self.site.draw(-0.9, 0.9);
                let class = if self.site.chance(0.93) {
                    ObjectClass::Pedestrian
                } else {
                    ObjectClass::Bicycle
                };
                let beyond = self.site.draw(0.3, wide + 0.5);
                if let Some(mut spot) = self.free(at, beyond, 0.25)
                    && let Some(model) = self.site.person(class)
                {
                    spot.heading += match self.site.rng.random_range(0..5) {
                        0 => self.site.draw(0.0, std::f64::consts::TAU),
                        1 | 2 => PI,
                        _ => 0.0,
                    };
                    self.site.put(&model, &spot);
                }
            }
            s += often * self.site.draw(0.5, 1.7);
        }
    }
}

/// Houses, trees and cars along the side streets and across their ends.
fn line_side_streets(site: &mut Site) {
    for street in site.world.road.side_streets().to_vec() {
        let sign = if street.side == 1 { 1.0 } else { -1.0 };
        let (s, half) = (f64::from(street.s), f64::from(street.half_width));
        for along in [-1.0, 1.0] {
            let mut out = 18.0 + site.draw(0.0, 6.0);
            while out < f64::from(SIDE_STREET_LENGTH) - 8.0 {
                let size = [site.draw(7.0, 16.0), site.draw(8.0, 11.0)];
                let setback = half + site.draw(1.8, 5.0) + 0.5 * size[1];
                let centre = site.beside(s, sign * (out + 0.5 * size[0]));
                let spot = centre.spot(along * setback, 0.0, 0.0, FRAC_PI_2);
                if site.chance(0.7) {
                    if site.is_clear(&spot, [0.5 * size[0], 0.5 * size[1]], 1.5) {
                        site.house(&spot, size, Kind::Row, along > 0.0, true);
                    }
                } else if site.is_clear(&spot, [1.5, 1.5], 2.0) {
                    let (h, r) = (site.draw(5.0, 12.0), site.draw(1.5, 4.0));
                    site.tree(&spot, h, r, 2.2);
                }
                if site.chance(0.6 * site.variety.parked) && half > 2.9 {
                    let car = centre.spot(along * (half - 1.05), 0.0, 0.0, FRAC_PI_2);
                    if let Some(model) = site.vehicle(|m| m.size[0] < 5.2) {
                        site.put(&model, &Spot { z: 0.0, ..car });
                    }
                }
                out += size[0] + site.draw(0.0, 5.0);
            }
        }
        let end = site.beside(s, sign * (f64::from(SIDE_STREET_LENGTH) + 9.0));
        if site.is_clear(&end, [half + 6.0, 5.0], 1.0) {
            let size = [2.0 * half + 12.0, 10.0];
            site.house(&end, size, Kind::Row, street.side == 0, true);
        }
    }
}
