//! Follows a row from its near to its far end.

use super::View;
use super::car::car;
use super::row::{Parked, Row};
use super::segments::ObstaclePoints;
use crate::Detection;

/// Weight of a car found by its row for the continuation of the row, in sightings.
const FOUND: f32 = 2.0;

/// Follows a row from its near to its far end: each car of which enough is visible updates the row's direction.
pub(super) fn follow(row: &mut Row, standing: &ObstaclePoints, view: &View) -> Vec<Detection> {
    let mut found = Vec::new();
    let mut done = f32::NEG_INFINITY;
    loop {
        let mut from = row.start();
        if done.is_finite() {
            row.focus(done);
            from = done;
        }
        let ends = [from, row.end()];
        let before = done;
        for part in standing.segments(row, ends, view) {
            if part.along[1] <= done + 0.3 {
                continue;
            }
            done = part.along[1];
            let slope = part.slope(row);
            let mut updated = slope.is_some();
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
                    updated = true;
                }
                found.push(car);
            }
            if updated {
                // From here the row may continue differently than expected.
                break;
            }
        }
        if done <= before {
            return found;
        }
    }
}
