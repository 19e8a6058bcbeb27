//! Cars of rows, remembered in the world, and what makes a box one of them.

use super::row::{Heading, Parked};
use crate::{Ground, GroundBox};
use deepfusion_geometry::Se3;
use nalgebra::Vector3;
use std::f32::consts::{FRAC_PI_2, PI};

/// Lengths, widths and heights of boxes that may be cars of a row, metres.
const LENGTHS_M: [f32; 2] = [3.2, 5.6];
/// See [`LENGTHS_M`].
const WIDTHS_M: [f32; 2] = [1.4, 2.3];
/// See [`LENGTHS_M`].
const HIGHEST_M: f32 = 2.15;
/// Shares of length and width that must have been seen of a car that makes a row.
const SEEN: [f32; 2] = [0.02, 0.3];
/// Up to this share of its length hardly more than one flat face of a car is seen.
const FLAT: f32 = 0.1;
/// Least height of a car of which no more is seen, metres: a hedge looks alike, and is lower.
const FLAT_HEIGHT_M: f32 = 1.3;
/// How far from square to the way a car of a row may stand, radians.
const TURN: f32 = 0.6;
/// How far beside the camera a row is, at least, metres.
const BESIDE_M: f32 = 3.0;
/// Within this distance it is the same car, metres.
const SAME_M: f32 = 1.2;
/// Most looks that count of one car.
const MOST_SIGHTINGS: f32 = 4.0;
/// How far behind the camera cars are remembered, metres.
const BEHIND_M: f32 = 15.0;
/// Nearest to the camera that something drives along the lane ahead, metres, and how far it may be turned out of the way, radians.
const AHEAD_M: f32 = 4.0;
/// See [`AHEAD_M`].
const ASTRAY: f32 = 0.6;

/// A car of a row, remembered.
#[derive(Debug, Clone)]
pub struct RememberedCar {
    /// Its middle and the row's direction, in the world's axes.
    middle: Vector3<f64>,
    along: Vector3<f64>,
    sightings: f32,
}

impl RememberedCar {
    /// A car as it stands on this ground, seen by a camera at this pose.
    pub fn new(car: &Parked, ground: &Ground, world_from_cam: &Se3) -> Self {
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

    /// As it is seen now; `None` where it was passed long ago, or does not stand across the way any more.
    pub fn seen(&self, ground: &Ground, cam_from_world: &Se3) -> Option<Parked> {
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

/// A box as a car of a row, if it may be one.
pub fn parked(place: &GroundBox) -> Option<Parked> {
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

/// Takes a car into those that are known.
pub fn merge(cars: &mut Vec<Parked>, car: Parked) {
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

/// How the lane goes where something that moves drives along it, if it does: who walks goes anywhere.
pub fn heading(place: &GroundBox) -> Option<Heading> {
    let off = place.angle.rem_euclid(PI) - FRAC_PI_2;
    let [_, forward] = place.middle;
    let drives = place.footprint[0] > LENGTHS_M[0] && place.footprint[1] > WIDTHS_M[0];
    (drives && off.abs() < ASTRAY && forward > AHEAD_M).then(|| Heading {
        forward,
        slope: -off.tan(),
    })
}

/// A point of the camera's frame, on the ground: right, forward.
pub fn on_ground(ground: &Ground, p: &Vector3<f64>) -> [f32; 2] {
    let [right, forward, _] = ground.locate([p.x as f32, p.y as f32, p.z as f32]);
    [right, forward]
}

/// Of two points on the ground, metres.
pub fn distance(a: [f32; 2], b: [f32; 2]) -> f32 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A car square to the way, of which most is seen.
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
    fn the_flat_face_of_a_hedge_is_no_car() {
        let mut face = place();
        face.seen[0] = 0.05;
        assert!(parked(&face).is_some());
        face.heights[1] = 1.2;
        assert_eq!(parked(&face), None);
    }

    #[test]
    fn one_that_is_seen_again_is_the_mean_of_both() {
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
    fn what_drives_ahead_shows_how_the_lane_goes() {
        let mut driven = place();
        driven.middle = [1.0, 15.0];
        driven.angle = FRAC_PI_2 - 0.2;
        let shown = heading(&driven).unwrap();
        assert!((shown.slope - 0.2f32.tan()).abs() < 1e-6, "{shown:?}");
        // The same, turned round.
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
