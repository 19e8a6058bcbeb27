//! Chooses where people ride and walk: along a drive, and ahead of the camera of a view.

use super::room::{Footprint, Moment, has_room};
use super::{Crossing, Person, Riders, Route};
use crate::motion::Drive;
use crate::road::RoadSample;
use crate::scene::cars::CarModel;
use crate::scene::{ObjectClass, SceneObject, World};
use crate::traffic::Traffic;
use deepfusion_geometry::Se3;
use nalgebra::Vector3;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// Time between the moments of a drive at which room is checked, seconds.
const STEP_S: f64 = 0.2;

/// People never appear or disappear in this range, metres ahead of the camera along the street. Farther ahead they are a few pixels high;
/// farther behind only scans see them.
const SEEN: (f64, f64) = (-4.0, 120.0);

/// Least and greatest distance at which people are met, metres ahead of the camera along the street.
const MET: (f64, f64) = (4.0, 60.0);

/// Lateral position of the camera's car, metres left of the centreline, and half the width that it needs there.
const LANE: f64 = -1.65;
const HALF_LANE: f64 = 1.4;

/// Distance that people keep from a view's camera, metres.
const ARM: f64 = 2.5;

/// Places that are tried for each activity.
const TRIES: usize = 20;

/// Pavements narrower than this are not walked on, metres.
const LEAST_PAVEMENT: f32 = 0.9;

/// Greatest width of a bicycle with its rider, metres; motorbikes are wider.
const BICYCLE: f32 = 0.7;

/// What a person does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Activity {
    /// Rides in the street's direction.
    RideAlong,
    /// Crosses the road and walks on.
    Cross,
    /// Rides against the street's direction.
    RideAgainst,
    /// Walks along a pavement.
    Walk,
}

impl Activity {
    const ALL: [Self; 4] = [Self::RideAlong, Self::Cross, Self::RideAgainst, Self::Walk];

    /// Whether a person of this model can do it.
    fn suits(self, model: &CarModel) -> bool {
        match self {
            Self::RideAlong | Self::RideAgainst => {
                model.class == ObjectClass::Cyclist && model.size[1] < BICYCLE
            }
            Self::Cross | Self::Walk => model.class == ObjectClass::Pedestrian,
        }
    }
}

impl Riders {
    /// Up to `count` people along a drive of `duration_s` seconds among its traffic, met at even intervals. In turn, one rides ahead,
    /// crosses, rides towards the camera, and walks. There are fewer if the street has no room for them. Nobody appears or disappears
    /// within 120 m ahead of the camera, or gets in its way.
    pub(crate) fn along(
        rng: &mut ChaCha8Rng,
        world: &World,
        models: &[CarModel],
        (drive, duration_s): (&Drive, f64),
        traffic: &Traffic,
        count: usize,
    ) -> Self {
        let mut riders = Self::default();
        if count == 0 {
            return riders;
        }
        let mut moments = moments(world, drive, duration_s, traffic);
        for number in 0..count {
            for attempt in 0..TRIES * Activity::ALL.len() {
                let does = Activity::ALL[(number + attempt / TRIES) % Activity::ALL.len()];
                let part = (number as f64 + rng.random::<f64>()) / count as f64;
                let met = ((part * moments.len() as f64) as usize).min(moments.len() - 1);
                if riders.place(rng, world, models, does, &mut moments, met) {
                    break;
                }
            }
        }
        riders
    }

    /// Two to eight people ahead of the camera of a view among its `vehicles`, at time 0; fewer if there is no room for them.
    pub(crate) fn before(
        rng: &mut ChaCha8Rng,
        world: &World,
        models: &[CarModel],
        world_from_cam: &Se3,
        vehicles: &[SceneObject],
    ) -> Self {
        let eye = world_from_cam.translation();
        let place = world.road.locate(eye.x, eye.y);
        let (along_x, along_y) = world.road.tangent(place.index);
        let looks = world_from_cam.rotate(&Vector3::z());
        let along = looks.x * f64::from(along_x) + looks.y * f64::from(along_y);
        let mut occupied: Vec<Footprint> = vehicles.iter().map(Footprint::by).collect();
        occupied.push(Footprint::new([eye.x, eye.y], 0.0, [ARM, ARM]));
        let mut moments = [Moment {
            time_s: 0.0,
            camera_s: f64::from(place.s),
            looks: if along < 0.0 { -1.0 } else { 1.0 },
            occupied,
        }];
        let mut riders = Self::default();
        for _ in 0..rng.random_range(2..=8) {
            for _ in 0..TRIES {
                let does = Activity::ALL[rng.random_range(0..Activity::ALL.len())];
                if riders.place(rng, world, models, does, &mut moments, 0) {
                    break;
                }
            }
        }
        riders
    }

    /// Tries one place for a person who is met at moment number `met`; returns whether there was room.
    fn place(
        &mut self,
        rng: &mut ChaCha8Rng,
        world: &World,
        models: &[CarModel],
        does: Activity,
        moments: &mut [Moment],
        met: usize,
    ) -> bool {
        let moment = &moments[met];
        let ahead = MET.0 * (MET.1 / MET.0).powf(rng.random());
        let place = (moment.time_s, moment.camera_s + moment.looks * ahead);
        let Some(mut person) = draw(rng, world, models, does, place) else {
            return false;
        };
        let fits = |number: &usize| has_room(world, &person, &moments[*number]);
        if !fits(&met) {
            return false;
        }
        // The person is on the street as long as there is room for them, before and after.
        let first = (0..met).rev().take_while(fits).last().unwrap_or(met);
        let last = (met + 1..moments.len())
            .take_while(fits)
            .last()
            .unwrap_or(met);
        let is_seen = |number: usize| {
            let moment = &moments[number];
            let ahead = (person.route.at(moment.time_s).0 - moment.camera_s) * moment.looks;
            (SEEN.0..SEEN.1).contains(&ahead)
        };
        let (comes, goes) = (first > 0, last + 1 < moments.len());
        if (comes && is_seen(first)) || (goes && is_seen(last)) {
            return false;
        }
        person.during = (
            if comes {
                moments[first].time_s
            } else {
                f64::NEG_INFINITY
            },
            if goes {
                moments[last].time_s
            } else {
                f64::INFINITY
            },
        );
        for moment in &mut moments[first..=last] {
            let footprint = Footprint::by_person(&person, &world.road, moment.time_s);
            moment.occupied.push(footprint);
        }
        self.people.push(person);
        true
    }
}

/// The moments of a drive, each with its traffic and the camera's own lane.
fn moments(world: &World, drive: &Drive, duration_s: f64, traffic: &Traffic) -> Vec<Moment> {
    let count = (duration_s / STEP_S).ceil() as usize;
    (0..=count)
        .map(|number| {
            let time_s = (number as f64 * STEP_S).min(duration_s);
            let (camera_s, speed, _) = drive.progress(time_s);
            let vehicles = traffic.objects(world, time_s);
            let mut occupied: Vec<Footprint> = vehicles.iter().map(Footprint::by).collect();
            // From 3 m behind the camera to 4 m plus 0.6 s of driving ahead of it.
            let free = 0.6 * speed;
            let (x, y, heading) = world.road.world(camera_s + 0.5 * (1.0 + free), LANE);
            let half = [0.5 * (7.0 + free), HALF_LANE];
            occupied.push(Footprint::new([x, y], heading, half));
            Moment {
                time_s,
                camera_s,
                looks: 1.0,
                occupied,
            }
        })
        .collect()
}

/// A person who does this at a time, `s` metres along the street; `None` if there is no pavement for it.
fn draw(
    rng: &mut ChaCha8Rng,
    world: &World,
    models: &[CarModel],
    does: Activity,
    (time_s, s): (f64, f64),
) -> Option<Person> {
    let those: Vec<&CarModel> = models.iter().filter(|model| does.suits(model)).collect();
    if those.is_empty() {
        return None;
    }
    let model = those[rng.random_range(0..those.len())].clone();
    let sample = world.road.sample(world.road.index_at(s));
    let route = match does {
        Activity::RideAlong | Activity::RideAgainst => {
            // On the right, near the edge of the road or in the lane.
            let edge = f64::from(sample.half_width) - rng.random_range(0.5..0.9);
            let out = if rng.random_bool(0.7) {
                edge
            } else {
                rng.random_range(1.0..2.3f64).min(edge)
            };
            let speed = rng.random_range(3.0..7.0);
            let (rate, lateral) = if does == Activity::RideAlong {
                (speed, -out)
            } else {
                (-speed, out)
            };
            Route {
                s: s - rate * time_s,
                lateral,
                rate,
                crossing: None,
            }
        }
        Activity::Walk => {
            let side = usize::from(rng.random_bool(0.5));
            let lateral = pavement(rng, sample, side)?;
            let rate = pace(rng);
            Route {
                s: s - rate * time_s,
                lateral,
                rate,
                crossing: None,
            }
        }
        Activity::Cross => {
            let side = usize::from(rng.random_bool(0.5));
            let (lateral, to) = (
                pavement(rng, sample, side)?,
                pavement(rng, sample, 1 - side)?,
            );
            let rate = pace(rng);
            let lasts_s = (to - lateral).abs() / rate.abs();
            let begins_s = time_s - lasts_s * rng.random_range(0.1..0.9);
            Route {
                s: s - rate * begins_s,
                lateral,
                rate,
                crossing: Some(Crossing {
                    begins_s,
                    lasts_s,
                    to,
                }),
            }
        }
    };
    Some(Person {
        model,
        seed: rng.random(),
        route,
        during: (f64::NEG_INFINITY, f64::INFINITY),
    })
}

/// Velocity of a walker along the street, m/s, in either direction.
fn pace(rng: &mut ChaCha8Rng) -> f64 {
    let speed = rng.random_range(1.1..1.5);
    if rng.random_bool(0.5) { speed } else { -speed }
}

/// A place on the pavement of a side (0: right, 1: left), metres left of the centreline.
fn pavement(rng: &mut ChaCha8Rng, sample: &RoadSample, side: usize) -> Option<f64> {
    let wide = sample.pavement[side];
    if wide < LEAST_PAVEMENT {
        return None;
    }
    let inner = f64::from(sample.half_width + sample.verge[side]) + 0.16;
    let out = inner + rng.random_range(0.3..f64::from(wide) - 0.3);
    Some(if side == 1 { out } else { -out })
}
