//! Where there is room for a person: on the right ground, clear of static objects and of everyone's way.

use super::{Person, Stance};
use crate::primitive::Shape;
use crate::road::Road;
use crate::scene::{ObjectClass, SceneObject, World};
use nalgebra::Vector3;

/// Three circles of this radius in a row cover a person, metres.
const RADIUS: f64 = 0.42;

/// Objects at least this high above the ground are over everyone's head, metres.
const HEADROOM: f64 = 2.0;

/// Objects up to this height above the ground are stepped over, metres.
const STEP: f64 = 0.15;

/// Distance along the street within which solids are checked, metres: none of them is larger.
const REACH: f64 = 60.0;

/// Nobody is farther than this from the camera along the street, metres.
const FARTHEST: f64 = 200.0;

/// One moment of a drive, or the moment of a view.
pub(super) struct Moment {
    /// Time, seconds.
    pub(super) time_s: f64,
    /// Position of the camera, metres along the street.
    pub(super) camera_s: f64,
    /// 1 if the camera looks along the street, −1 if it looks back.
    pub(super) looks: f64,
    /// Areas that people keep out of: vehicles, the lane ahead of the camera, and each other.
    pub(super) occupied: Vec<Footprint>,
}

/// A rectangle of the ground that something occupies.
#[derive(Debug, Clone, Copy)]
pub(super) struct Footprint {
    middle: [f64; 2],
    heading: f64,
    half: [f64; 2],
}

impl Footprint {
    /// A rectangle by its middle, the heading of its first side and half its sides, in metres and radians.
    pub(super) fn new(middle: [f64; 2], heading: f64, half: [f64; 2]) -> Self {
        Self {
            middle,
            heading,
            half,
        }
    }

    /// The area that an object occupies, with a margin.
    pub(super) fn by(object: &SceneObject) -> Self {
        let middle = object.world_from_object.translation();
        let forward = object.world_from_object.rotate(&Vector3::x());
        Self {
            middle: [middle.x, middle.y],
            heading: forward.y.atan2(forward.x),
            half: [0.5 * object.size[0] + 0.3, 0.5 * object.size[1] + 0.2],
        }
    }

    /// The area that a person occupies at a time, with a margin.
    pub(super) fn by_person(person: &Person, road: &Road, time_s: f64) -> Self {
        let stance = person.stance(road, time_s);
        let [long, wide, _] = person.model.size.map(f64::from);
        let [x, y, _] = stance.base;
        Self::new([x, y], stance.heading, [0.5 * long + 0.3, 0.5 * wide + 0.2])
    }

    /// Whether a point is within `margin` metres of the area.
    fn holds(&self, [x, y]: [f64; 2], margin: f64) -> bool {
        let (dx, dy) = (x - self.middle[0], y - self.middle[1]);
        let (sin, cos) = self.heading.sin_cos();
        (cos * dx + sin * dy).abs() < self.half[0] + margin
            && (cos * dy - sin * dx).abs() < self.half[1] + margin
    }
}

/// Whether a person has room at a moment.
pub(super) fn has_room(world: &World, person: &Person, moment: &Moment) -> bool {
    let road = &world.road;
    let stance = person.stance(road, moment.time_s);
    let on_street = stance.s > road.start + 5.0 && stance.s < road.end() - 5.0;
    if !on_street || (stance.s - moment.camera_s).abs() > FARTHEST {
        return false;
    }
    let [x, y, _] = stance.base;
    let (sin, cos) = stance.heading.sin_cos();
    let reach = (0.5 * f64::from(person.model.size[0]) - RADIUS).max(0.0);
    let middles = [-reach, 0.0, reach].map(|along| [x + cos * along, y + sin * along]);
    let on_ground = if person.model.class == ObjectClass::Cyclist {
        middles.iter().all(|middle| is_on_road(road, *middle))
    } else {
        person.route.crosses_at(moment.time_s) || is_on_pavement(road, &stance)
    };
    let is_occupied = |middle: &[f64; 2]| {
        let mut footprints = moment.occupied.iter();
        footprints.any(|f| f.holds(*middle, RADIUS))
    };
    on_ground && !middles.iter().any(is_occupied) && is_free(world, &stance, &middles)
}

/// Whether a wheel at this point is on the carriageway.
fn is_on_road(road: &Road, [x, y]: [f64; 2]) -> bool {
    road.kerb_distance(&road.locate(x, y)) < -0.3
}

/// Whether a person is on the pavement, or on its continuation across a side street.
fn is_on_pavement(road: &Road, stance: &Stance) -> bool {
    let sample = road.sample(road.index_at(stance.s));
    let side = usize::from(stance.lateral > 0.0);
    let beyond = stance.lateral.abs() - f64::from(sample.half_width);
    let wide = f64::from(sample.verge[side] + sample.pavement[side]) + 0.16;
    beyond > 0.2 && beyond < wide + 0.2
}

/// Whether no static object is in circles around these places, and the person is not in a house.
fn is_free(world: &World, stance: &Stance, middles: &[[f64; 2]; 3]) -> bool {
    let [x, y, ground] = stance.base;
    let from = world
        .along
        .partition_point(|a| f64::from(*a) < stance.s - REACH);
    let to = world
        .along
        .partition_point(|a| f64::from(*a) < stance.s + REACH);
    let mut near = world.primitives[from..to].iter().chain(&world.far);
    let meets_solid = near.any(|solid| {
        let (half_x, half_y, low, high) = solid.bounds(&world.hulls);
        let (dx, dy) = (x - solid.position[0], y - solid.position[1]);
        let reach = f64::from(half_x.hypot(half_y)) + 3.0;
        if dx.abs() > reach || dy.abs() > reach {
            return false;
        }
        let low = solid.position[2] + f64::from(low) - ground;
        let high = solid.position[2] + f64::from(high) - ground;
        if low > HEADROOM || high < STEP {
            return false;
        }
        let (half_x, half_y) = (f64::from(half_x), f64::from(half_y));
        let round = matches!(
            solid.shape,
            Shape::Cylinder { .. } | Shape::Ellipsoid { .. } | Shape::Crown(_)
        );
        middles.iter().any(|[x, y]| {
            let p = solid.local_point(&Vector3::new(*x, *y, ground));
            let (u, v) = (f64::from(p.x).abs(), f64::from(p.y).abs());
            if round {
                (u / (half_x + RADIUS)).hypot(v / (half_y + RADIUS)) < 1.0
            } else {
                (u - half_x).max(0.0).hypot((v - half_y).max(0.0)) < RADIUS
            }
        })
    });
    let in_house = |object: &SceneObject| {
        object.class == ObjectClass::Building && Footprint::by(object).holds([x, y], 0.0)
    };
    !meets_solid && !world.objects.iter().any(in_house)
}
