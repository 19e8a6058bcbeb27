//! Cars that move: ahead in the same lane and towards the camera in the other one.

use crate::motion::Drive;
use crate::primitive::Primitive;
use crate::scene::{SceneObject, World, upright};
use nalgebra::Vector3;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// Positions of the lanes, metres left of the centreline.
const LANE: f64 = 1.65;

/// Vehicles up to this length need no more room than [`GAP`], metres.
const LONG: f64 = 5.0;

/// Distance kept between two cars of one lane, metres.
const GAP: f64 = 13.0;

/// Cars of a varied drive never appear or disappear in this range, metres ahead of the camera along the street.
const SEEN: (f64, f64) = (-20.0, 150.0);

/// One moving car: constant speed along its lane.
struct MovingCar {
    model: usize,
    seed: u32,
    /// Metres along the street at time 0.
    s: f64,
    /// Speed along the street, m/s; negative: towards the start.
    speed: f64,
    lateral: f64,
}

/// All moving cars.
pub(crate) struct Traffic {
    cars: Vec<MovingCar>,
}

impl Traffic {
    /// `count` cars around a drive of `duration_s` seconds. All cars of a lane have the same speed, so that none runs into another. The
    /// ones ahead stay ahead of the camera.
    pub(crate) fn new(
        rng: &mut ChaCha8Rng,
        world: &World,
        drive: &Drive,
        duration_s: f64,
        count: usize,
    ) -> Self {
        let pace = world.scene.pace();
        let travelled = drive.progress(duration_s).0;
        let with = (travelled / duration_s.max(0.1)).clamp(3.0 * pace, 14.0);
        let against = -pace * rng.random_range(6.0..11.0);
        // The first car starts far enough ahead that the camera always stays some metres behind it.
        let closest = (0..=(duration_s * 10.0) as usize)
            .map(|i| {
                let t = i as f64 * 0.1;
                drive.progress(t).0 - with * t
            })
            .fold(0.0, f64::max);
        let mut ahead = closest + rng.random_range(11.0..18.0);
        let oncoming = count - count / 3;
        // Oncoming cars pass at even intervals.
        let spread = ((travelled - against * duration_s) / oncoming.max(1) as f64).clamp(GAP, 60.0);
        let mut towards = rng.random_range(18.0..40.0);
        let cars = (0..count)
            .map(|i| {
                let (s, speed) = if i % 3 == 2 {
                    let s = ahead;
                    ahead += rng.random_range(GAP..2.0 * GAP);
                    (s, with)
                } else {
                    let s = towards;
                    towards += spread * rng.random_range(1.0..1.5);
                    (s, against)
                };
                MovingCar {
                    model: rng.random_range(0..world.models.len()),
                    seed: rng.random(),
                    s,
                    speed,
                    lateral: if speed > 0.0 { -LANE } else { LANE },
                }
            })
            .collect();
        let mut traffic = Self { cars };
        traffic.settle(world, with);
        traffic
    }

    /// Makes room for long vehicles, and moves cars to the world's own lanes if it has any. Changes nothing for cars on a plain street.
    fn settle(&mut self, world: &World, pace: f64) {
        if !world.rooms.is_empty() {
            self.cars.clear();
        }
        let others: Vec<_> = world
            .lanes
            .iter()
            .filter(|lane| (lane.lateral + LANE).abs() > 1.0)
            .collect();
        let (mut ahead, mut towards) = (0.0, 0.0);
        for (number, car) in self.cars.iter_mut().enumerate() {
            let longer = (0.5 * (f64::from(world.models[car.model].size[0]) - LONG)).max(0.0);
            let shift = if car.speed > 0.0 {
                &mut ahead
            } else {
                &mut towards
            };
            car.s += *shift + longer;
            *shift += 2.0 * longer;
            if car.speed < 0.0 && !world.lanes.is_empty() {
                let lane = others.get(number % others.len().max(1));
                car.lateral = lane.map_or(2.0 * LANE + 1.0, |lane| lane.lateral);
                if lane.is_none_or(|lane| lane.forward) {
                    car.speed = 1.1 * pace;
                }
            }
        }
    }

    /// On a varied street, leaves out each car that would collide with something static while it is within 150 m ahead of the camera at one
    /// of these times, seconds: so none disappears there. Changes nothing on a plain street.
    pub(crate) fn keep_passing(&mut self, world: &World, drive: &Drive, times: &[f64]) {
        if world.crowd.is_empty() {
            return;
        }
        self.cars.retain(|car| {
            times.iter().all(|time_s| {
                let s = car.s + car.speed * time_s;
                let ahead = s - drive.progress(*time_s).0;
                !(SEEN.0..SEEN.1).contains(&ahead) || fits(world, car, s)
            })
        });
    }

    /// Dense traffic around a camera that is `s` metres along a varied world's street at time 0 and drives on at `speed` m/s: vehicles
    /// ahead in its lane, at least `nearest` metres away, and others beside it and towards it. None overlaps a static object. `density` is
    /// in [0, 1].
    pub(crate) fn around(
        rng: &mut ChaCha8Rng,
        world: &World,
        (s, speed, nearest): (f64, f64, f64),
        density: f64,
    ) -> Self {
        let mut traffic = Self { cars: Vec::new() };
        if !world.rooms.is_empty() {
            return traffic;
        }
        let lanes = world.lanes();
        for lane in lanes {
            let forward = lane.forward;
            let own = forward && (lane.lateral + LANE).abs() < 1.0;
            let pace = speed.max(3.0) * rng.random_range(0.75..1.1);
            // In the camera's own lane equal speeds keep the distance.
            let pace = match (forward, own) {
                (true, true) => speed,
                (true, false) => pace * rng.random_range(1.0..1.3),
                (false, _) => -pace,
            };
            let gap = 9.0 + 40.0 * (1.0 - density) * rng.random_range(0.5..1.5);
            let mut at = s + if own {
                nearest + 4.0 + gap * rng.random_range(0.0..1.6)
            } else {
                rng.random_range(-15.0..15.0)
            };
            while at < s + 160.0 {
                let car = MovingCar {
                    model: rng.random_range(0..world.models.len()),
                    seed: rng.random(),
                    s: at,
                    speed: pace,
                    lateral: lane.lateral + rng.random_range(-0.25..0.25),
                };
                let long = f64::from(world.models[car.model].size[0]);
                let clear = !own || at - 0.5 * long > s + nearest;
                if clear && rng.random_bool(0.25 + 0.7 * density) && fits(world, &car, at) {
                    traffic.cars.push(car);
                }
                at += long + gap * rng.random_range(0.5..1.8);
            }
        }
        traffic
    }

    /// Number of cars, including those that are not on the street at a time.
    pub(crate) fn count(&self) -> usize {
        self.cars.len()
    }

    /// The cars that are on the street at `time_s`, each at its position at `at_s`.
    fn present<'a>(
        &'a self,
        world: &'a World,
        time_s: f64,
        at_s: f64,
    ) -> impl Iterator<Item = (usize, &'a MovingCar, [f64; 3], f64)> {
        self.cars
            .iter()
            .enumerate()
            .filter_map(move |(index, car)| {
                let road = &world.road;
                let s = car.s + car.speed * time_s;
                if s < road.start + 5.0 || s > road.end() - 5.0 {
                    return None;
                }
                // Varied streets are narrow in places: a car that would hit a parked one is taken to have turned off.
                if !world.crowd.is_empty() && !fits(world, car, s) {
                    return None;
                }
                let (x, y, heading) = road.world(car.s + car.speed * at_s, car.lateral);
                let turn = if car.speed > 0.0 {
                    0.0
                } else {
                    std::f64::consts::PI
                };
                Some((index, car, [x, y, 0.0], heading + turn))
            })
    }

    /// The solids of the cars at a time.
    pub(crate) fn solids(&self, world: &World, time_s: f64) -> Vec<Primitive> {
        self.solids_at(world, time_s, time_s)
    }

    /// The solids at `at_s` of the cars that are on the street at `present_s`.
    pub(crate) fn solids_at(&self, world: &World, at_s: f64, present_s: f64) -> Vec<Primitive> {
        self.present(world, present_s, at_s)
            .flat_map(|(_, car, base, heading)| {
                world.models[car.model].solids(base, heading, car.seed, true)
            })
            .collect()
    }

    /// The boxes and velocities of the cars at a time.
    pub(crate) fn objects(&self, world: &World, time_s: f64) -> Vec<SceneObject> {
        self.present(world, time_s, time_s)
            .map(|(index, car, base, heading)| {
                let size = world.models[car.model].size.map(f64::from);
                // Constant speed along the centreline, so faster on the outside of a bend.
                let s = car.s + car.speed * time_s;
                let curvature = world.road.centre(s).3;
                let speed = car.speed.abs() * (1.0 - curvature * car.lateral);
                SceneObject {
                    // Ids follow those of the static objects.
                    id: (world.objects.len() + index) as u64,
                    class: world.models[car.model].class,
                    world_from_object: upright(base, heading, size[2]),
                    size,
                    velocity: Vector3::new(heading.cos(), heading.sin(), 0.0) * speed,
                }
            })
            .collect()
    }
}

/// Whether a car at `s` metres along the street is on the carriageway and overlaps no static object.
fn fits(world: &World, car: &MovingCar, s: f64) -> bool {
    let (x, y, heading) = world.road.world(s, car.lateral);
    let size = world.models[car.model].size.map(f64::from);
    let half = [0.5 * size[0] + 0.3, 0.5 * size[1] + 0.15];
    let road = &world.road;
    let on_road = [-half[0], half[0]].iter().all(|along| {
        let (x, y, _) = road.world(s + along, car.lateral);
        let p = road.locate(x, y);
        f64::from(road.kerb_distance(&p)) < -half[1] + 0.15
    });
    on_road
        && !world.objects.iter().any(|object| {
            let t = object.world_from_object.translation();
            let (dx, dy) = (t.x - x, t.y - y);
            let reach = object.size[0].hypot(object.size[1]) * 0.5 + half[0] + 1.0;
            // Tree crowns and lamp arms hang over the road.
            let low = object.size[2] < 2.6 || object.class.is_traffic();
            if !low || dx.hypot(dy) > reach {
                return false;
            }
            let (sin, cos) = heading.sin_cos();
            let forward = object.world_from_object.rotate(&Vector3::x());
            let turned = (forward.x * cos + forward.y * sin).abs().min(1.0);
            let across = (1.0 - turned * turned).sqrt();
            let other = [0.5 * object.size[0], 0.5 * object.size[1]];
            let along = other[0] * turned + other[1] * across;
            let aside = other[1] * turned + other[0] * across;
            (cos * dx + sin * dy).abs() < half[0] + along
                && (cos * dy - sin * dx).abs() < half[1] + aside
        })
}
