//! The camera of a view: its pose and its lens.

use super::built_world::BuiltWorld;
use super::draw::{normal, weighted};
use super::ingredient::Without;
use super::mounted::MountedCamera;
use crate::config::Scene;
use crate::motion::rotation;
use crate::primitive::{Primitive, V3, enter};
use crate::rig::VEHICLE_FROM_CAM_AXES;
use deepfusion_geometry::{Intrinsics, Se3};
use nalgebra::Vector3;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::{PI, TAU};

/// Least and greatest height of a camera above its ground, metres.
pub(super) const HEIGHTS: (f64, f64) = (0.3, 2.5);

/// Least and greatest horizontal field of view, radians.
pub(super) const FIELDS: (f64, f64) = (35.0 * PI / 180.0, 110.0 * PI / 180.0);

/// A camera keeps this far from every solid's box, metres.
const CLEARANCE: f64 = 0.35;

/// Solids within this distance decide whether a place is too cramped, metres.
const NEARBY: f64 = 14.0;

/// Places that are tried before the camera is put where cars drive.
const TRIES: usize = 40;

/// The camera's pose in a world.
#[derive(Debug, Clone, Copy)]
pub(super) struct Viewpoint {
    /// World (z up) from the camera.
    pub world_from_cam: Se3,
    /// Height above the ground below it, metres.
    pub height: f64,
    /// Whether the traffic was removed, because no free position was found among it.
    pub alone: bool,
}

/// A lens, and the crop or squeeze of its picture.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lens {
    /// Horizontal field of view, radians.
    pub field: f64,
    /// Relative difference of fy from fx, before the squeeze.
    pub unequal: f64,
    /// Factor on fy.
    pub squeeze: f64,
    /// Offset of the principal point from the middle, as a share of the width.
    pub column: f64,
    /// Offset of the principal point from the middle, as a share of the height.
    pub row: f64,
}

impl Lens {
    /// The intrinsics in pixels of a picture of this width and height.
    pub(super) fn intrinsics(&self, (width, height): (u32, u32)) -> Intrinsics {
        let (w, h) = (f64::from(width), f64::from(height));
        let fx = 0.5 * w / (0.5 * self.field).tan();
        Intrinsics {
            fx,
            fy: fx * self.squeeze * (1.0 + self.unequal),
            cx: 0.5 * (w - 1.0) + w * self.column,
            cy: 0.5 * (h - 1.0) + h * self.row,
            width,
            height,
        }
    }
}

/// Draws a lens, and the crop or squeeze of its picture to the requested size.
///
/// Horizontal field of view: 70 % normal around 78° (deviation 8°, 64° to 92°), in rooms around 64°; the rest uniform from 35° to 60° or
/// from 90° to 110°. Half of the pictures, and nine in ten of those of rooms, had another aspect ratio and were squeezed to this size
/// ([`squeeze`]). Apart from that fy equals fx within 1 % in two of three cameras, and within 3 % in the others. The offset of the
/// principal point from the middle is normal: 1.5 % of the width and 5 % of the height. In one of five of the pictures that were not
/// squeezed it is up to 20 % of the height, as in a crop from a taller picture.
pub(super) fn lens(rng: &mut ChaCha8Rng, (width, height): (u32, u32), indoors: bool) -> Lens {
    let field = match rng.random_range(0..20) {
        0..=13 => normal(rng, if indoors { 64.0 } else { 78.0 }, 8.0, 1.78),
        14..=16 => rng.random_range(35.0..60.0),
        _ => rng.random_range(90.0..110.0),
    }
    .to_radians()
    .clamp(FIELDS.0, FIELDS.1);
    let unequal = if rng.random_bool(0.67) {
        normal(rng, 0.0, 0.004, 2.5)
    } else {
        rng.random_range(-0.03..0.03)
    };
    let squeezed = rng.random_bool(if indoors { 0.9 } else { 0.5 });
    let squeeze = if squeezed {
        squeeze(rng, f64::from(width) / f64::from(height))
    } else {
        1.0
    };
    let row = if !squeezed && rng.random_bool(0.2) {
        rng.random_range(-0.2..0.2)
    } else {
        normal(rng, 0.0, 0.05, 3.0)
    };
    Lens {
        field,
        unequal,
        squeeze,
        column: normal(rng, 0.0, 0.015, 3.0),
        row,
    }
}

/// fy / fx of a picture with a usual aspect ratio that was squeezed to the wanted one: 16:9 as of dashcams and phones, 4:3 as of depth
/// cameras, or anything between 5:4 and 3:1. It is 1 if the wanted one is not wider.
fn squeeze(rng: &mut ChaCha8Rng, wanted: f64) -> f64 {
    let aspect = match rng.random_range(0..20) {
        0..=8 => 16.0 / 9.0,
        9..=14 => 4.0 / 3.0,
        _ => rng.random_range(1.25..3.0),
    };
    (aspect / wanted).min(1.0)
}

/// Height above the ground, metres: 65 % as on cars (normal, 1.6 ± 0.17), 20 % lower (robots), 15 % higher.
fn height(rng: &mut ChaCha8Rng) -> f64 {
    match rng.random_range(0..20) {
        0..=12 => on_a_car(rng),
        13..=16 => rng.random_range(HEIGHTS.0..1.2),
        _ => rng.random_range(1.8..HEIGHTS.1),
    }
}

/// Height above the ground of a camera on a car, metres.
fn on_a_car(rng: &mut ChaCha8Rng) -> f64 {
    normal(rng, 1.6, 0.17, 2.3)
}

/// Pitch, positive downwards, and roll, radians. Mostly that of a vehicle (deviations of 2.2° and 0.9°); sometimes any pitch up to 15°
/// (below a height of 0.9 m mostly upwards) and any roll up to 10°.
fn tilt(rng: &mut ChaCha8Rng, height: f64) -> (f64, f64) {
    let pitch = if rng.random_bool(if height < 0.9 { 0.4 } else { 0.12 }) {
        let down = if height < 0.9 { 8.0 } else { 15.0 };
        rng.random_range(-15.0..down)
    } else {
        normal(rng, 0.0, 2.2, 2.7)
    };
    let roll = if rng.random_bool(0.07) {
        rng.random_range(-10.0..10.0)
    } else {
        normal(rng, 0.0, 0.9, 3.3)
    };
    (f64::to_radians(pitch), f64::to_radians(roll))
}

/// Position and direction of a camera on the street.
#[derive(Debug, Clone, Copy)]
enum Kind {
    /// In a lane, facing the way it drives.
    Driving,
    /// On the road, turned by up to 70°.
    Turning,
    /// On the road, facing anywhere.
    Sideways,
    /// Up to 13 m from the middle of the street, facing anywhere, mostly along it.
    Beside,
}

/// Street coordinates, a heading, and how far the view ahead must be free, metres. `anchor` is the position that traffic leaves free,
/// metres along the street.
fn spot(
    rng: &mut ChaCha8Rng,
    place: &BuiltWorld,
    anchor: f64,
    kinds: &[(f64, Kind)],
) -> ((f64, f64, f64), f32) {
    let kind = weighted(rng, kinds);
    if !place.world.rooms.is_empty() {
        return (in_room(rng, place, anchor), 0.8);
    }
    // In any lane, with its traffic: at the anchor, or among the cars ahead of it.
    let lanes = place.world.lanes();
    let on = lanes[rng.random_range(0..lanes.len())];
    let s = if matches!(kind, Kind::Driving) && on.forward && rng.random_bool(0.7) {
        anchor
    } else {
        anchor + rng.random_range(-10.0..110.0)
    };
    let lane = on.lateral + normal(rng, 0.0, 0.35, 2.5);
    let along = if on.forward { 0.0 } else { PI };
    // Drivers usually keep their distance.
    let ahead = match kind {
        Kind::Driving => rng.random_range(3.0..14.0),
        _ => 1.2,
    };
    let spot = match kind {
        Kind::Driving => (s, lane, along + normal(rng, 0.0, 0.05, 3.0)),
        Kind::Turning => (s, lane, along + rng.random_range(-1.2..1.2)),
        Kind::Sideways => (s, lane, rng.random_range(-PI..PI)),
        Kind::Beside => {
            let widest = if place.world.scene == Scene::Garage {
                8.0
            } else {
                13.0
            };
            let turn = if rng.random_bool(0.6) {
                along + normal(rng, 0.0, 0.25, 2.5)
            } else {
                rng.random_range(0.0..TAU)
            };
            (s, rng.random_range(-widest..widest), turn)
        }
    };
    (spot, ahead)
}

/// A place in the room at `s`, facing anywhere.
fn in_room(rng: &mut ChaCha8Rng, place: &BuiltWorld, s: f64) -> (f64, f64, f64) {
    let rooms = &place.world.rooms;
    let number = rooms.partition_point(|room| room.high[0] < s);
    let room = &rooms[number.min(rooms.len() - 1)];
    // Rooms lie along a straight line, the world's x axis.
    let x = rng.random_range(room.low[0]..room.high[0]);
    let y = rng.random_range(room.low[1]..room.high[1]);
    (x, y, rng.random_range(0.0..TAU))
}

/// How a view's camera is mounted.
#[derive(Clone, Copy)]
pub(super) struct Mount<'a> {
    /// The vehicle that carries it; `None`: any mounting.
    pub mounted: Option<&'a MountedCamera>,
    /// Ingredients that are left out of the mounting.
    pub without: Without<'a>,
}

impl Mount<'_> {
    /// Height above the ground, metres, pitch and roll, radians.
    pub(super) fn draw(self, rng: &mut ChaCha8Rng, indoors: bool) -> (f64, f64, f64) {
        if let Some(camera) = self.mounted {
            let usual = on_a_car(rng);
            return camera.pose(rng, usual);
        }
        let height = height(rng);
        let (mut pitch, roll) = tilt(rng, height);
        if indoors {
            // Held by hand, or on a robot that looks at the floor.
            pitch += normal(rng, 0.12, 0.2, 1.8);
        }
        let (pitch, roll) = self.without.tilt((pitch, roll));
        (self.without.height(height), pitch, roll)
    }

    /// Kinds of position, with weights.
    fn kinds(self) -> &'static [(f64, Kind)] {
        match self.mounted {
            Some(camera) if camera.is_on_a_car() => &[(0.85, Kind::Driving), (0.15, Kind::Turning)],
            _ => &[
                (0.6, Kind::Driving),
                (0.13, Kind::Turning),
                (0.1, Kind::Sideways),
                (0.17, Kind::Beside),
            ],
        }
    }
}

/// Draws a free place for a camera among the traffic around `anchor`, metres along the street: not within a solid or close to one, and
/// without close solids in most of the view.
pub(super) fn viewpoint(
    rng: &mut ChaCha8Rng,
    place: &BuiltWorld,
    (moving, anchor): (&[Primitive], f64),
    k: &Intrinsics,
    mount: Mount,
) -> Viewpoint {
    let indoors = !place.world.rooms.is_empty();
    let (height, pitch, roll) = mount.draw(rng, indoors);
    for _ in 0..TRIES {
        let (spot, ahead) = spot(rng, place, anchor, mount.kinds());
        let viewpoint = pose(place, spot, (height, pitch, roll));
        if is_free(place, moving, &viewpoint.world_from_cam, k, ahead) {
            return viewpoint;
        }
    }
    // A lane has no static objects; the caller removes the dynamic ones.
    let lane = place.world.lanes().into_iter().find(|lane| lane.forward);
    let lateral = lane.map_or(-1.65, |lane| lane.lateral);
    Viewpoint {
        alone: true,
        ..pose(place, (anchor, lateral, 0.0), (height, pitch, roll))
    }
}

fn pose(
    place: &BuiltWorld,
    (s, lateral, turn): (f64, f64, f64),
    (height, pitch, roll): (f64, f64, f64),
) -> Viewpoint {
    let road = &place.world.road;
    let (x, y, heading) = road.world(s, lateral);
    let ground = if road.kerb_distance(&road.locate(x, y)) < 0.0 {
        0.0
    } else {
        f64::from(road.kerb)
    };
    let rotation = rotation(heading + turn, pitch, roll) * VEHICLE_FROM_CAM_AXES;
    Viewpoint {
        world_from_cam: Se3::from_parts(&rotation, Vector3::new(x, y, ground + height)),
        height,
        alone: false,
    }
}

fn is_free(
    place: &BuiltWorld,
    moving: &[Primitive],
    world_from_cam: &Se3,
    k: &Intrinsics,
    ahead: f32,
) -> bool {
    let world = &place.world;
    let eye = world_from_cam.translation();
    let near: Vec<&Primitive> = world
        .primitives
        .iter()
        .chain(&world.far)
        .chain(moving)
        .filter(|solid| {
            let (half_x, half_y, low, high) = solid.bounds(&world.hulls);
            let reach = f64::from(half_x.hypot(half_y)) + NEARBY;
            let (dx, dy) = (solid.position[0] - eye.x, solid.position[1] - eye.y);
            let below = solid.position[2] + f64::from(low) - NEARBY;
            let above = solid.position[2] + f64::from(high) + NEARBY;
            dx * dx + dy * dy < reach * reach && eye.z > below && eye.z < above
        })
        .collect();
    let within = |solid: &&Primitive| {
        let (half_x, half_y, low, high) = solid.bounds(&world.hulls);
        let p = solid.local_point(&eye);
        let clear = CLEARANCE as f32;
        p.x.abs() < half_x + clear
            && p.y.abs() < half_y + clear
            && p.z > low - clear
            && p.z < high + clear
    };
    if near.iter().any(within) {
        return false;
    }
    let indoors = !world.rooms.is_empty();
    let (arm, open) = if indoors { (0.5, 1.6) } else { (1.2, 4.0) };
    // Rays over the picture: at most a quarter of them may end within 1.2 m, at least a quarter must reach 4 m (in rooms 0.5 m and 1.6 m),
    // and those in the middle must reach `ahead`.
    let (mut close, mut far, mut all) = (0, 0, 0);
    for row in [0.15, 0.4, 0.65] {
        for column in 0..7i32 {
            let u = f64::from(k.width) * (f64::from(column) + 0.5) / 7.0;
            let ray = k.back_project(u, f64::from(k.height) * row, 1.0);
            let d: V3 = world_from_cam.rotate(&ray).map(|x| x as f32);
            let t = near
                .iter()
                .filter_map(|solid| {
                    let (o, d) = (solid.local_point(&eye), solid.local_of(&d));
                    enter(&solid.shape, &world.hulls, &o, &d, NEARBY as f32).map(|entry| entry.t)
                })
                .fold(f32::INFINITY, f32::min);
            if (2..5).contains(&column) && t < ahead {
                return false;
            }
            all += 1;
            close += usize::from(t < arm);
            far += usize::from(t >= open);
        }
    }
    4 * close <= all && 4 * far >= all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::varied::draw::generator;

    #[test]
    fn lenses_are_within_their_bounds_and_mostly_like_those_on_cars() {
        let mut rng = generator(1, 1, 1);
        let (mut usual, mut square, mut like_kitti) = (0, 0, 0);
        for _ in 0..5000 {
            let k = lens(&mut rng, (640, 192), false).intrinsics((640, 192));
            assert_eq!(k.implausible(), None);
            let field = 2.0 * (320.0 / k.fx).atan();
            assert!(field > FIELDS.0 - 1e-9 && field < FIELDS.1 + 1e-9);
            let ratio = k.fy / k.fx;
            assert!((0.36..=1.03).contains(&ratio), "{ratio}");
            square += usize::from((ratio - 1.0).abs() <= 0.03);
            assert!((k.cx - 319.5).abs() < 0.05 * 640.0 && (k.cy - 95.5).abs() <= 0.2 * 192.0);
            usual += usize::from(field > 60f64.to_radians() && field < 90f64.to_radians());
            // KITTI's camera 2 at this size: fx 371.8, fy 369.4, cx 313.9, cy 88.3.
            like_kitti += usize::from(
                (k.fx / 371.8 - 1.0).abs() < 0.1
                    && (k.fy / 369.4 - 1.0).abs() < 0.1
                    && (k.cx - 313.9).abs() < 10.0
                    && (k.cy - 88.3).abs() < 10.0,
            );
        }
        assert!((2900..3400).contains(&usual), "{usual}");
        assert!((2350..2650).contains(&square), "{square}");
        assert!(like_kitti > 190, "{like_kitti}");
        // For a picture of 4:3, the strongest squeeze is that from a 5:4 picture.
        let tall = lens(&mut rng, (320, 240), true).intrinsics((320, 240));
        assert!(tall.fy / tall.fx > 0.9, "{tall:?}");
    }

    #[test]
    fn heights_and_tilts_are_within_their_bounds() {
        let mut rng = generator(1, 2, 1);
        let (mut usual, mut level) = (0, 0);
        for _ in 0..5000 {
            let height = height(&mut rng);
            assert!((HEIGHTS.0..=HEIGHTS.1).contains(&height));
            usual += usize::from((1.2..=2.0).contains(&height));
            let (pitch, roll) = tilt(&mut rng, height);
            assert!(pitch.abs() <= 0.262 && roll.abs() <= 0.175);
            level += usize::from(pitch.abs() < 0.105 && roll.abs() < 0.053);
        }
        assert!((3300..4000).contains(&usual), "{usual}");
        assert!(level > 3600, "{level}");
    }
}
