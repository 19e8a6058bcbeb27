//! Motorways and wide main roads: several lanes, guard rails, gantries, bridges, banks with bushes.

use super::sections::{Section, Side, apply_widths};
use super::site::{Site, Spot};
use crate::scene::{Lane, ObjectClass};
use crate::texture::ground::Stretch;
use crate::texture::ground_style::Line;
use rand::Rng;
use std::f64::consts::{FRAC_PI_2, PI};

/// Width of a lane, metres.
const LANE: f64 = 3.75;

/// Furnishes a motorway.
pub(super) fn furnish(site: &mut Site) {
    site.world.road.kerb = 0.0;
    let (right, left) = (site.rng.random_range(0..2u8), site.rng.random_range(0..3u8));
    let widest = f64::from(right.max(left));
    let half = 1.65 + LANE * (widest + 0.5) + site.draw(0.5, 2.8);
    let section = Section {
        from: site.world.road.start,
        to: site.world.road.end() + 1.0,
        half_width: half as f32,
        sides: [Side::open(), Side::open()],
    };
    apply_widths(site, &[section]);
    paint(site, half, [right, left]);
    lanes(site, [right, left]);
    rails(site, half);
    let second = site.world.stretches[0]
        .style
        .map_or(0.0, |l| f64::from(l.second[1]));
    for side in [-1.0, 1.0] {
        let from = half + 2.0 + if side > 0.0 { second } else { 0.0 };
        verge(site, side, from);
    }
    over(site, half);
    site.hills(0.7);
}

fn paint(site: &mut Site, half: f64, [right, left]: [u8; 2]) {
    let mut style = site.style(half as f32);
    style.road = site.asphalt();
    style.crossing = 0.0;
    style.leaves = [0.0, 0.1];
    style.beyond = [site.grass(), site.grass()];
    style.lines = [None; 6];
    let mut slot = 0;
    let mut line = |at: f64, dash| {
        if slot < 6 {
            style.lines[slot] = Some(Line {
                at: at as f32,
                half: 0.075,
                dash,
            });
            slot += 1;
        }
    };
    // First the lines between lanes, then those along the edges.
    for i in 0..(right + left) {
        let at = -1.65 - LANE * (f64::from(right) - 0.5) + LANE * f64::from(i);
        line(at, [18.0, 6.0]);
    }
    line(-1.65 - LANE * (f64::from(right) + 0.5), [0.0; 2]);
    line(-1.65 + LANE * (f64::from(left) + 0.5), [0.0; 2]);
    if site.chance(0.75) {
        let from = site.draw(1.5, 5.0) as f32;
        style.second = [from, from + site.draw(8.0, 14.0) as f32];
    }
    site.world.stretches.push(Stretch::styled(style));
}

fn lanes(site: &mut Site, [right, left]: [u8; 2]) {
    for i in -i32::from(right)..=i32::from(left) {
        site.world.lanes.push(Lane {
            lateral: -1.65 + LANE * f64::from(i),
            forward: true,
        });
    }
}

/// A rail, a wall or nothing along an edge of the carriageway.
fn rails(site: &mut Site, half: f64) {
    let kit = site.kit;
    for side in [-1.0, 1.0] {
        let kind = site.rng.random_range(0..6);
        let metal = site.any_or_wild(&kit.metal);
        let stone = site.any_or_wild(&kit.stone);
        let out = side * (half + site.draw(0.4, 1.2));
        let (mut s, end) = (site.world.road.start, site.world.road.end());
        let height = site.draw(2.5, 5.0);
        while s < end {
            let step = 4.0;
            let a = site.beside(s, out);
            let b = site.beside((s + step).min(end), out);
            let spot = between(&a, &b);
            let long = (b.x - a.x).hypot(b.y - a.y).max(0.1) + 0.05;
            let mark = site.mark();
            match kind {
                0..=2 => {
                    let beam = spot.spot(0.0, 0.0, 0.45, 0.0);
                    site.block(&beam, [long, 0.08, 0.31], metal);
                    let post = spot.spot(0.0, 0.1 * side, 0.0, 0.0);
                    site.block(&post, [0.1, 0.08, 0.75], metal);
                    if kind == 2 {
                        let upper = spot.spot(0.0, 0.0, 0.85, 0.0);
                        site.block(&upper, [long, 0.08, 0.12], metal);
                    }
                }
                3 => site.block(&spot, [long, 0.4, 0.9], stone),
                4 => {
                    // A noise barrier, some metres away.
                    let wall = spot.spot(0.0, 2.0 * side, 0.0, 0.0);
                    site.block(&wall, [long, 0.25, height], stone);
                }
                _ => {}
            }
            site.close(ObjectClass::Misc, &spot, mark);
            s += step;
        }
    }
}

/// The spot halfway between two others, heading from the first to the second.
pub(super) fn between(a: &Spot, b: &Spot) -> Spot {
    Spot {
        x: 0.5 * (a.x + b.x),
        y: 0.5 * (a.y + b.y),
        z: a.z.min(b.z),
        heading: (b.y - a.y).atan2(b.x - a.x),
    }
}

/// Banks, bushes and woods more than `from` metres from the centreline.
pub(super) fn verge(site: &mut Site, side: f64, from: f64) {
    let kit = site.kit;
    let end = site.world.road.end();
    let mut s = site.world.road.start;
    let grass = {
        let ground = site.grass();
        let mut pattern = crate::texture::pattern::Pattern::plain(site.rng, ground.colour);
        pattern.kind = crate::texture::pattern::Kind::Blotches;
        pattern.colours[1] = ground.other;
        pattern.scale = 2.0;
        pattern.grain = [0.6, 0.5];
        pattern.dirt = 0.0;
        site.world
            .material(crate::texture::Material::Pattern(Box::new(pattern)))
    };
    let mut height = 0.0f64;
    let leafy = site.variety.trees;
    let apart = site.draw(1.2, 9.0);
    while s < end {
        // The bank begins and ends at random places.
        if site.chance(0.12) {
            height = if height > 0.3 || site.chance(0.4) {
                0.0
            } else {
                site.draw(0.5, 5.0)
            };
        }
        let step = 6.0;
        let slope = 2.0 * height;
        if height > 0.0 {
            let material = if height > 3.0 && site.chance(0.02) {
                site.any(&kit.stone)
            } else {
                grass
            };
            let whole = slope + 9.0;
            let a = site.beside(s, side * (from + 0.5 * whole));
            let b = site.beside((s + step).min(end), side * (from + 0.5 * whole));
            let spot = between(&a, &b);
            let long = (b.x - a.x).hypot(b.y - a.y) + 0.6;
            let turned = spot.spot(0.0, 0.0, 0.0, side * FRAC_PI_2);
            let mark = site.mark();
            site.bank(&turned, long, height, [slope, 9.0], material);
            site.close(ObjectClass::Misc, &turned, mark);
        }
        let mut at = s;
        while at < (s + step).min(end) {
            let out = from + slope + site.draw(0.6, 10.0);
            let base = Spot {
                z: height,
                ..site.beside(at, side * out)
            };
            if site.chance(0.25 + 0.6 * leafy) {
                if site.chance(0.45) {
                    let (h, r) = (site.draw(4.0, 14.0), site.draw(1.5, 4.0));
                    let clear = site.draw(0.3, 2.5);
                    site.tree(&base, h, r, clear);
                } else {
                    let size = site.draw(0.5, 2.2);
                    site.bush(&base, size);
                }
            } else if site.chance(0.2) {
                let size = site.draw(0.4, 1.0);
                site.weeds(&base, size);
            }
            at += apart * site.draw(0.5, 1.5);
        }
        s += step;
    }
}

/// Gantries, signs, lamps and bridges.
fn over(site: &mut Site, half: f64) {
    let kit = site.kit;
    let end = site.world.road.end();
    let mut s = site.world.road.start + site.draw(10.0, 90.0);
    while s < end {
        match site.rng.random_range(0..6) {
            0 => site.bridge(s, half + 4.0),
            1..=2 => {
                let middle = Spot {
                    z: 0.0,
                    ..site.beside(s, 0.0)
                };
                let mark = site.mark();
                let metal = site.any(&kit.metal);
                let high = site.draw(5.6, 6.8);
                let out = half + 1.6;
                for side in [-1.0, 1.0] {
                    let post = middle.spot(0.0, side * out, 0.0, 0.0);
                    site.block(&post, [0.35, 0.35, high + 0.6], metal);
                }
                let beam = middle.spot(0.0, 0.0, high, 0.0);
                site.block(&beam, [0.4, 2.0 * out, 0.5], metal);
                let board = kit.signs[1];
                for i in 0..site.rng.random_range(1..4) {
                    let y = (f64::from(i) - 1.0) * 0.6 * half + site.draw(-0.5, 0.5);
                    let at = middle.spot(-0.25, y, high - 0.7, 0.0);
                    let (wide, tall) = (site.draw(2.0, 4.5), site.draw(1.5, 2.8));
                    site.block(&at, [0.08, wide, tall], board);
                }
                site.close(ObjectClass::Pole, &middle, mark);
            }
            3..=4 => {
                let out = half + site.draw(1.3, 3.0);
                let mut spot = site.beside(s, -out);
                spot.heading += PI;
                let mark = site.mark();
                let (wide, tall) = (site.draw(1.0, 4.0), site.draw(0.8, 2.6));
                let foot = site.draw(0.8, 2.2);
                for y in [-0.35, 0.35] {
                    let post = spot.spot(-0.08, y * wide, 0.0, 0.0);
                    site.column(&post, 0.06, foot + tall, kit.metal[0]);
                }
                let board = site.any(&[kit.signs[1], kit.signs[2], kit.signs[3]]);
                site.block(&spot.spot(0.0, 0.0, foot, 0.0), [0.06, wide, tall], board);
                site.close(ObjectClass::Pole, &spot, mark);
            }
            _ => {
                let mut spot = site.beside(s, half + 1.5);
                spot.heading -= FRAC_PI_2;
                site.lamp(&spot);
            }
        }
        s += site.draw(25.0, 160.0);
    }
}
