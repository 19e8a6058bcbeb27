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

/// A person faces along the line from their position this long before to their position this long after, seconds. So a corner takes twice
/// this time.
const TURN_S: f64 = 0.2;

/// Time between the two positions that a velocity is computed from, seconds.
const VELOCITY_STEP_S: f64 = 1e-3;

/// Length on the carriageway over which a person steps down from the pavement or up to it, metres.
const STEP_DOWN_M: f64 = 0.3;

/// A route at constant speed: along the street, and at most once straight across it.
#[derive(Debug, Clone, Copy)]
struct Route {
    /// Metres along the street at time 0, extrapolated as if there were no crossing.
    s: f64,
    /// Metres left of the centreline, before the crossing.
    lateral: f64,
    /// Speed along the street, m/s; negative: towards its start.
    rate: f64,
    /// The crossing of the road, if there is one.
    crossing: Option<Crossing>,
}

/// A way across the road.
#[derive(Debug, Clone, Copy)]
struct Crossing {
    /// Time at which it begins, seconds.
    begins_s: f64,
    /// Duration, seconds.
    lasts_s: f64,
    /// Where it ends, metres left of the centreline.
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

    /// Whether the person is crossing the road at a time.
    fn crosses_at(&self, time_s: f64) -> bool {
        self.crossing
            .is_some_and(|c| (c.begins_s..=c.begins_s + c.lasts_s).contains(&time_s))
    }
}

/// A person and their route.
#[derive(Debug, Clone)]
struct Person {
    model: CarModel,
    seed: u32,
    route: Route,
    /// When they are on the street, from and to, seconds.
    during: (f64, f64),
}

/// Position and heading of a person.
#[derive(Debug, Clone, Copy)]
struct Stance {
    /// Metres along the street.
    s: f64,
    /// Metres left of the centreline.
    lateral: f64,
    /// The ground below them, in the world, metres.
    base: [f64; 3],
    /// Direction they face, against the world's x axis, radians.
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

    /// Velocity over ground, in the world's axes, m/s.
    fn velocity(&self, road: &Road, time_s: f64) -> Vector3<f64> {
        let [before, after] = [-0.5, 0.5].map(|steps| {
            let stance = self.stance(road, time_s + steps * VELOCITY_STEP_S);
            Vector3::from(stance.base)
        });
        (after - before) / VELOCITY_STEP_S
    }
}

/// Height of the ground that a person stands on: carriageway, pavement, or a slope between them.
fn ground(road: &Road, x: f64, y: f64) -> f64 {
    let beyond = f64::from(road.kerb_distance(&road.locate(x, y)));
    f64::from(road.kerb) * (1.0 + beyond / STEP_DOWN_M).clamp(0.0, 1.0)
}

/// All people who ride and walk.
#[derive(Default)]
pub(crate) struct Riders {
    people: Vec<Person>,
}

impl Riders {
    /// Number of people.
    pub(crate) fn count(&self) -> usize {
        self.people.len()
    }

    /// The people who are on the street at a time.
    fn present(&self, time_s: f64) -> impl Iterator<Item = (usize, &Person)> {
        let all = self.people.iter().enumerate();
        all.filter(move |(_, person)| person.is_there(time_s))
    }

    /// The solids at `time_s` of the people who are on the street at `present_s`.
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

    /// The boxes and velocities of the people at a time; ids start at `first_id`.
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
