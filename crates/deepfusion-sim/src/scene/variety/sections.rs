//! The sections of a street: its width, the kind of each side, and how cars park.

use super::site::Site;
use crate::config::Scene;
use crate::scene::widths::Widths;
use crate::texture::ground::Stretch;
use rand::Rng;
use std::f64::consts::FRAC_PI_2;

/// Over this length the widths of two sections blend, metres.
const BLEND: f64 = 12.0;

/// Least distance from the centreline of a car parked on the camera's side, metres.
pub(super) const ROOM: f64 = 2.85;

/// Kind of one side of a section.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Frontage {
    /// Houses wall to wall.
    Row,
    /// Houses in gardens.
    Villas,
    /// Shops and flats.
    Blocks,
    /// Halls and yards.
    Works,
    /// Trees and lawns.
    Green,
    /// A long wall or hedge with something behind it.
    Wall,
}

/// How cars park along a side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Parking {
    None,
    /// On the road, along the kerb.
    Road,
    /// With two wheels on the pavement.
    Half,
    /// On the pavement.
    Pavement,
    /// In bays, at this angle to the road.
    Bays(f64),
}

/// One side of a section.
#[derive(Clone, Copy)]
pub(super) struct Side {
    pub frontage: Frontage,
    pub pavement: f32,
    pub verge: f32,
    /// Distance from the pavement to the houses, metres.
    pub setback: f64,
    pub parking: Parking,
    /// Share of the parking places that are taken, 0 to 1.
    pub parked: f64,
    /// Distance between the trees of an avenue, metres; 0: none.
    pub avenue: f64,
}

impl Side {
    /// Open land without a pavement.
    pub(super) fn open() -> Self {
        Self {
            frontage: Frontage::Green,
            pavement: 0.0,
            verge: 0.0,
            setback: 0.0,
            parking: Parking::None,
            parked: 0.0,
            avenue: 0.0,
        }
    }
}

/// A stretch of the street.
pub(super) struct Section {
    pub from: f64,
    pub to: f64,
    pub half_width: f32,
    pub sides: [Side; 2],
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

/// Draws the sections of a street, from its start to its end.
pub(super) fn sections(site: &mut Site) -> Vec<Section> {
    let (mut from, end) = (site.world.road.start, site.world.road.end());
    let scene = site.world.scene;
    let mut sections = Vec::new();
    let home = frontage(site, scene);
    while from < end {
        let to = from + site.draw(30.0, 110.0);
        let half_width = match (scene, site.rng.random_range(0..10)) {
            (Scene::Park, _) => site.draw(2.4, 3.6),
            (Scene::Commercial, 0..=4) => site.draw(4.9, 9.0),
            (_, 0..=2) => site.draw(2.7, 3.4),
            (_, 3..=5) => site.draw(3.4, 4.4),
            (_, 6..=8) => site.draw(4.9, 6.0),
            _ => site.draw(6.0, 9.0),
        } as f32;
        let sides = [0, 1].map(|side| plan(site, scene, home, half_width, side));
        let style = site.style(half_width);
        site.world.stretches.push(Stretch::styled(style));
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

fn frontage(site: &mut Site, scene: Scene) -> Frontage {
    match (scene, site.rng.random_range(0..20)) {
        (Scene::Park, _) => Frontage::Green,
        (Scene::Commercial, 0..=14) => Frontage::Blocks,
        (_, 0..=5) => Frontage::Row,
        (_, 6..=11) => Frontage::Villas,
        (_, 12..=14) => Frontage::Blocks,
        (_, 15) => Frontage::Works,
        (_, 16..=17) => Frontage::Green,
        _ => Frontage::Wall,
    }
}

fn plan(site: &mut Site, scene: Scene, home: Frontage, half_width: f32, side: usize) -> Side {
    // The character of a street persists over several sections.
    let frontage = if site.chance(0.55) {
        home
    } else {
        frontage(site, scene)
    };
    let setback = match frontage {
        Frontage::Row => site.draw(0.05, 3.5),
        Frontage::Villas => site.draw(2.0, 9.0),
        Frontage::Blocks => site.draw(0.1, 7.0),
        Frontage::Works => site.draw(1.0, 16.0),
        Frontage::Wall => site.draw(7.0, 20.0),
        Frontage::Green => site.draw(16.0, 45.0),
    };
    let pavement = site.draw(1.0, 3.6) as f32;
    let verge = if site.chance(0.3) {
        site.draw(0.6, 2.6) as f32
    } else {
        0.0
    };
    let kerb = f64::from(half_width);
    let wide = f64::from(pavement + verge);
    let mut ways = vec![Parking::None];
    if kerb - 2.1 > if side == 0 { ROOM } else { 0.9 } {
        ways.extend([Parking::Road; 5]);
    }
    if kerb - 0.75 > if side == 0 { ROOM } else { 0.6 } {
        ways.extend([Parking::Half; 3]);
    }
    if wide > 2.1 {
        ways.push(Parking::Pavement);
    }
    if setback > 4.5 && frontage != Frontage::Villas {
        ways.push(Parking::Bays(FRAC_PI_2));
        ways.push(Parking::Bays(site.draw(0.7, 1.3)));
    }
    let parking = ways[site.rng.random_range(0..ways.len())];
    let mut parked = site.variety.parked * site.draw(0.3, 1.3);
    if scene == Scene::Park {
        parked *= 0.2;
    }
    Side {
        frontage,
        pavement,
        verge,
        setback,
        parking,
        parked: parked.min(0.97),
        avenue: if site.chance(0.25 + 0.5 * site.variety.trees) {
            site.draw(5.5, 16.0)
        } else {
            0.0
        },
    }
}

/// Sets the widths of the road's samples.
pub(super) fn apply_widths(site: &mut Site, sections: &[Section]) {
    let widths: Vec<Widths> = sections.iter().map(Section::widths).collect();
    site.world.apply_widths(&widths, BLEND);
}
