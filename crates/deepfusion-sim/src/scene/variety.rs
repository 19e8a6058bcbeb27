//! Varied worlds: streets, roads and rooms that differ from seed to seed in everything a camera can see.
//!
//! A network that learns depth from rendered worlds alone must not be able to infer it from a colour, a texture or
//! a habit of the generator. So materials are random over wide ranges, streets are as crowded as real ones, and no
//! two trees or cars are the same.

mod country;
mod ground_styles;
mod houses;
mod indoor;
mod land;
mod models;
mod motorway;
mod people;
mod plants;
mod props;
mod rooms;
mod sections;
mod site;
mod street;
mod sweep;
#[cfg(test)]
mod tests;

use super::World;
use super::cars::CarModel;
use crate::config::Scene;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use site::{Kit, Site};

/// How a world is varied. Shares and amounts are in [0, 1].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Variety {
    /// Whether anything is varied at all.
    varied: bool,
    /// Share of surfaces with random patterns instead of likely ones.
    pub wild: f64,
    /// How many of the places for parked cars are taken.
    pub parked: f64,
    /// How many people there are.
    pub people: f64,
    /// How much furniture stands on pavements and in rooms.
    pub clutter: f64,
    /// How many trees there are and how far they reach over the street.
    pub trees: f64,
    /// Share of trees without leaves.
    pub bare: f64,
    /// Share of trees with yellow and red leaves.
    pub autumn: f64,
}

impl Default for Variety {
    fn default() -> Self {
        Self::none()
    }
}

impl Variety {
    /// The variety of plain worlds: nothing is varied.
    #[must_use]
    pub fn none() -> Self {
        Self {
            varied: false,
            wild: 0.0,
            parked: 0.0,
            people: 0.0,
            clutter: 0.0,
            trees: 0.0,
            bare: 0.0,
            autumn: 0.0,
        }
    }

    /// Draws the variety of one world.
    pub fn draw(rng: &mut impl Rng) -> Self {
        let mut part = |most: f64| most * rng.random_range(0.0f64..1.0);
        let (wild, parked, people) = (part(0.5), part(1.0), part(1.0));
        let (clutter, trees) = (part(1.0), part(1.0));
        let season = part(1.0);
        let (bare, autumn) = if season < 0.12 {
            (0.6 + part(0.4), 0.0)
        } else if season < 0.3 {
            (part(0.3), 0.3 + part(0.7))
        } else {
            (part(0.08), part(0.15))
        };
        Self {
            varied: true,
            wild: wild * wild * 2.0,
            parked: parked.sqrt(),
            people,
            clutter,
            trees: trees.sqrt(),
            bare,
            autumn,
        }
    }

    /// Whether its worlds differ from the plain ones.
    #[must_use]
    pub fn is_varied(&self) -> bool {
        self.varied
    }
}

/// People for a world that is not varied, drawn from a generator of their own. Their materials are appended to the world's own, so that
/// nothing else changes.
pub(super) fn crowd(world: &mut World) -> Vec<CarModel> {
    let mut rng = ChaCha8Rng::seed_from_u64(u64::from(world.seed) ^ 0xC40D_0000_0000);
    let kit = Kit::new(world, &mut rng, &Variety::none());
    people::models(world, &mut rng, &kit)
}

/// Removes what hangs lower than `headroom` metres over the camera's lane.
pub(super) fn clear_lane(world: &mut World, headroom: f64) {
    let free = sweep::FreeLane {
        headroom,
        ..sweep::ROAD
    };
    sweep::clear(world, &free);
}

/// Fills a varied world.
pub(super) fn furnish(world: &mut World, rng: &mut ChaCha8Rng, variety: &Variety) {
    let kit = Kit::new(world, rng, variety);
    world.models = models::vehicles(world, rng, &kit);
    world.crowd = people::models(world, rng, &kit);
    let scene = world.scene;
    let mut site = Site {
        world,
        rng,
        kit: &kit,
        variety,
    };
    match scene {
        Scene::Motorway => motorway::furnish(&mut site),
        Scene::Country => country::furnish(&mut site),
        Scene::Indoor => indoor::furnish(&mut site),
        Scene::Garage => {
            // Leave out vehicles that are too long for a bay or too high for the ceiling.
            let fits = |m: &CarModel| m.size[0] < 5.1 && m.size[2] < 2.2;
            site.world.models.retain(fits);
            super::garage::furnish(site.world, site.rng);
        }
        _ => street::furnish(&mut site),
    }
    match scene {
        Scene::Garage => {}
        Scene::Indoor => sweep::clear(world, &sweep::ROOMS),
        _ => sweep::clear(world, &sweep::ROAD),
    }
}
