//! Targets and ground, in the camera's axes: x right, y down, z forward, metres.

use deepfusion_records::{GroundPlane, Target};
use deepfusion_render::colour_of;
use re_sdk_types::archetypes::{Arrows3D, Boxes3D, LineStrips3D};
use re_sdk_types::components::{Color, FillMode};
use re_sdk_types::datatypes::Quaternion;

/// What is drawn of a target.
pub(super) struct SeenTarget {
    /// Its track's number.
    pub id: u64,
    pub centre: [f64; 3],
    /// Length, width, height.
    size: [f64; 3],
    /// KITTI's rotation_y.
    yaw: f64,
    velocity: Option<[f64; 3]>,
    label: String,
}

impl SeenTarget {
    /// From `NAME_targets.json`.
    pub(super) fn of(target: &Target) -> Self {
        let id = target.id;
        let moves = target.moving == Some(true);
        let velocity = target.velocity_mps.filter(|_| moves);
        let mut label = match &target.class {
            Some(class) => format!("{class} {id}"),
            None => id.to_string(),
        };
        label += &format!(" {:.1} m", target.distance_m);
        if let Some(v) = velocity {
            label += &format!(" {:.1} m/s", length(v));
        }
        Self {
            id,
            centre: target.center_m,
            size: target.size_m,
            yaw: target.yaw_rad,
            velocity,
            label,
        }
    }

    /// The colour of the track, as in the pictures that `perceive` writes.
    pub(super) fn colour(&self) -> Color {
        let [r, g, b] = colour_of(self.id).0;
        Color::from_rgb(r, g, b)
    }
}

fn length(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// The boxes: length along the box's x, height along y, width along z, turned about y.
pub(super) fn boxes(targets: &[SeenTarget]) -> Option<Boxes3D> {
    let half_size = |t: &SeenTarget| {
        let [length, width, height] = t.size;
        [length, height, width].map(|side| (side / 2.0) as f32)
    };
    let turn = |t: &SeenTarget| {
        let (sin, cos) = (t.yaw / 2.0).sin_cos();
        Quaternion::from_xyzw([0.0, sin as f32, 0.0, cos as f32])
    };
    (!targets.is_empty()).then(|| {
        Boxes3D::from_half_sizes(targets.iter().map(half_size))
            .with_centers(targets.iter().map(|t| t.centre.map(|x| x as f32)))
            .with_quaternions(targets.iter().map(turn))
            .with_colors(targets.iter().map(SeenTarget::colour))
            .with_labels(targets.iter().map(|t| t.label.as_str()))
            .with_fill_mode(FillMode::MajorWireframe)
    })
}

/// From the centre of each dynamic target to its position in a second.
pub(super) fn velocities(targets: &[SeenTarget]) -> Option<Arrows3D> {
    let moving: Vec<_> = targets
        .iter()
        .filter_map(|t| Some((t, t.velocity?)))
        .collect();
    let metres = |v: [f64; 3]| v.map(|x| x as f32);
    (!moving.is_empty()).then(|| {
        Arrows3D::from_vectors(moving.iter().map(|(_, v)| metres(*v)))
            .with_origins(moving.iter().map(|(t, _)| metres(t.centre)))
            .with_colors(moving.iter().map(|(t, _)| t.colour()))
    })
}

/// A grid of 5 m on the plane normal·p + offset = 0, from the camera to 50 m ahead; `None` if the plane is too steep to drive on.
pub(super) fn ground(plane: GroundPlane) -> Option<LineStrips3D> {
    const GREY: [u8; 4] = [140, 140, 140, 120];
    let [nx, ny, nz] = plane.normal.map(f64::from);
    let offset = f64::from(plane.offset_m);
    if ny.abs() < 0.5 {
        return None;
    }
    let on_plane = |x: f64, z: f64| [x, -(offset + nx * x + nz * z) / ny, z].map(|p| p as f32);
    let steps = |from: i32, to: i32| (from..=to).map(|i| f64::from(5 * i));
    let ahead = steps(-3, 3).map(|x| [on_plane(x, 0.0), on_plane(x, 50.0)]);
    let across = steps(0, 10).map(|z| [on_plane(-15.0, z), on_plane(15.0, z)]);
    Some(LineStrips3D::new(ahead.chain(across)).with_colors([Color::from(GREY)]))
}
