//! Keeps the camera's lane free: removes every solid that reaches into it.

use super::site::Spot;
use crate::primitive::{Primitive, Shape};
use crate::scene::World;

/// A lane that must stay free.
#[derive(Debug, Clone, Copy)]
pub(super) struct FreeLane {
    /// Its two edges, metres left of the centreline.
    pub lane: [f64; 2],
    /// Nothing may hang lower over it, metres.
    pub headroom: f64,
}

/// The lane of a car.
pub(super) const ROAD: FreeLane = FreeLane {
    lane: [-2.7, -0.6],
    headroom: 2.3,
};

/// The path through rooms and their doors.
pub(super) const ROOMS: FreeLane = FreeLane {
    lane: [-2.19, -1.11],
    headroom: 1.95,
};

/// Whether a solid reaches into a lane that must stay free.
fn intrudes(world: &World, free: &FreeLane, solid: &Primitive) -> bool {
    let lane = free.lane;
    let (half_x, half_y, low, _) = solid.bounds(&world.hulls);
    if solid.position[2] + f64::from(low) > free.headroom {
        return false;
    }
    let p = world.road.locate(solid.position[0], solid.position[1]);
    let middle = f64::from(p.lateral);
    let reach = f64::from(half_x.hypot(half_y));
    if middle - reach > lane[1] || middle + reach < lane[0] {
        return false;
    }
    let spot = Spot {
        x: solid.position[0],
        y: solid.position[1],
        z: 0.0,
        heading: f64::from(solid.heading.1.atan2(solid.heading.0)),
    };
    // A long solid along a bend is checked in pieces.
    let (hx, hy) = (f64::from(half_x), f64::from(half_y));
    let round = matches!(
        solid.shape,
        Shape::Cylinder { .. } | Shape::Ellipsoid { .. } | Shape::Crown(_)
    );
    if round && (hx - hy).abs() < 0.1 * hx {
        return middle - hx < lane[1] && middle + hx > lane[0];
    }
    let (nx, ny) = ((hx / 0.5).ceil() as i32 + 1, (hy / 0.5).ceil() as i32 + 1);
    (-nx..=nx).any(|i| {
        (-ny..=ny).any(|j| {
            let (u, v) = (
                hx * f64::from(i) / f64::from(nx),
                hy * f64::from(j) / f64::from(ny),
            );
            let [x, y, _] = spot.at(u, v, 0.0);
            let lateral = f64::from(world.road.locate(x, y).lateral);
            lateral > lane[0] && lateral < lane[1]
        })
    })
}

/// Removes every solid that reaches into a lane.
pub(super) fn clear(world: &mut World, free: &FreeLane) {
    let kept: Vec<Primitive> = world
        .primitives
        .iter()
        .filter(|solid| !intrudes(world, free, solid))
        .copied()
        .collect();
    world.primitives = kept;
}
