//! Cars of rows, remembered in the world, and the test for boxes that may be such cars.

use super::row::{Heading, Parked};
use crate::{Ground, GroundBox};
use deepfusion_geometry::Se3;
use nalgebra::Vector3;
use std::f32::consts::{FRAC_PI_2, PI};

/// Limits of length, width and height of boxes that may be cars of a row, in metres.
const LENGTHS_M: [f32; 2] = [3.2, 5.6];
/// See [`LENGTHS_M`].
const WIDTHS_M: [f32; 2] = [1.4, 2.3];
/// See [`LENGTHS_M`].
const HIGHEST_M: f32 = 2.15;
/// Smallest visible shares of length and width of a car that may start a row.
const SEEN: [f32; 2] = [0.02, 0.3];
/// Up to this visible share of its length, little more than one flat face of a car is visible.
const FLAT: f32 = 0.1;
/// Smallest height of such a car, in metres: a hedge looks the same but is lower.
const FLAT_HEIGHT_M: f32 = 1.3;
/// Largest deviation of a row's car from a right angle to the lane, in radians.
const TURN: f32 = 0.6;
/// Smallest lateral distance of a row from the camera, in metres.
const BESIDE_M: f32 = 3.0;
/// Within this distance, in metres, two sightings are of the same car.
const SAME_M: f32 = 1.2;
/// Largest number of sightings counted for one car.
const MOST_SIGHTINGS: f32 = 4.0;
/// How far behind the camera cars are remembered, metres.
const BEHIND_M: f32 = 15.0;
/// Smallest distance of a vehicle that drives along the lane ahead, in metres, and its largest angle to the lane, in radians.
const AHEAD_M: f32 = 4.0;
/// See [`AHEAD_M`].
const ASTRAY: f32 = 0.6;

/// A car of a row, remembered.
#[derive(Debug, Clone)]
pub(super) struct RememberedCar {
    /// Its middle and the row's direction, in world axes.
    middle: Vector3<f64>,
    along: Vector3<f64>,
    sightings: f32,
}

impl RememberedCar {
    /// A car on this ground, seen by a camera with this pose.
    pub(super) fn new(car: &Parked, ground: &Ground, world_from_cam: &Se3) -> Self {
        let in_world = |at: [f32; 2]| {
            let p = ground.place([at[0], at[1], 0.0]);
            world_from_cam.transform(&Vector3::from(p.map(f64::from)))
        };
        let [right, forward] = car.middle;
        let middle = in_world(car.middle);
        Self {
            middle,
            along: in_world([right + car.slope, forward + 1.0]) - middle,
            sightings: car.weight,
        }
    }

    /// The car as seen from the present camera; `None` if it was passed long ago or no longer stands across the lane.
    pub(super) fn seen(&self, ground: &Ground, cam_from_world: &Se3) -> Option<Parked> {
        let middle = on_ground(ground, &cam_from_world.transform(&self.middle));
        let next = cam_from_world.transform(&(self.middle + self.along));
        let next = on_ground(ground, &next);
        let along = [0, 1].map(|i| next[i] - middle[i]);
        let across = along[0].abs() < 1.5 * TURN.tan() * along[1].abs();
        (across && middle[1] > -BEHIND_M).then(|| Parked {
            middle,
            slope: along[0] / along[1],
            weight: self.sightings,
        })
    }
}

/// A box as a car of a row, if it is within the limits.
pub(super) fn parked(place: &GroundBox) -> Option<Parked> {
    let off = (place.angle + FRAC_PI_2).rem_euclid(PI) - FRAC_PI_2;
    let [length, width] = place.footprint;
    let fits = (LENGTHS_M[0]..LENGTHS_M[1]).contains(&length)
        && (WIDTHS_M[0]..WIDTHS_M[1]).contains(&width)
        && place.heights[1] < HIGHEST_M
        && (place.seen[0] > FLAT || place.heights[1] > FLAT_HEIGHT_M)
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

/// Merges a car into the known cars.
pub(super) fn merge(cars: &mut Vec<Parked>, car: Parked) {
    let same = |other: &&mut Parked| distance(other.middle, car.middle) < SAME_M;
    let Some(known) = cars.iter_mut().find(same) else {
        cars.push(car);
        return;
    };
    let weight = known.weight + car.weight;
    let mean = |a: f32, b: f32| (a * known.weight + b * car.weight) / weight;
    known.middle = [0, 1].map(|i| mean(known.middle[i], car.middle[i]));
    known.slope = mean(known.slope, car.slope);
    known.weight = weight.min(MOST_SIGHTINGS);
}

/// The lane's direction at a dynamic box, if that is a vehicle driving along the lane: pedestrians walk in any direction.
pub(super) fn heading(place: &GroundBox) -> Option<Heading> {
    let off = place.angle.rem_euclid(PI) - FRAC_PI_2;
    let [_, forward] = place.middle;
    let drives = place.footprint[0] > LENGTHS_M[0] && place.footprint[1] > WIDTHS_M[0];
    (drives && off.abs() < ASTRAY && forward > AHEAD_M).then(|| Heading {
        forward,
        slope: -off.tan(),
    })
}

/// A point of the camera's frame, on the ground: right, forward.
pub(super) fn on_ground(ground: &Ground, p: &Vector3<f64>) -> [f32; 2] {
    let [right, forward, _] = ground.locate([p.x as f32, p.y as f32, p.z as f32]);
    [right, forward]
}

/// Distance between two points on the ground, in metres.
pub(super) fn distance(a: [f32; 2], b: [f32; 2]) -> f32 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A car at a right angle to the lane, of which most is visible.
    fn place() -> GroundBox {
        GroundBox {
            middle: [6.0, 12.0],
            angle: 0.1,
            footprint: [4.4, 1.8],
            heights: [0.0, 1.5],
            seen: [0.6, 0.9],
            anchor: [6.0, 12.0],
        }
    }

    #[test]
    fn a_car_of_a_row_stands_beside_the_lane_and_across() {
        let car = parked(&place()).unwrap();
        assert_eq!(car.middle, [6.0, 12.0]);
        assert!((car.slope + 0.1f32.tan()).abs() < 1e-6, "{car:?}");
        let mut in_the_lane = place();
        in_the_lane.middle[0] = 1.0;
        let mut along = place();
        along.angle = FRAC_PI_2;
        let mut van = place();
        van.heights[1] = 2.6;
        for other in [in_the_lane, along, van] {
            assert_eq!(parked(&other), None, "{other:?}");
        }
    }

    #[test]
    fn the_flat_face_of_a_hedge_is_not_a_car() {
        let mut face = place();
        face.seen[0] = 0.05;
        assert!(parked(&face).is_some());
        face.heights[1] = 1.2;
        assert_eq!(parked(&face), None);
    }

    #[test]
    fn sightings_of_one_car_are_averaged() {
        let mut cars = vec![parked(&place()).unwrap()];
        let mut again = cars[0];
        again.middle[1] += 0.4;
        merge(&mut cars, again);
        assert_eq!((cars.len(), cars[0].weight), (1, 2.0));
        assert!((cars[0].middle[1] - 12.2).abs() < 1e-5, "{cars:?}");
        again.middle[1] += 3.0;
        merge(&mut cars, again);
        assert_eq!(cars.len(), 2);
        for _ in 0..9 {
            merge(&mut cars, again);
        }
        assert_eq!(cars[1].weight, MOST_SIGHTINGS);
    }

    #[test]
    fn a_vehicle_ahead_shows_the_lanes_direction() {
        let mut driven = place();
        driven.middle = [1.0, 15.0];
        driven.angle = FRAC_PI_2 - 0.2;
        let shown = heading(&driven).unwrap();
        assert!((shown.slope - 0.2f32.tan()).abs() < 1e-6, "{shown:?}");
        // The same car, turned by half a turn.
        driven.angle += PI;
        assert!((heading(&driven).unwrap().slope - shown.slope).abs() < 1e-5);
        let mut across = driven;
        across.angle = 0.1;
        let mut walks = driven;
        walks.footprint = [0.6, 0.5];
        for other in [across, walks] {
            assert_eq!(heading(&other), None, "{other:?}");
        }
    }
}
