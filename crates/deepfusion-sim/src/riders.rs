//! People who ride bicycles in traffic, walk along pavements and cross the road.

mod placing;
mod room;
#[cfg(test)]
mod tests;

use crate::primitive::Primitive;
use crate::road::Road;
use crate::scene::cars::CarModel;
use crate::scene::{SceneObject, World, upright};
use nalgebra::Vector3;

/// Someone faces from where they were to where they will be, so long before and after, seconds: corners are turned in twice
/// this time.
const TURN_S: f64 = 0.2;

/// Velocities are taken from two positions so far apart, seconds.
const VELOCITY_STEP_S: f64 = 1e-3;

/// Someone steps down from a pavement and up to it over this length on the carriageway, metres.
const STEP_DOWN_M: f64 = 0.3;

/// A route at a constant speed: along the street, and at most once straight across it.
#[derive(Debug, Clone, Copy)]
struct Route {
    /// Metres along the street at time 0, as if nothing had been crossed before.
    s: f64,
    /// Metres left of the centreline, until something is crossed.
    lateral: f64,
    /// Along the street, m/s; negative: towards its start.
    rate: f64,
    /// Where the road is crossed.
    crossing: Option<Crossing>,
}

/// The way across the road.
#[derive(Debug, Clone, Copy)]
struct Crossing {
    /// When it begins, seconds.
    begins_s: f64,
    /// How long it takes, seconds.
    lasts_s: f64,
    /// Where it leads to, metres left of the centreline.
    to: f64,
}

impl Route {
    /// Metres along the street and left of its centreline at a time.
    fn at(&self, time_s: f64) -> (f64, f64) {
        let Some(crossing) = self.crossing else {
            return (self.s + self.rate * time_s, self.lateral);
        };
        let crossed_s = (time_s - crossing.begins_s).clamp(0.0, crossing.lasts_s);
        let part = crossed_s / crossing.lasts_s;
        (
            self.s + self.rate * (time_s - crossed_s),
            self.lateral + (crossing.to - self.lateral) * part,
        )
    }

    /// Whether it leads across the road at a time.
    fn crosses_at(&self, time_s: f64) -> bool {
        self.crossing
            .is_some_and(|c| (c.begins_s..=c.begins_s + c.lasts_s).contains(&time_s))
    }
}

/// Someone on the way.
#[derive(Debug, Clone)]
struct Person {
    model: CarModel,
    seed: u32,
    route: Route,
    /// From when to when they are on the street, seconds.
    during: (f64, f64),
}

/// Where someone is.
#[derive(Debug, Clone, Copy)]
struct Stance {
    /// Metres along the street.
    s: f64,
    /// Metres left of its centreline.
    lateral: f64,
    /// On the ground below them, in the world, metres.
    base: [f64; 3],
    /// Where they face, against the world's x axis, radians.
    heading: f64,
}

impl Person {
    fn is_there(&self, time_s: f64) -> bool {
        (self.during.0..=self.during.1).contains(&time_s)
    }

    fn stance(&self, road: &Road, time_s: f64) -> Stance {
        let place = |time_s: f64| {
            let (s, lateral) = self.route.at(time_s);
            let (x, y, _) = road.world(s, lateral);
            (x, y)
        };
        let (s, lateral) = self.route.at(time_s);
        let (x, y) = place(time_s);
        let (before, after) = (place(time_s - TURN_S), place(time_s + TURN_S));
        Stance {
            s,
            lateral,
            base: [x, y, ground(road, x, y)],
            heading: (after.1 - before.1).atan2(after.0 - before.0),
        }
    }

    /// Over ground, in the world's axes, m/s.
    fn velocity(&self, road: &Road, time_s: f64) -> Vector3<f64> {
        let [before, after] = [-0.5, 0.5].map(|steps| {
            let stance = self.stance(road, time_s + steps * VELOCITY_STEP_S);
            Vector3::from(stance.base)
        });
        (after - before) / VELOCITY_STEP_S
    }
}

/// Height of what someone stands on: the carriageway, what is beside it, or the step between them, as a slope.
fn ground(road: &Road, x: f64, y: f64) -> f64 {
    let beyond = f64::from(road.kerb_distance(&road.locate(x, y)));
    f64::from(road.kerb) * (1.0 + beyond / STEP_DOWN_M).clamp(0.0, 1.0)
}

/// All who ride and walk.
#[derive(Default)]
pub(crate) struct Riders {
    people: Vec<Person>,
}

impl Riders {
    /// How many there are.
    pub(crate) fn count(&self) -> usize {
        self.people.len()
    }

    /// Those who are on the street at a time.
    fn present(&self, time_s: f64) -> impl Iterator<Item = (usize, &Person)> {
        let all = self.people.iter().enumerate();
        all.filter(move |(_, person)| person.is_there(time_s))
    }

    /// The solids, at a time, of those who are on the street at `present_s`: the same people a moment later.
    pub(crate) fn solids(&self, world: &World, time_s: f64, present_s: f64) -> Vec<Primitive> {
        self.present(present_s)
            .flat_map(|(_, person)| {
                let stance = person.stance(&world.road, time_s);
                person
                    .model
                    .solids(stance.base, stance.heading, person.seed, true)
            })
            .collect()
    }

    /// Their boxes and velocities at a time; the first one's identity is `first_id`.
    pub(crate) fn objects(&self, world: &World, time_s: f64, first_id: usize) -> Vec<SceneObject> {
        self.present(time_s)
            .map(|(index, person)| {
                let size = person.model.size.map(f64::from);
                let stance = person.stance(&world.road, time_s);
                SceneObject {
                    id: (first_id + index) as u64,
                    class: person.model.class,
                    world_from_object: upright(stance.base, stance.heading, size[2]),
                    size,
                    velocity: person.velocity(&world.road, time_s),
                }
            })
            .collect()
    }
}
