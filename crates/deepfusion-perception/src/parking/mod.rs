//! Cars side by side, as in a car park: clearly visible cars show where the others stand, of which only a corner, a hood or a strip of a
//! door is visible.
//!
//! A row is a line through the middles of cars that stand across the lane; the rows on both sides of a lane are parallel. The obstacles on
//! such a line are split at their gaps, and each segment is a car of typical size, at a right angle to the row. Cars are remembered, so
//! that a row continues ahead of those already passed.

mod alone;
mod car;
mod follow;
mod remembered;
mod row;
#[cfg(test)]
mod scene;
mod segments;

use crate::rows::Turn;
use crate::{Detection, Ground, Obstacles, PerceptionConfig, Rays};
use alone::stands_alone;
use deepfusion_geometry::Se3;
use follow::follow;
use nalgebra::Vector3;
use remembered::{RememberedCar, distance, heading, merge, on_ground, parked};
use row::{Heading, Parked, Row};
use segments::ObstaclePoints;

/// If at least this share of a detection's pixels, or of the smaller footprint, is within a car of a row, the detection is part of that
/// car: that is more likely than another object in the car's place.
const PART: f32 = 0.2;
/// If at least this share of the smaller footprint is within another detection, a car of a row is that detection.
const SAME: f32 = 0.4;
/// Within this distance of a dynamic track, in metres, a detection counts as dynamic.
const MOVING_M: f32 = 1.5;
/// Half of a row's depth, metres.
const HALF_M: f32 = 2.8;
/// Number of cars seen often, over all rows, before rows are used: on a street, hedges and driveways look like rows.
const LEAST_SURE: usize = 3;
/// Range of the distance across the lane from a row's line to the cars on the other side, in metres.
const ACROSS_M: [f32; 2] = [8.6, 15.0];

/// Completes rows of parked cars, frame by frame.
#[derive(Debug, Clone, Default)]
pub(crate) struct Parking {
    remembered: Vec<RememberedCar>,
    /// These cars as seen from the present pose, and the rows with two certain cars.
    cars: Vec<Parked>,
    rows: Vec<Row>,
}

/// The image data of a frame.
#[derive(Clone, Copy)]
pub(crate) struct View<'a> {
    pub depth: &'a [f32],
    pub obstacles: &'a Obstacles,
    pub rays: &'a Rays,
    pub ground: &'a Ground,
    pub config: &'a PerceptionConfig,
}

impl Parking {
    /// Drops all cars.
    pub(crate) fn reset(&mut self) {
        *self = Self::default();
    }

    /// Starts a frame: transforms the remembered cars to the present camera and finds their rows.
    pub(crate) fn begin_frame(&mut self, ground: &Ground, world_from_cam: Option<&Se3>) {
        self.cars = world_from_cam.map_or(Vec::new(), |pose| {
            let cam_from_world = pose.inverse();
            let seen = |known: &RememberedCar| known.seen(ground, &cam_from_world);
            self.remembered.iter().filter_map(seen).collect()
        });
        self.rows = Row::all(&self.cars);
        self.rows.retain(|row| row.sure() > 1);
    }

    /// The usual orientation at a point: along the lane, but at a right angle to it in a row and across the lane from one.
    pub(crate) fn usual_turn(&self, at: [f32; 2]) -> Turn {
        let square = |row: &Row| {
            let [along, off] = row.locate(at);
            let across = -off * row.at(along).signum();
            let on = across.abs() < HALF_M || (ACROSS_M[0]..ACROSS_M[1]).contains(&across);
            (on && row.passes(along)).then(|| row.angle(along))
        };
        let angle = self.rows.iter().find_map(square);
        angle.map_or(Turn::ahead(), |angle| Turn::new(angle, 1.0))
    }

    /// Replaces detections that are parts of parked cars by the cars of their row. All others are kept: dynamic ones (`moving`, in the
    /// world), those with a class, those that stand in a row by themselves, and those that no car of a row explains. Without a pose,
    /// nothing is remembered and no rows are used.
    pub(crate) fn complete(
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
        let moves = |d: &Detection| {
            let at = d.place.middle;
            moving.iter().any(|m| distance(*m, at) < MOVING_M)
        };
        let (mut kept, mut open): (Vec<_>, Vec<_>) = detections
            .into_iter()
            .partition(|d| d.kind.is_some() || moves(d));
        let mut cars = std::mem::take(&mut self.cars);
        for car in open.iter().filter_map(|d| parked(&d.place)) {
            merge(&mut cars, car);
        }
        self.remembered = world_from_cam.map_or(Vec::new(), |pose| {
            let known = cars
                .iter()
                .map(|car| RememberedCar::new(car, view.ground, pose));
            known.collect()
        });
        let rows = believed(&cars);
        if !rows.is_empty() {
            let driving = kept.iter().filter(|d| moves(d));
            let lane: Vec<Heading> = driving.filter_map(|d| heading(&d.place)).collect();
            let (alone, others): (Vec<_>, Vec<_>) =
                open.into_iter().partition(|d| stands_alone(d, &view));
            open = others;
            let standing = ObstaclePoints::find(&view, kept.iter().chain(&alone));
            let (rows, found) = follow_all(rows, &lane, &standing, &view);
            let explained = ExplainedByRows::of(&found, &view);
            let in_row = |d: &Detection| rows.iter().any(|row| row.holds(d.place.middle));
            open.retain(|d| !(in_row(d) && explained.covers(d)));
            for car in found {
                let taken = |other: &Detection| other.place.overlap(&car.place) > SAME;
                if !kept.iter().chain(&open).any(taken) {
                    open.push(car);
                }
            }
            kept.extend(alone);
        }
        kept.extend(open);
        kept
    }
}

/// The part of an image that the cars of rows explain: their footprints and their pixels.
struct ExplainedByRows<'a> {
    cars: &'a [Detection],
    pixels: Vec<bool>,
    width: usize,
}

impl<'a> ExplainedByRows<'a> {
    fn of(cars: &'a [Detection], view: &View) -> Self {
        let width = view.rays.x.len();
        let mut pixels = vec![false; view.depth.len()];
        for run in cars.iter().flat_map(|car| &car.runs) {
            pixels[run.pixels(width)].fill(true);
        }
        Self {
            cars,
            pixels,
            width,
        }
    }

    /// Whether a detection is part of one of the cars.
    fn covers(&self, detection: &Detection) -> bool {
        let within = |car: &Detection| car.place.overlap(&detection.place) > PART;
        let own = detection.runs.iter().flat_map(|run| {
            let pixels = &self.pixels[run.pixels(self.width)];
            pixels.iter().filter(|own| **own)
        });
        self.cars.iter().any(within) || own.count() as f32 > PART * detection.pixels as f32
    }
}

/// The rows of these cars, if enough of the cars were seen often.
fn believed(cars: &[Parked]) -> Vec<Row> {
    let mut rows = Row::all(cars);
    if rows.iter().map(Row::sure).sum::<usize>() < LEAST_SURE {
        rows.clear();
    }
    rows
}

/// Follows each row; all have the curvature of the lane. Returns the updated rows and their cars.
fn follow_all(
    rows: Vec<Row>,
    lane: &[Heading],
    standing: &ObstaclePoints,
    view: &View,
) -> (Vec<Row>, Vec<Detection>) {
    let mut followed: Vec<Row> = Vec::with_capacity(rows.len());
    let mut found = Vec::new();
    for i in 0..rows.len() {
        let mut row = rows[i].clone();
        row.keep_to(lane);
        for other in followed.iter().chain(&rows[i + 1..]) {
            row.align_with(other);
        }
        found.extend(follow(&mut row, standing, view));
        followed.push(row);
    }
    (followed, found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::GroundBox;
    use crate::instances::Kind;
    use scene::{Scene, person};

    /// A car of a row 6 m to the right, at a right angle to the lane.
    fn car(forward: f32) -> GroundBox {
        GroundBox {
            middle: [6.0, forward],
            angle: 0.0,
            footprint: [4.4, 1.8],
            heights: [0.0, 1.5],
            seen: [0.5, 0.9],
            anchor: [6.0, forward],
        }
    }

    fn detection(place: GroundBox) -> Detection {
        Detection {
            place,
            pixels: 500,
            bounds: [0; 4],
            runs: Vec::new(),
            confidence: 0.5,
            relative_error: None,
            kind: None,
        }
    }

    /// Three cars of a row, seen this often.
    fn passed(scene: &Scene, sightings: usize, pose: Option<&Se3>) -> Parking {
        let mut parking = Parking::default();
        for _ in 0..sightings {
            parking.begin_frame(scene.view().ground, pose);
            let seen = [8.0, 11.0, 14.0].map(|forward| detection(car(forward)));
            parking.complete(seen.into(), &[], scene.view(), pose);
        }
        parking
    }

    #[test]
    fn a_row_corrects_a_misdetected_car() {
        let scene = Scene::of(&[8.0, 11.0, 14.0, 17.0].map(car));
        let pose = Se3::identity();
        let mut parking = passed(&scene, 2, Some(&pose));
        parking.begin_frame(scene.view().ground, Some(&pose));
        // Beside its neighbour only a strip of its front is visible, which looks like a box across it.
        let mut wrong = car(17.4);
        wrong.angle = 1.2;
        wrong.seen = [0.1, 0.2];
        let seen = vec![detection(wrong)];
        let found = parking.complete(seen, &[], scene.view(), Some(&pose));
        let at = |forward: f32| {
            let near = |d: &&Detection| distance(d.place.middle, [6.0, forward]) < 0.5;
            found.iter().filter(near).count()
        };
        assert_eq!([8.0, 11.0, 14.0, 17.0].map(at), [1; 4], "{found:?}");
        assert_eq!(found.len(), 4, "{found:?}");
        let square = |d: &Detection| d.place.angle.sin().abs() < 0.1;
        assert!(found.iter().all(square), "{found:?}");
    }

    #[test]
    fn a_row_is_used_after_repeated_sightings_and_only_with_a_pose() {
        let scene = Scene::of(&[car(17.0)]);
        let pose = Se3::identity();
        // A strip of the next car, detected as something else.
        let mut strip = car(17.4);
        strip.angle = 1.2;
        strip.seen = [0.1, 0.2];
        let looked_at = |mut parking: Parking, pose: Option<&Se3>| {
            parking.begin_frame(scene.view().ground, pose);
            let seen = vec![detection(strip)];
            let found = parking.complete(seen, &[], scene.view(), pose);
            assert_eq!(found.len(), 1, "{found:?}");
            found[0].place != strip
        };
        let believed =
            |sightings: usize, pose: Option<&Se3>| looked_at(passed(&scene, sightings, pose), pose);
        assert!(believed(2, Some(&pose)));
        assert!(!believed(1, Some(&pose)));
        assert!(!believed(5, None));
        let mut parking = passed(&scene, 5, Some(&pose));
        parking.reset();
        assert!(!looked_at(parking, Some(&pose)));
    }

    #[test]
    fn detections_that_no_row_explains_are_kept() {
        let scene = Scene::of(&[]);
        let pose = Se3::identity();
        let mut parking = passed(&scene, 2, Some(&pose));
        parking.begin_frame(scene.view().ground, Some(&pose));
        // On the row's line, where the image shows no car.
        let seen = vec![detection(car(17.0))];
        let found = parking.complete(seen.clone(), &[], scene.view(), Some(&pose));
        assert_eq!(found, seen);
    }

    #[test]
    fn people_in_or_before_a_row_are_kept() {
        let cars = [8.0, 11.0, 14.0].map(car);
        // Beyond the last car; between two cars; in front of the hood of a car that the row contains.
        for middle in [[4.0, 19.0], [3.5, 12.5], [3.3, 13.9]] {
            let standing = person(middle);
            let scene = Scene::of(&[cars[0], cars[1], cars[2], standing]);
            let pose = Se3::identity();
            let mut parking = passed(&scene, 2, Some(&pose));
            parking.begin_frame(scene.view().ground, Some(&pose));
            let mut seen: Vec<_> = cars.map(|car| scene.detection(car)).into();
            let who = scene.detection(standing);
            seen.push(who.clone());
            let found = parking.complete(seen, &[], scene.view(), Some(&pose));
            assert!(found.contains(&who), "{middle:?}: {found:?}");
            // It is not taken for a car, and it hides no car.
            let at = |forward: f32| {
                let near = |d: &&Detection| distance(d.place.middle, [6.0, forward]) < 0.6;
                found.iter().filter(near).count()
            };
            assert_eq!([8.0, 11.0, 14.0].map(at), [1; 3], "{middle:?}: {found:?}");
            assert_eq!(found.len(), 4, "{middle:?}: {found:?}");
        }
    }

    #[test]
    fn dynamic_and_classified_detections_are_kept() {
        let scene = Scene::of(&[car(17.0)]);
        let pose = Se3::identity();
        let mut parking = passed(&scene, 2, Some(&pose));
        parking.begin_frame(scene.view().ground, Some(&pose));
        let mut named = detection(car(8.0));
        named.kind = Some(Kind {
            class: "truck".into(),
            score: 0.9,
        });
        let seen = vec![detection(car(17.0)), named.clone(), detection(car(11.0))];
        let there = scene.view().ground.place([6.0, 11.3, 0.0]).map(f64::from);
        let kept = parking.complete(seen, &[there.into()], scene.view(), Some(&pose));
        assert_eq!(kept[..2], [named, detection(car(11.0))]);
        // The third is replaced by the row's car.
        assert_eq!(kept.len(), 3, "{kept:?}");
        assert!(kept[2].pixels != 500, "{kept:?}");
    }

    #[test]
    fn boxes_in_a_row_are_turned_square_to_the_lane() {
        let scene = Scene::of(&[]);
        let pose = Se3::identity();
        let mut parking = passed(&scene, 2, Some(&pose));
        parking.begin_frame(scene.view().ground, Some(&pose));
        let turned = |at: [f32; 2]| parking.usual_turn(at).angle();
        assert!(turned([6.0, 14.0]).sin().abs() < 0.1);
        // Also across the lane from the row, but not in the lane.
        assert!(turned([-6.0, 9.0]).sin().abs() < 0.1);
        assert!(turned([0.5, 9.0]).sin().abs() > 0.9);
    }
}
