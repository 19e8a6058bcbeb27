//! Keeps the lane of the camera free: whatever reaches into it is taken away.

use super::site::Spot;
use crate::primitive::{Primitive, Shape};
use crate::scene::World;

/// The lane that must be free: metres left of the centreline, from and to, and its height above the road.
pub const LANE: [f64; 2] = [-2.7, -0.6];
/// Nothing hangs lower over the lane, metres.
pub const HEADROOM: f64 = 2.3;

/// Whether a solid reaches into the lane.
pub fn intrudes(world: &World, solid: &Primitive) -> bool {
    let (half_x, half_y, low, _) = solid.bounds(&world.hulls);
    if solid.position[2] + f64::from(low) > HEADROOM {
        return false;
    }
    let p = world.road.locate(solid.position[0], solid.position[1]);
    let middle = f64::from(p.lateral);
    let reach = f64::from(half_x.hypot(half_y));
    if middle - reach > LANE[1] || middle + reach < LANE[0] {
        return false;
    }
    let spot = Spot {
        x: solid.position[0],
        y: solid.position[1],
        z: 0.0,
        heading: f64::from(solid.heading.1.atan2(solid.heading.0)),
    };
    // A long solid along a bend is looked at in pieces.
    let (hx, hy) = (f64::from(half_x), f64::from(half_y));
    let round = matches!(
        solid.shape,
        Shape::Cylinder { .. } | Shape::Ellipsoid { .. } | Shape::Crown(_)
    );
    if round && (hx - hy).abs() < 0.1 * hx {
        return middle - hx < LANE[1] && middle + hx > LANE[0];
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
            lateral > LANE[0] && lateral < LANE[1]
        })
    })
}

/// Removes everything that reaches into the lane.
pub fn clear_the_lane(world: &mut World) {
    let kept: Vec<Primitive> = world
        .primitives
        .iter()
        .filter(|solid| !intrudes(world, solid))
        .copied()
        .collect();
    world.primitives = kept;
}
