//! Country roads: no pavement, fields, rows of trees, woods, banks, farms.

use super::houses::Kind;
use super::motorway::{between, verge};
use super::sections::{Section, Side, apply_widths};
use super::site::{Site, Spot};
use crate::scene::ObjectClass;
use crate::texture::ground::Stretch;
use crate::texture::ground_style::Line;
use rand::Rng;

/// Furnishes a country road.
pub(super) fn furnish(site: &mut Site) {
    site.world.road.kerb = 0.0;
    let half = site.draw(2.75, 4.2);
    let mut sections = Vec::new();
    let (mut from, end) = (site.world.road.start, site.world.road.end());
    while from < end {
        let to = from + site.draw(50.0, 160.0);
        sections.push(Section {
            from,
            to,
            half_width: half as f32,
            sides: [Side::open(), Side::open()],
        });
        let style = ground(site, half);
        site.world.stretches.push(Stretch::styled(style));
        from = to;
    }
    // All stretches share one road surface.
    let road = site.world.stretches[0].style.map(|style| style.road);
    for stretch in &mut site.world.stretches {
        if let (Some(style), Some(road)) = (&mut stretch.style, road) {
            style.road = road;
        }
    }
    apply_widths(site, &sections);
    for section in &sections {
        for side in [-1.0, 1.0] {
            roadside(site, section, half, side);
        }
    }
    site.wires();
    site.hills(0.75);
}

fn ground(site: &mut Site, half: f64) -> crate::texture::ground_style::GroundStyle {
    let mut style = site.style(half as f32);
    if site.chance(0.85) {
        style.road = site.asphalt();
    } else {
        style.road = site.loose();
        style.lines = [None; 6];
    }
    style.crossing = 0.0;
    style.beyond = [0, 1].map(|_| {
        if site.chance(0.4) {
            site.field()
        } else {
            site.grass()
        }
    });
    if site.chance(0.5) {
        for (slot, side) in [(2, -1.0), (3, 1.0)] {
            style.lines[slot] = Some(Line {
                at: side * (half as f32 - 0.25),
                half: 0.06,
                dash: [0.0; 2],
            });
        }
    }
    style
}

/// One side of a section.
fn roadside(site: &mut Site, section: &Section, half: f64, side: f64) {
    let kit = site.kit;
    let end = section.to.min(site.world.road.end());
    // Posts along the edge.
    if site.chance(0.5) {
        let mut s = section.from + 5.0;
        while s < end {
            let spot = site.beside(s, side * (half + 0.6));
            let mark = site.mark();
            site.block(&spot, [0.1, 0.12, 1.0], kit.pale);
            let band = spot.spot(0.0, 0.0, 0.7, 0.0);
            site.block(&band, [0.11, 0.13, 0.16], kit.dark);
            site.close(ObjectClass::Pole, &spot, mark);
            s += 25.0;
        }
    }
    let from = half + site.draw(1.3, 4.0);
    match site.rng.random_range(0..9) {
        0..=1 => woods(site, section, from, side),
        2 => row(site, section, from, side),
        3 => rail(site, section, half + 0.7, side),
        4 => fields(site, section, half + 3.0, side),
        5..=6 => {
            // A bank as on a motorway. It is built along the whole road, so in the first section only.
            if (section.from - site.world.road.start).abs() < 1.0 {
                verge(site, side, half + 1.5);
            } else {
                row(site, section, half + 2.0, side);
                fields(site, section, half + 6.0, side);
            }
        }
        7 => village(site, section, half, side),
        _ => {
            fields(site, section, half + 2.0, side);
            row(site, section, half + 12.0, side);
        }
    }
    // Weeds on the verge.
    let mut s = section.from;
    let often = site.draw(1.5, 12.0);
    while s < end {
        let out = half + site.draw(0.5, 2.5);
        let spot = site.beside(s, side * out);
        let size = site.draw(0.25, 0.9);
        site.weeds(&spot, size);
        s += often * site.draw(0.4, 1.6);
    }
    if site.chance(0.6) {
        let s = site.draw(section.from, end.max(section.from + 1.0));
        let mut spot = site.beside(s, side * (half + 1.0));
        spot.heading += std::f64::consts::PI;
        site.sign(&spot);
    }
}

fn woods(site: &mut Site, section: &Section, from: f64, side: f64) {
    let end = section.to.min(site.world.road.end());
    let (height, radius) = (site.draw(8.0, 19.0), site.draw(2.0, 4.5));
    let mut s = section.from;
    while s < end {
        for rank in 0..3 {
            let out = from + f64::from(rank) * 4.5 + site.draw(-1.0, 2.0);
            let along = s + site.draw(-1.5, 1.5);
            let spot = site.beside(along, side * out.max(from));
            let size = site.draw(0.6, 1.2);
            let clear = if rank == 0 { site.draw(0.8, 4.0) } else { 3.0 };
            site.tree(&spot, height * size, radius * size, clear);
        }
        if site.chance(0.7) {
            let spot = site.beside(s, side * (from - 0.3));
            let size = site.draw(0.5, 1.6);
            site.bush(&spot, size);
        }
        s += site.draw(2.2, 5.5);
    }
}

fn row(site: &mut Site, section: &Section, from: f64, side: f64) {
    let end = section.to.min(site.world.road.end());
    let (height, radius) = (site.draw(4.0, 17.0), site.draw(1.5, 5.0));
    let apart = site.draw(4.0, 16.0);
    let mut s = section.from;
    while s < end {
        let spot = site.beside(s, side * from);
        let size = site.draw(0.8, 1.2);
        site.tree(&spot, height * size, radius * size, 2.4);
        s += apart * site.draw(0.8, 1.2);
    }
}

fn rail(site: &mut Site, section: &Section, out: f64, side: f64) {
    let end = section.to.min(site.world.road.end());
    let metal = site.kit.metal[0];
    let mut s = section.from;
    while s + 4.0 < end {
        let (a, b) = (site.beside(s, side * out), site.beside(s + 4.0, side * out));
        let spot = between(&a, &b);
        let mark = site.mark();
        let beam = spot.spot(0.0, 0.0, 0.45, 0.0);
        site.block(&beam, [4.1, 0.08, 0.31], metal);
        let post = spot.spot(0.0, 0.1 * side, 0.0, 0.0);
        site.block(&post, [0.1, 0.08, 0.75], metal);
        site.close(ObjectClass::Misc, &spot, mark);
        s += 4.0;
    }
}

/// Fields: fences, single trees, hedges, bales, masts, far farms.
fn fields(site: &mut Site, section: &Section, from: f64, side: f64) {
    let kit = site.kit;
    let end = section.to.min(site.world.road.end());
    let mut s = section.from;
    let fenced = site.chance(0.4);
    while s < end {
        if fenced {
            let spot = site.beside(s + 3.0, side * (from + 1.0));
            site.enclosure(&spot, 6.0);
        }
        let out = from + site.draw(2.0, 60.0);
        let spot = site.beside(s, side * out);
        match site.rng.random_range(0..9) {
            0..=1 => {
                let (h, r) = (site.draw(4.0, 15.0), site.draw(2.0, 5.0));
                site.tree(&spot, h, r, 1.5);
            }
            2..=3 => {
                let size = site.draw(0.6, 2.2);
                site.bush(&spot, size);
            }
            4 => {
                let straw = site.any(&kit.wood);
                let mark = site.mark();
                let r = site.draw(0.6, 0.8);
                let high = site.draw(1.0, 1.5);
                site.column(&spot, r, high, straw);
                site.close(ObjectClass::Misc, &spot, mark);
            }
            5 => {
                let mark = site.mark();
                let metal = site.any(&kit.wood);
                let high = site.draw(6.0, 11.0);
                site.column(&spot, 0.14, high, metal);
                let arm = spot.spot(0.0, 0.0, high - 0.6, 0.0);
                site.block(&arm, [0.1, 1.8, 0.12], metal);
                site.close(ObjectClass::Pole, &spot, mark);
            }
            6 => {
                let far = site.beside(s, side * (out + 20.0));
                let turned = far.spot(0.0, 0.0, 0.0, site.draw(-0.6, 0.6));
                let size = [site.draw(9.0, 25.0), site.draw(8.0, 13.0)];
                let kind = if site.chance(0.5) {
                    Kind::Villa
                } else {
                    Kind::Hall
                };
                site.house(&turned, size, kind, side < 0.0, true);
            }
            _ => {}
        }
        s += 6.0 + site.draw(0.0, 6.0) * f64::from(u8::from(!fenced));
    }
}

/// A few houses in gardens.
fn village(site: &mut Site, section: &Section, half: f64, side: f64) {
    let end = section.to.min(site.world.road.end());
    let mut s = section.from + 4.0;
    while s + 14.0 < end {
        let size = [site.draw(8.0, 14.0), site.draw(8.0, 12.0)];
        let out = half + site.draw(3.0, 12.0) + 0.5 * size[1];
        let spot = site.beside(s + 0.5 * size[0], side * out);
        if site.is_clear(&spot, [0.5 * size[0], 0.5 * size[1]], 1.5) {
            site.house(&spot, size, Kind::Villa, side < 0.0, false);
        }
        let edge = site.beside(s + 0.5 * size[0], side * (half + 1.6));
        if site.chance(0.7) {
            site.enclosure(&edge, size[0].min(9.0));
        }
        let gap = Spot {
            ..site.beside(s + size[0] + 2.0, side * (half + 4.0))
        };
        let (h, r) = (site.draw(3.0, 12.0), site.draw(1.5, 4.0));
        site.tree(&gap, h, r, 1.5);
        s += size[0] + site.draw(3.0, 12.0);
    }
}
