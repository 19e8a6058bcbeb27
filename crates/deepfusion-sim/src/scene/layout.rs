//! The layout of a street: stretches of road, side streets, and the two sides of the street.

use super::World;
use super::buildings::{self, Plot, Style};
use super::cars;
use super::furniture::Furniture;
use super::greenery::Greens;
use super::widths::Widths;
use crate::config::Scene;
use crate::road::{KERB_HEIGHT, SIDE_STREET_LENGTH, SideStreet};
use crate::texture::ground::{Beyond, Paving, Stretch};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::{FRAC_PI_2, PI};

/// Over this length the widths of two stretches blend, metres.
const BLEND: f64 = 14.0;

/// Kind of one side of a stretch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Frontage {
    Terrace,
    Detached,
    Commercial,
    Park,
}

/// A stretch of the street.
struct Section {
    from: f64,
    to: f64,
    half_width: f32,
    sides: [Side; 2],
}

impl Section {
    fn widths(&self) -> Widths {
        Widths {
            to: self.to,
            half_width: self.half_width,
            sides: self
                .sides
                .each_ref()
                .map(|side| (side.pavement, side.verge)),
        }
    }
}

impl Side {
    /// Adapts what was drawn to the scene.
    fn suited_to(mut self, scene: Scene) -> Self {
        match scene {
            Scene::Night => self.lamps = true,
            Scene::Park => {
                self.parked = self.parked.min(0.15);
                self.trees = if self.trees > 0.0 { self.trees } else { 9.0 };
                self.verge = self.verge.max(0.8);
            }
            Scene::Commercial => {
                self.parked = self.parked.max(0.45);
                self.pavement = self.pavement.max(2.6);
                self.setback = self.setback.min(3.0);
            }
            _ => {}
        }
        self
    }
}

#[derive(Clone, Copy)]
struct Side {
    frontage: Frontage,
    pavement: f32,
    verge: f32,
    /// Distance from the pavement to the houses, metres.
    setback: f64,
    /// Share of the parking places that are taken.
    parked: f64,
    /// Distance between the trees of an avenue, metres; 0: none.
    trees: f64,
    lamps: bool,
}

/// Fills the world: widths, side streets, houses, plants, furniture, parked cars.
pub(super) fn furnish(world: &mut World, rng: &mut ChaCha8Rng) {
    let sections = sections(world, rng);
    let widths: Vec<Widths> = sections.iter().map(Section::widths).collect();
    world.apply_widths(&widths, BLEND);
    add_side_streets(world, rng);
    let greens = Greens::new(world, rng);
    let furniture = Furniture::new(world, rng);
    for section in &sections {
        for side in 0..2 {
            let mut street = StreetSide {
                world,
                greens: &greens,
                furniture: &furniture,
                section,
                side,
            };
            street.build_houses(rng);
            street.build_background(rng);
            street.park_cars(rng);
            street.plant(rng);
            street.furnish(rng);
        }
    }
    line_side_streets(world, rng, &greens);
}

fn sections(world: &mut World, rng: &mut ChaCha8Rng) -> Vec<Section> {
    let (mut from, end) = (world.road.start, world.road.end());
    let scene = world.scene;
    let mut sections = Vec::new();
    while from < end {
        let to = from + rng.random_range(35.0..95.0);
        let drawn_width =
            [3.4f32, 3.9, 4.6, 5.3, 6.1][rng.random_range(0..5)] + rng.random_range(-0.2..0.3);
        let half_width = match scene {
            Scene::Park => drawn_width.min(3.9),
            Scene::Commercial => drawn_width.max(5.3),
            _ => drawn_width,
        };
        let side = |rng: &mut ChaCha8Rng| {
            let drawn = match rng.random_range(0..100) {
                0..=37 => Frontage::Terrace,
                38..=66 => Frontage::Detached,
                67..=83 => Frontage::Commercial,
                _ => Frontage::Park,
            };
            let frontage = match scene {
                Scene::Park => Frontage::Park,
                Scene::Commercial if drawn != Frontage::Terrace => Frontage::Commercial,
                _ => drawn,
            };
            let setback = match frontage {
                Frontage::Terrace => rng.random_range(0.1..2.5),
                Frontage::Detached => rng.random_range(2.5..8.0),
                Frontage::Commercial => rng.random_range(0.3..9.0),
                Frontage::Park => rng.random_range(22.0..40.0),
            };
            Side {
                frontage,
                pavement: rng.random_range(1.5..3.4),
                verge: if rng.random_bool(0.3) {
                    rng.random_range(0.8..2.2)
                } else {
                    0.0
                },
                setback,
                parked: [0.0, 0.15, 0.45, 0.75, 0.95][rng.random_range(0..5)],
                trees: if rng.random_bool(0.4) {
                    rng.random_range(8.0..18.0)
                } else {
                    0.0
                },
                lamps: rng.random_bool(0.6),
            }
            .suited_to(scene)
        };
        let sides = [side(rng), side(rng)];
        let beyond = |side: &Side, rng: &mut ChaCha8Rng| match side.frontage {
            Frontage::Park => Beyond::Grass,
            Frontage::Commercial => Beyond::Paved,
            _ => [Beyond::Grass, Beyond::Paved, Beyond::Gravel][rng.random_range(0..3)],
        };
        let mut paving =
            || [Paving::Slabs, Paving::Cobbles, Paving::Asphalt][rng.random_range(0..3)];
        let paving = [paving(), paving()];
        let dashes: [f32; 2] =
            [[0.0, 0.0], [6.0, 3.0], [9.0, 3.0], [4.0, 1.5]][rng.random_range(0..4)];
        world.stretches.push(Stretch {
            dashes: if half_width > 3.5 { dashes } else { [0.0, 0.0] },
            edge_lines: rng.random_bool(0.3),
            zebra: if rng.random_bool(0.3) {
                rng.random_range(from + 8.0..to - 8.0) as f32
            } else {
                f32::NAN
            },
            asphalt: rng.random_range(0.12..0.24),
            bays: half_width > 5.0 && rng.random_bool(0.5),
            beyond: [beyond(&sides[0], rng), beyond(&sides[1], rng)],
            paving,
            style: None,
        });
        sections.push(Section {
            from,
            to,
            half_width,
            sides,
        });
        from = to;
    }
    sections
}

fn add_side_streets(world: &mut World, rng: &mut ChaCha8Rng) {
    let mut s = world.road.start + 30.0;
    loop {
        s += rng.random_range(28.0..85.0);
        if s > world.road.end() - 30.0 {
            return;
        }
        let straight = (-6..=6).all(|i| world.road.centre(s + 2.0 * f64::from(i)).3.abs() < 0.012);
        if !straight {
            continue;
        }
        for side in 0..2 {
            if rng.random_bool(0.55) {
                world.road.add_side_street(SideStreet {
                    s: s as f32,
                    side,
                    half_width: rng.random_range(2.8..4.2),
                });
            }
        }
    }
}

/// One side of one section, being built.
struct StreetSide<'a> {
    world: &'a mut World,
    greens: &'a Greens,
    furniture: &'a Furniture,
    section: &'a Section,
    side: usize,
}

impl StreetSide<'_> {
    fn plan(&self) -> Side {
        self.section.sides[self.side]
    }

    /// +1 to the left of the road, −1 to the right.
    fn sign(&self) -> f64 {
        if self.side == 1 { 1.0 } else { -1.0 }
    }

    /// Distance of the kerb and of the pavement's outer edge from the centreline at `s`, metres.
    fn edges(&self, s: f64) -> (f64, f64) {
        let sample = self.world.road.sample(self.world.road.index_at(s));
        let kerb = f64::from(sample.half_width);
        (
            kerb,
            kerb + 0.16 + f64::from(sample.verge[self.side] + sample.pavement[self.side]),
        )
    }

    /// Position `out` metres from the centreline on this side at `s`, and the road's heading.
    fn place(&self, s: f64, out: f64) -> (f64, f64, f64) {
        self.world.road.world(s, self.sign() * out)
    }

    /// A position `beyond` metres beyond the kerb, if no road is within `clear` metres of it.
    fn free_place(&self, s: f64, beyond: f64, clear: f32) -> Option<(f64, f64, f64)> {
        let (x, y, heading) = self.place(s, self.edges(s).0 + beyond);
        let p = self.world.road.locate(x, y);
        (self.world.road.kerb_distance(&p) >= clear).then_some((x, y, heading))
    }

    fn build_houses(&mut self, rng: &mut ChaCha8Rng) {
        let plan = self.plan();
        let style = match plan.frontage {
            Frontage::Terrace => Style::Terrace,
            Frontage::Detached => Style::Detached,
            Frontage::Commercial => Style::Commercial,
            Frontage::Park => return,
        };
        let mut s = self.section.from + rng.random_range(0.0..4.0);
        while s < self.section.to - 6.0 {
            let (width, depth): (f64, f64) = match style {
                Style::Terrace => (rng.random_range(6.5..16.0), rng.random_range(9.0..12.0)),
                Style::Detached => (rng.random_range(8.0..13.0), rng.random_range(8.0..11.0)),
                Style::Commercial => (rng.random_range(13.0..27.0), rng.random_range(11.0..17.0)),
            };
            let uneven = if style == Style::Terrace { 0.25 } else { 1.4 };
            let setback = plan.setback + rng.random_range(0.0..uneven);
            let built = self.try_house(rng, s, width, depth, setback, style);
            s += if built {
                width
                    + match style {
                        Style::Terrace if rng.random_bool(0.85) => 0.05,
                        Style::Terrace => rng.random_range(2.5..7.0),
                        Style::Detached => rng.random_range(3.0..11.0),
                        Style::Commercial => rng.random_range(2.0..16.0),
                    }
            } else {
                1.5
            };
        }
    }

    /// Builds a house whose front begins at `s`, unless a road is in its way.
    fn try_house(
        &mut self,
        rng: &mut ChaCha8Rng,
        s: f64,
        width: f64,
        depth: f64,
        setback: f64,
        style: Style,
    ) -> bool {
        let middle = s + 0.5 * width;
        let (_, edge) = self.edges(middle);
        let curvature = self.world.road.centre(middle).3 * self.sign();
        // On the inside of a bend the ends of a straight front are nearer to the road.
        let bulge = (curvature.max(0.0) * width * width / 8.0).min(4.0);
        let out = edge + setback + bulge + 0.5 * depth;
        if curvature > 0.0 && out > 0.8 / curvature {
            return false;
        }
        let (x, y, heading) = self.place(middle, out);
        let half = [0.5 * width, 0.5 * depth];
        if !self.world.is_clear(x, y, heading, half, 1.6) {
            return false;
        }
        let plot = Plot {
            width,
            depth,
            x,
            y,
            heading,
            street_left: self.side == 0,
        };
        buildings::build(self.world, rng, &plot, style);
        true
    }

    /// A second row of houses and trees behind gardens and parks, which closes the view between the houses.
    fn build_background(&mut self, rng: &mut ChaCha8Rng) {
        let mut s = self.section.from + rng.random_range(0.0..12.0);
        while s < self.section.to {
            let base = if self.plan().frontage == Frontage::Park {
                26.0
            } else {
                32.0
            };
            let out = base + rng.random_range(0.0..22.0);
            let (x, y, heading) = self.place(s, out);
            let (width, depth) = (rng.random_range(9.0..24.0), rng.random_range(9.0..13.0));
            let turn = heading + rng.random_range(-0.5..0.5);
            if rng.random_bool(0.55) {
                if self
                    .world
                    .is_clear(x, y, turn, [0.5 * width, 0.5 * depth], 4.0)
                {
                    let plot = Plot {
                        width,
                        depth,
                        x,
                        y,
                        heading: turn,
                        street_left: self.side == 0,
                    };
                    let style = if rng.random_bool(0.7) {
                        Style::Terrace
                    } else {
                        Style::Commercial
                    };
                    buildings::build(self.world, rng, &plot, style);
                }
            } else if self.world.is_clear(x, y, turn, [2.0, 2.0], 3.0) {
                self.greens.tree(self.world, rng, x, y);
            }
            s += rng.random_range(7.0..20.0);
        }
    }

    fn park_cars(&mut self, rng: &mut ChaCha8Rng) {
        let plan = self.plan();
        let mut s = self.section.from + rng.random_range(2.0..6.0);
        while s < self.section.to - 3.0 {
            let (kerb, _) = self.edges(s);
            let spot = if kerb > 4.75 {
                Some((kerb - 1.12, 0.0))
            } else if f64::from(plan.pavement + plan.verge) > 2.3 && kerb > 3.3 {
                Some((kerb + 1.2, f64::from(KERB_HEIGHT)))
            } else {
                None
            };
            if let Some((out, height)) = spot
                && rng.random_bool(plan.parked)
                && self.may_park(s)
            {
                let (x, y, heading) = self.place(s, out + rng.random_range(-0.08..0.08));
                let against = self.side == 1 && rng.random_bool(0.85) || rng.random_bool(0.08);
                let turn = heading + rng.random_range(-0.02..0.02) + if against { PI } else { 0.0 };
                cars::park(self.world, rng, [x, y, height], turn);
            }
            s += rng.random_range(5.5..6.9);
        }
        // Cars on drives and forecourts.
        if matches!(plan.frontage, Frontage::Detached | Frontage::Commercial) && plan.setback > 4.8
        {
            let mut s = self.section.from + rng.random_range(2.0..14.0);
            while s < self.section.to - 2.0 {
                let (kerb, edge) = self.edges(s);
                let beyond = edge - kerb + 2.7;
                if let Some((x, y, heading)) = self.free_place(s, beyond, 3.5) {
                    let turn = heading + self.sign() * FRAC_PI_2;
                    let turn = turn + if rng.random_bool(0.5) { PI } else { 0.0 };
                    cars::park(self.world, rng, [x, y, f64::from(KERB_HEIGHT)], turn);
                }
                s += rng.random_range(5.0..28.0);
            }
        }
    }

    /// False in a junction and on a crossing.
    fn may_park(&self, s: f64) -> bool {
        let junction = self.world.road.side_streets().iter().any(|street| {
            street.side == self.side
                && (f64::from(street.s) - s).abs() < f64::from(street.half_width) + 7.5
        });
        let stretch =
            &self.world.stretches[usize::from(self.world.stretch_of[self.world.road.index_at(s)])];
        let crossing = (f64::from(stretch.zebra) - s).abs() < 5.0;
        !junction && !crossing
    }

    fn plant(&mut self, rng: &mut ChaCha8Rng) {
        let plan = self.plan();
        let crowded = plan.frontage == Frontage::Terrace && plan.setback < 1.0;
        // The trees along the kerb.
        if plan.trees > 0.0 && plan.pavement + plan.verge > 2.2 && !crowded {
            let mut s = self.section.from + rng.random_range(0.0..plan.trees);
            while s < self.section.to {
                let beyond = if plan.verge > 0.7 {
                    0.16 + 0.5 * f64::from(plan.verge)
                } else {
                    0.75
                };
                if let Some((x, y, _)) = self.free_place(s, beyond, 0.6) {
                    self.greens.tree(self.world, rng, x, y);
                }
                s += plan.trees * rng.random_range(0.85..1.25);
            }
        }
        // Gardens: a hedge, a fence or a wall along the pavement, with gaps, and plants behind it.
        if plan.setback > 2.0 && plan.frontage != Frontage::Commercial
            || plan.frontage == Frontage::Park
        {
            self.enclose(rng);
            let deep = plan.setback.min(20.0);
            let mut s = self.section.from + rng.random_range(0.0..5.0);
            while s < self.section.to {
                let (kerb, edge) = self.edges(s);
                let beyond = edge - kerb + rng.random_range(1.0..(deep - 0.4).max(1.1));
                if let Some((x, y, _)) = self.free_place(s, beyond, 2.0) {
                    if plan.setback > 4.0 && rng.random_bool(0.45) {
                        self.greens.tree(self.world, rng, x, y);
                    } else {
                        self.greens.bush(self.world, rng, x, y);
                    }
                }
                s += rng.random_range(2.5..9.0);
            }
        }
    }

    fn enclose(&mut self, rng: &mut ChaCha8Rng) {
        let mut s = self.section.from + 1.0;
        while s < self.section.to - 2.0 {
            let length: f64 = rng.random_range(3.0..9.0);
            let kind = rng.random_range(0..10);
            let mut run = rng.random_range(1..=3);
            while run > 0 && s + length < self.section.to {
                let middle = s + 0.5 * length;
                let (_, edge) = self.edges(middle);
                let (x, y, heading) = self.place(middle, edge + 0.5);
                if kind < 8 && self.world.is_clear(x, y, heading, [0.5 * length, 0.4], 1.0) {
                    if kind < 4 {
                        self.greens.hedge(self.world, rng, x, y, heading, length);
                    } else {
                        self.furniture.fence(self.world, rng, x, y, heading, length);
                    }
                }
                s += length + 0.02;
                run -= 1;
            }
            s += rng.random_range(1.0..4.5);
        }
    }

    fn furnish(&mut self, rng: &mut ChaCha8Rng) {
        let plan = self.plan();
        let towards = -self.sign() * FRAC_PI_2;
        if plan.lamps {
            let mut s = self.section.from + rng.random_range(0.0..20.0);
            while s < self.section.to {
                if let Some((x, y, heading)) = self.free_place(s, 0.45, 0.3) {
                    self.furniture
                        .lamp(self.world, rng, x, y, heading + towards);
                }
                s += rng.random_range(20.0..32.0);
            }
        }
        let mut s = self.section.from + rng.random_range(0.0..8.0);
        while s < self.section.to {
            let pavement = f64::from(plan.pavement + plan.verge);
            match rng.random_range(0..10) {
                0..=3 => {
                    if let Some((x, y, heading)) = self.free_place(s, 0.5, 0.35) {
                        let facing = if self.side == 0 { PI } else { 0.0 };
                        self.furniture.sign(self.world, rng, x, y, heading + facing);
                    }
                }
                4..=5 => {
                    for i in 0..rng.random_range(2..7) {
                        let at = s + 1.5 * f64::from(i);
                        if let Some((x, y, _)) = self.free_place(at, 0.35, 0.25) {
                            self.furniture.bollard(self.world, rng, x, y);
                        }
                    }
                }
                _ => {
                    if let Some((x, y, heading)) = self.free_place(s, pavement - 0.25, 1.0) {
                        self.furniture.cabinet(self.world, rng, x, y, heading);
                    }
                }
            }
            s += rng.random_range(5.0..17.0);
        }
    }
}

/// Houses along the side streets and across their ends.
fn line_side_streets(world: &mut World, rng: &mut ChaCha8Rng, greens: &Greens) {
    let streets = world.road.side_streets().to_vec();
    for street in streets {
        let sign = if street.side == 1 { 1.0 } else { -1.0 };
        let (s, half) = (f64::from(street.s), f64::from(street.half_width));
        for along in [-1.0, 1.0] {
            let mut out = 20.0 + rng.random_range(0.0..6.0);
            while out < f64::from(SIDE_STREET_LENGTH) - 8.0 {
                let (width, depth) = (rng.random_range(8.0..15.0), rng.random_range(8.0..11.0));
                let setback = half + rng.random_range(2.2..5.0) + 0.5 * depth;
                let (x, y, heading) = world.road.world(s, sign * (out + 0.5 * width));
                let (sin, cos) = heading.sin_cos();
                let (x, y) = (x + along * setback * cos, y + along * setback * sin);
                let turn = heading + FRAC_PI_2;
                if rng.random_bool(0.75) {
                    if world.is_clear(x, y, turn, [0.5 * width, 0.5 * depth], 1.5) {
                        let plot = Plot {
                            width,
                            depth,
                            x,
                            y,
                            heading: turn,
                            street_left: along > 0.0,
                        };
                        buildings::build(world, rng, &plot, Style::Terrace);
                    }
                } else if world.is_clear(x, y, turn, [1.5, 1.5], 2.0) {
                    greens.tree(world, rng, x, y);
                }
                out += width + rng.random_range(0.0..5.0);
            }
        }
        let (x, y, heading) = world
            .road
            .world(s, sign * (f64::from(SIDE_STREET_LENGTH) + 9.0));
        if world.is_clear(x, y, heading, [half + 6.0, 5.0], 1.0) {
            let plot = Plot {
                width: 2.0 * half + 12.0,
                depth: 10.0,
                x,
                y,
                heading,
                street_left: street.side == 0,
            };
            buildings::build(world, rng, &plot, Style::Terrace);
        }
    }
}
