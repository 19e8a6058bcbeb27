use super::kalman::Kalman;
use super::measurement::Measurement;
use crate::{Kind, PerceptionConfig, Target};
use deepfusion_geometry::Se3;
use nalgebra::{Matrix2, Vector2, Vector3};
use std::f64::consts::{FRAC_PI_2, PI};

/// Speeds over ground above which a target counts as dynamic, and below which as static, m/s.
const MOVING_MPS: [f64; 2] = [1.0, 0.5];
/// Largest standard deviation of the speed for that decision, m/s.
const MAX_SPEED_SIGMA_MPS: f64 = 0.7;
/// An uncertain speed must exceed the limit by this many standard deviations to count as dynamic; at two, even boxes that jitter with
/// predicted depth do.
const IN_DOUBT: f64 = 4.0;
/// Weight of a value that was completed and not measured.
const GUESS: f64 = 0.05;
/// Largest weight of a size or a heading, so that it can still change.
const MOST_WEIGHT: f64 = 40.0;

/// Largest weight of the height of a dynamic target.
const MOVING_HEIGHT_WEIGHT: f64 = 6.0;

/// Largest sum of a class's votes, in sightings of score 1, so that it can still change.
const MOST_VOTES: f32 = 5.0;

/// A weighted running mean.
#[derive(Debug, Clone, Copy)]
struct Mean {
    value: f64,
    weight: f64,
}

impl Mean {
    fn add(&mut self, value: f64, weight: f64) {
        self.weight += weight;
        self.value += (value - self.value) * weight / self.weight;
        self.weight = self.weight.min(MOST_WEIGHT);
    }
}

/// How a track was seen in a frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sighting {
    pixels: usize,
    bounds: [u32; 4],
    detection: usize,
}

impl Sighting {
    fn of(measurement: &Measurement) -> Self {
        Self {
            pixels: measurement.detection.pixels,
            bounds: measurement.detection.bounds,
            detection: measurement.index,
        }
    }
}

/// A tracked target.
#[derive(Debug, Clone)]
pub(super) struct Track {
    pub id: u64,
    filter: Kalman,
    /// Height of the centre: the world's y, down.
    y: Mean,
    /// Length, width, height.
    size: [Mean; 3],
    /// The heading, as a vector with twice the angle, because a box looks the same after half a turn.
    heading: Vector2<f64>,
    /// Frames in which it was seen.
    pub hits: u32,
    /// Time since it was last seen, seconds.
    pub unseen_s: f64,
    /// Whether it counts as dynamic.
    moving: Option<bool>,
    /// Whether that was decided by an accurately known speed.
    motion_sure: bool,
    /// Confidence of the last detection.
    confidence: f64,
    /// The class with the most votes, and their sum.
    kind: Option<Kind>,
    /// Standard deviation of its depth divided by the depth when it was last seen, if known.
    relative_error: Option<f32>,
    /// How it was seen in the last frame, if it was.
    pub seen: Option<Sighting>,
}

impl Track {
    pub(super) fn new(id: u64, measurement: &Measurement, config: &PerceptionConfig) -> Self {
        let place = &measurement.detection.place;
        let centre = measurement.centre_with(place.footprint.map(f64::from));
        let (sin, cos) = (2.0 * measurement.heading).sin_cos();
        let mean = |value: f32, seen: f32| Mean {
            value: f64::from(value),
            weight: weight_of(seen),
        };
        Self {
            id,
            filter: Kalman::new(Vector2::new(centre.x, centre.z), &measurement.noise(config)),
            y: mean(centre.y as f32, 1.0),
            size: [
                mean(place.footprint[0], place.seen[0]),
                mean(place.footprint[1], place.seen[1]),
                mean(place.heights[1] - place.heights[0], 1.0),
            ],
            heading: Vector2::new(cos, sin) * measurement.heading_weight,
            hits: 1,
            unseen_s: 0.0,
            moving: None,
            motion_sure: false,
            confidence: f64::from(measurement.detection.confidence),
            kind: measurement.detection.kind.clone(),
            relative_error: measurement.detection.relative_error,
            seen: Some(Sighting::of(measurement)),
        }
    }

    /// Whether it counts as dynamic.
    pub(super) fn is_moving(&self) -> bool {
        self.moving == Some(true)
    }

    pub(super) fn predict(&mut self, dt: f64) {
        self.filter.predict(dt);
        self.unseen_s += dt;
        self.seen = None;
    }

    /// Angle of the length in the world's horizontal axes, up to half a turn.
    fn axis(&self) -> f64 {
        0.5 * self.heading.y.atan2(self.heading.x)
    }

    /// The measured centre, given this track's size and heading, and whether the measurement's length is this track's width.
    fn centre_of(&self, measurement: &Measurement) -> (Vector3<f64>, bool) {
        let off = (measurement.heading - self.axis()).rem_euclid(PI);
        let crossed = (off - FRAC_PI_2).abs() < 0.25 * PI;
        let place = &measurement.detection.place;
        // An extent measured now has as much weight as everything before.
        let extent = |i: usize, k: usize| {
            let mut mean = self.size[k];
            mean.add(
                f64::from(place.footprint[i]),
                weight_of(place.seen[i]) * 4.0,
            );
            mean.value
        };
        let extents = if crossed {
            [extent(0, 1), extent(1, 0)]
        } else {
            [extent(0, 0), extent(1, 1)]
        };
        (measurement.centre_with(extents), crossed)
    }

    /// Squared distance of a measurement, in standard deviations and in metres.
    pub(super) fn distance2(&self, measurement: &Measurement, noise: &Matrix2<f64>) -> (f64, f64) {
        let (centre, _) = self.centre_of(measurement);
        let place = Vector2::new(centre.x, centre.z);
        (
            self.filter.distance2(place, noise),
            (place - self.filter.place()).norm_squared(),
        )
    }

    pub(super) fn update(&mut self, measurement: &Measurement, noise: &Matrix2<f64>) {
        let (centre, crossed) = self.centre_of(measurement);
        self.filter.update(Vector2::new(centre.x, centre.z), noise);
        let place = &measurement.detection.place;
        if self.is_moving() {
            // On a slope the target climbs relative to the first camera's vertical, so its height adapts within a few frames.
            self.y.weight = self.y.weight.min(MOVING_HEIGHT_WEIGHT);
        }
        self.y.add(centre.y, 4.0);
        for i in 0..2 {
            let k = if crossed { 1 - i } else { i };
            self.size[k].add(f64::from(place.footprint[i]), weight_of(place.seen[i]));
        }
        self.size[2].add(f64::from(place.heights[1] - place.heights[0]), 1.0);
        let turn = if crossed { FRAC_PI_2 } else { 0.0 };
        let (sin, cos) = (2.0 * (measurement.heading + turn)).sin_cos();
        // If length and width are swapped, the box is poor evidence of the heading.
        let weight = measurement.heading_weight * if crossed { 0.2 } else { 1.0 };
        self.heading += Vector2::new(cos, sin) * weight;
        let norm = self.heading.norm();
        if norm > MOST_WEIGHT {
            self.heading *= MOST_WEIGHT / norm;
        }
        self.hits += 1;
        self.unseen_s = 0.0;
        self.confidence += 0.3 * (f64::from(measurement.detection.confidence) - self.confidence);
        self.relative_error = measurement.detection.relative_error;
        self.seen = Some(Sighting::of(measurement));
        self.vote(measurement.detection.kind.as_ref());
        self.judge_motion();
    }

    /// Adds a vote for a class; the class with the most votes stays.
    fn vote(&mut self, seen: Option<&Kind>) {
        let Some(seen) = seen else { return };
        match &mut self.kind {
            Some(kind) if kind.class == seen.class => {
                kind.score = (kind.score + seen.score).min(MOST_VOTES);
            }
            Some(kind) if kind.score > seen.score => kind.score -= seen.score,
            kind => *kind = Some(seen.clone()),
        }
    }

    fn judge_motion(&mut self) {
        let doubt = self.filter.speed_deviation();
        let speed = self.filter.velocity().norm();
        if doubt > MAX_SPEED_SIGMA_MPS {
            // A distant car is known to drive long before its speed is accurate, and counts as dynamic while the evidence lasts.
            if !self.motion_sure {
                let surely = speed > MOVING_MPS[0] + IN_DOUBT * doubt;
                self.moving = surely.then_some(true);
            }
            return;
        }
        self.motion_sure = true;
        let limit = MOVING_MPS[usize::from(self.moving == Some(true))];
        self.moving = Some(speed > limit.max(2.0 * doubt));
    }

    /// Centre in the world, in metres.
    pub(super) fn centre(&self) -> Vector3<f64> {
        let place = self.filter.place();
        Vector3::new(place.x, self.y.value, place.y)
    }

    /// Half its diagonal on the ground, in metres.
    pub(super) fn reach(&self) -> f64 {
        0.5 * self.size[0].value.hypot(self.size[1].value)
    }

    /// Corners of its footprint in the world, at the height of its centre, metres.
    pub(super) fn corners(&self) -> [Vector3<f64>; 4] {
        let (sin, cos) = self.axis().sin_cos();
        let half = [0, 1].map(|i| 0.5 * self.size[i].value);
        [[1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0]].map(|[a, b]| {
            let (along, across) = (a * half[0], b * half[1]);
            self.centre()
                + Vector3::new(cos * along - sin * across, 0.0, sin * along + cos * across)
        })
    }

    pub(super) fn target(&self, cam_from_world: &Se3) -> Target {
        let centre = cam_from_world.transform(&self.centre());
        let velocity = self.filter.velocity();
        let likely = cam_from_world.rotate(&Vector3::new(velocity.x, 0.0, velocity.y));
        let velocity = match self.moving {
            None => None,
            // A static target has no speed; the filter's speed comes from the jitter of its box.
            Some(false) => Some(Vector3::zeros()),
            Some(true) => Some(likely),
        };
        let axis = self.axis();
        let mut along = cam_from_world.rotate(&Vector3::new(axis.cos(), 0.0, axis.sin()));
        // A dynamic object moves forward.
        if velocity.is_some_and(|v| v.dot(&along) < 0.0) {
            along = -along;
        }
        let [mut length, mut width, height] = self.size.map(|s| s.value);
        let mut yaw_rad = (-along.z).atan2(along.x);
        if width > length {
            std::mem::swap(&mut width, &mut length);
            yaw_rad += FRAC_PI_2;
        }
        let fading = (-self.unseen_s / 0.7).exp();
        let proven = 1.0 - 0.5 * 0.5f64.powi(self.hits.min(10) as i32 - 1);
        Target {
            id: self.id,
            center_m: centre.into(),
            size_m: [length, width, height],
            yaw_rad: (yaw_rad + PI).rem_euclid(2.0 * PI) - PI,
            distance_m: centre.norm(),
            sigma_m: self
                .relative_error
                .map(|share| f64::from(share) * centre.norm()),
            velocity_mps: velocity.map(Into::into),
            likely_velocity_mps: Some(velocity.unwrap_or(likely).into()),
            moving: self.moving,
            confidence: (self.confidence * proven * fading).clamp(0.0, 1.0),
            class: self.kind.as_ref().map(|kind| kind.class.clone()),
            pixels: self.seen.map_or(0, |seen| seen.pixels),
            bounds: self.seen.map(|seen| seen.bounds),
            detection: self.seen.map(|seen| seen.detection),
        }
    }
}

/// The weight of an extent: nine tenths visible counts as measured, half visible as a guess.
fn weight_of(seen: f32) -> f64 {
    GUESS + (1.0 - GUESS) * f64::from(seen).powi(6)
}
