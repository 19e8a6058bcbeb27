//! Cars side by side, as in a car park: those that are seen well tell where the others stand, of which only a corner, a
//! bonnet or a strip of a door is seen.
//!
//! A row is a line through the middles of cars that stand across the way; the rows on both sides of a lane go the same
//! way. What stands on such a line is parted by its gaps, and each part is a car of usual size, square to the row. Cars
//! are remembered, so that a row that was passed goes on ahead.

mod car;
mod parts;
mod row;

use crate::rows::Turn;
use crate::{Detection, Ground, GroundBox, Obstacles, PerceptionConfig, Rays};
use car::car;
use deepfusion_geometry::Se3;
use nalgebra::Vector3;
use parts::Standing;
use row::{Parked, Row};

/// Length and width of a usual car, metres.
const CAR: [f32; 2] = [4.4, 1.8];
/// Lengths, widths and heights of boxes that may be cars of a row, metres.
const LENGTHS_M: [f32; 2] = [3.2, 5.6];
/// See [`LENGTHS_M`].
const WIDTHS_M: [f32; 2] = [1.4, 2.3];
/// See [`LENGTHS_M`].
const HIGHEST_M: f32 = 2.15;
/// Shares of length and width that must have been seen of a car that makes a row.
const SEEN: [f32; 2] = [0.05, 0.4];
/// How far from square to the way a car of a row may stand, radians.
const TURN: f32 = 0.6;
/// How far beside the camera a row is, at least, metres.
const BESIDE_M: f32 = 3.0;
/// Within this distance it is the same car, metres.
const SAME_M: f32 = 1.2;
/// Within this distance of where something moves it is that, metres.
const MOVING_M: f32 = 1.5;
/// Most looks that count of one car.
const MOST_LOOKS: f32 = 4.0;
/// What a car that was found by its row says about where the row goes on, in looks.
const FOUND: f32 = 2.0;
/// How far before its first car a row is looked at, and how far behind the camera cars are remembered, metres.
const BEFORE_M: f32 = 10.0;
/// See [`BEFORE_M`].
const BEHIND_M: f32 = 15.0;
/// Half of a row's depth, metres.
const HALF_M: f32 = 2.8;
/// Cars that were seen often, of all rows together, before a row is believed: on a street hedges and drives look like one.
const LEAST_SURE: usize = 3;
/// From where to where, across the lane from a row's line, the cars of the other side may be, metres.
const ACROSS_M: [f32; 2] = [8.6, 15.0];

/// A car of a row, remembered.
#[derive(Debug, Clone)]
struct Known {
    /// Its middle and the row's direction, in the world's axes.
    middle: Vector3<f64>,
    along: Vector3<f64>,
    looks: f32,
}

/// Completes rows of parked cars, frame by frame.
#[derive(Debug, Clone, Default)]
pub struct Parking {
    known: Vec<Known>,
    /// Those cars as they are seen from here, and the rows of which two are certain.
    cars: Vec<Parked>,
    rows: Vec<Row>,
}

/// What is seen.
#[derive(Clone, Copy)]
pub struct View<'a> {
    pub depth: &'a [f32],
    pub obstacles: &'a Obstacles,
    pub rays: &'a Rays,
    pub ground: &'a Ground,
    pub config: &'a PerceptionConfig,
}

impl Parking {
    /// Forgets all cars.
    pub fn forget(&mut self) {
        *self = Self::default();
    }

    /// Before a frame is looked at: where the known cars are, seen from there.
    pub fn recall(&mut self, ground: &Ground, world_from_cam: Option<&Se3>) {
        self.cars = world_from_cam.map_or(Vec::new(), |pose| {
            let cam_from_world = pose.inverse();
            let seen = |known: &Known| known.seen(ground, &cam_from_world);
            self.known.iter().filter_map(seen).collect()
        });
        self.rows = Row::all(&self.cars);
        self.rows.retain(|row| row.sure() > 1);
    }

    /// How something is usually turned at a place: along the way in the lane, square to it in a row and across from one.
    pub fn usual_turn(&self, at: [f32; 2]) -> Turn {
        let square = |row: &Row| {
            let [along, off] = row.locate(at);
            let [first, _] = row.reach();
            let across = -off * row.at(along).signum();
            let on = across.abs() < HALF_M || (ACROSS_M[0]..ACROSS_M[1]).contains(&across);
            (on && (first - BEFORE_M..row.end()).contains(&along)).then(|| row.angle(along))
        };
        let angle = self.rows.iter().find_map(square);
        angle.map_or(Turn::ahead(), |angle| Turn::new(angle, 1.0))
    }

    /// Puts the cars of rows in the place of what was found there, but for what moves (in the world) and what is known by
    /// name. Without a pose nothing is remembered, and no row believed.
    pub fn complete(
        &mut self,
        detections: Vec<Detection>,
        moving: &[Vector3<f64>],
        view: View,
        world_from_cam: Option<&Se3>,
    ) -> Vec<Detection> {
        let moving: Vec<[f32; 2]> = world_from_cam.map_or(Vec::new(), |pose| {
            let cam_from_world = pose.inverse();
            let seen = |p| on_ground(view.ground, &cam_from_world.transform(p));
            moving.iter().map(seen).collect()
        });
        let moves = |at: [f32; 2]| moving.iter().any(|m| distance(*m, at) < MOVING_M);
        let (mut kept, mut open): (Vec<_>, Vec<_>) = detections
            .into_iter()
            .partition(|d| d.kind.is_some() || moves(d.place.middle));
        let mut cars = std::mem::take(&mut self.cars);
        for car in open.iter().filter_map(|d| parked(&d.place)) {
            meet(&mut cars, car);
        }
        self.remember(&cars, view.ground, world_from_cam);
        let mut rows = Row::all(&cars);
        if rows.iter().map(Row::sure).sum::<usize>() < LEAST_SURE {
            rows.clear();
        }
        if !rows.is_empty() {
            let standing = Standing::find(&view, &kept.iter().collect::<Vec<_>>());
            let mut found: Vec<Detection> = Vec::new();
            let mut done: Vec<Row> = Vec::new();
            for (i, row) in rows.iter().enumerate() {
                let mut row = row.clone();
                for other in done.iter().chain(&rows[i + 1..]) {
                    row.lean_on(other);
                }
                found.extend(follow(&mut row, &standing, &view));
                let [first, _] = row.reach();
                open.retain(|detection| {
                    let [along, off] = row.locate(detection.place.middle);
                    off.abs() > HALF_M || !(first - BEFORE_M..row.end()).contains(&along)
                });
                done.push(row);
            }
            for car in found {
                let taken = |other: &Detection| other.place.overlap(&car.place) > 0.4;
                if !kept.iter().chain(&open).any(taken) {
                    open.push(car);
                }
            }
        }
        kept.extend(open);
        kept
    }

    fn remember(&mut self, cars: &[Parked], ground: &Ground, world_from_cam: Option<&Se3>) {
        self.known.clear();
        let Some(pose) = world_from_cam else { return };
        let in_world = |at: [f32; 2]| {
            let p = ground.place([at[0], at[1], 0.0]);
            pose.transform(&Vector3::from(p.map(f64::from)))
        };
        self.known.extend(cars.iter().map(|car| {
            let [right, forward] = car.middle;
            let middle = in_world(car.middle);
            Known {
                middle,
                along: in_world([right + car.slope, forward + 1.0]) - middle,
                looks: car.weight,
            }
        }));
    }
}

impl Known {
    /// As it is seen now; `None` where it was passed long ago, or does not stand across the way any more.
    fn seen(&self, ground: &Ground, cam_from_world: &Se3) -> Option<Parked> {
        let middle = on_ground(ground, &cam_from_world.transform(&self.middle));
        let next = cam_from_world.transform(&(self.middle + self.along));
        let next = on_ground(ground, &next);
        let along = [0, 1].map(|i| next[i] - middle[i]);
        let across = along[0].abs() < 1.5 * TURN.tan() * along[1].abs();
        (across && middle[1] > -BEHIND_M).then(|| Parked {
            middle,
            slope: along[0] / along[1],
            weight: self.looks,
        })
    }
}

/// A point of the camera's frame, on the ground: right, forward.
fn on_ground(ground: &Ground, p: &Vector3<f64>) -> [f32; 2] {
    let [right, forward, _] = ground.locate([p.x as f32, p.y as f32, p.z as f32]);
    [right, forward]
}

fn distance(a: [f32; 2], b: [f32; 2]) -> f32 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// A box as a car of a row, if it may be one.
fn parked(place: &GroundBox) -> Option<Parked> {
    use std::f32::consts::{FRAC_PI_2, PI};
    let off = (place.angle + FRAC_PI_2).rem_euclid(PI) - FRAC_PI_2;
    let [length, width] = place.footprint;
    let fits = (LENGTHS_M[0]..LENGTHS_M[1]).contains(&length)
        && (WIDTHS_M[0]..WIDTHS_M[1]).contains(&width)
        && place.heights[1] < HIGHEST_M
        && place.seen[0] > SEEN[0]
        && place.seen[1] > SEEN[1]
        && place.middle[0].abs() > BESIDE_M
        && off.abs() < TURN;
    fits.then(|| Parked {
        middle: place.middle,
        slope: -off.tan(),
        weight: 1.0,
    })
}

/// Takes a car into those that are known.
fn meet(cars: &mut Vec<Parked>, car: Parked) {
    let same = |other: &&mut Parked| distance(other.middle, car.middle) < SAME_M;
    let Some(known) = cars.iter_mut().find(same) else {
        cars.push(car);
        return;
    };
    let weight = known.weight + car.weight;
    let mean = |a: f32, b: f32| (a * known.weight + b * car.weight) / weight;
    known.middle = [0, 1].map(|i| mean(known.middle[i], car.middle[i]));
    known.slope = mean(known.slope, car.slope);
    known.weight = weight.min(MOST_LOOKS);
}

/// Follows a row from its near end to its far one: each car of which enough is seen says where it goes on.
fn follow(row: &mut Row, standing: &Standing, view: &View) -> Vec<Detection> {
    let mut found = Vec::new();
    let mut done = f32::NEG_INFINITY;
    loop {
        let [first, _] = row.reach();
        let mut from = first - BEFORE_M;
        if done.is_finite() {
            row.focus(done);
            from = done;
        }
        let ends = [from, row.end()];
        let before = done;
        for part in standing.parts(row, ends, view) {
            if part.along[1] <= done + 0.3 {
                continue;
            }
            done = part.along[1];
            let slope = part.slope(row);
            let mut told = slope.is_some();
            let line = row.clone();
            for (along, points) in part.cars(&line, view) {
                let Some((car, front)) = car(along, &points, &line, view) else {
                    continue;
                };
                if front || slope.is_some() {
                    row.add(Parked {
                        middle: car.place.middle,
                        slope: slope.unwrap_or_else(|| line.slope(along)),
                        weight: FOUND,
                    });
                    told = true;
                }
                found.push(car);
            }
            if told {
                // It may go on otherwise than was thought.
                break;
            }
        }
        if done <= before {
            return found;
        }
    }
}
