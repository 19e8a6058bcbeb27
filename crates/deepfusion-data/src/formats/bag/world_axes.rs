//! Recognises velocities in world axes: a GPS receiver's, to the east and to the north, in the same message type as the vehicle's own.

/// Below this speed, the direction is unreliable, m/s.
const MIN_SPEED_MPS: f64 = 2.0;
/// Lateral velocity / speed: 17° off the vehicle's x, which never occurs at the rear axle, and ahead of it only in tight bends.
const ACROSS: f64 = 0.3;

/// The same ratio for 44°, which does not occur anywhere on a vehicle for long.
const FAR_ACROSS: f64 = 0.7;

/// Whether velocities (x, y; m/s) are in axes other than the vehicle's: of those that are fast enough, a quarter points far from x and some
/// point very far from it, or most point far from it. Two thirds of all headings are far from x, but streets may run east and west for most
/// of a drive. In a car park, the velocity at a vehicle's front is often far from x, but never very far.
pub(super) fn are_world_axes(velocities: impl Iterator<Item = (f64, f64)>) -> bool {
    let across = velocities.filter_map(|(x, y)| {
        let speed = x.hypot(y);
        (speed > MIN_SPEED_MPS).then(|| y.abs() / speed)
    });
    let mut across: Vec<f64> = across.collect();
    across.sort_by(f64::total_cmp);
    let of_all = |share: f64| {
        let place = (share * across.len() as f64) as usize;
        across.get(place).copied().unwrap_or(0.0)
    };
    let (half, quarter, few) = (of_all(0.5), of_all(0.75), of_all(0.95));
    half > ACROSS || (quarter > ACROSS && few > FAR_ACROSS)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A drive around a block at 10 m/s (north, west, south, east), and one mostly to the east.
    #[test]
    fn velocities_in_world_axes_are_recognised() {
        let to = |course: f64| (10.0 * course.cos(), 10.0 * course.sin());
        let block = (0..100).map(|i| to(f64::from(i / 25 + 1) * std::f64::consts::FRAC_PI_2));
        assert!(are_world_axes(block));
        let mostly_east = (0..100).map(|i| to(if i % 10 < 3 { 1.5 } else { 0.05 }));
        assert!(are_world_axes(mostly_east));
    }

    #[test]
    fn velocities_in_the_vehicles_axes_are_not_mistaken() {
        // Bends at a point 1.5 m ahead of the axle, reversing, and speeds too low to have a direction.
        let bend = |i: i32| (8.0, 1.5 * 0.4 * f64::from(i % 3 - 1));
        assert!(!are_world_axes((0..99).map(bend)));
        // A car park, with an antenna 2.7 m ahead of the axle: bends of 5 m radius for a third of the way.
        let parking = |i: i32| (3.0, if i % 3 == 0 { 3.0 * 2.7 / 5.0 } else { 0.1 });
        assert!(!are_world_axes((0..99).map(parking)));
        assert!(!are_world_axes((0..99).map(|_| (-5.0, 0.1))));
        assert!(!are_world_axes((0..99).map(|_| (0.1, 1.9))));
        assert!(!are_world_axes((0..99).map(|_| (5.0, f64::NAN))));
        assert!(!are_world_axes(std::iter::empty()));
    }
}
