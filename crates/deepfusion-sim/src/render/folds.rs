//! Hills: the flat world, folded at creases across the view.
//!
//! A crease is a level line on the ground. The part of the world beyond it, up to the next one, turns about it by a small angle. The two
//! parts meet in the bisecting plane through the crease. Between two creases the world is the flat one after a rigid motion. So a ray is
//! followed from segment to segment, and within each it is traced in the flat world, from the camera's position in that segment's axes. A
//! rigid motion keeps the ray's parameter, which is the depth, so depth stays exact.

use super::tiles::Tiles;
use super::{Camera, Eye, Hit, RenderInput, Surface};
use crate::primitive::{Primitive, V3};
use crate::scene::World;
use deepfusion_geometry::Se3;
use nalgebra::Vector3;

/// A line on the ground about which the world beyond it is turned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Crease {
    /// Distance from the point below the camera, along the ground, metres; positive.
    pub distance: f64,
    /// Angle, radians; if positive, the ground beyond is steeper than before it.
    pub angle: f64,
}

/// The ground ahead of a camera. The camera itself stands on level ground.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Folds {
    /// The direction perpendicular to all creases, against the world's x axis, radians.
    pub heading: f64,
    /// The creases, nearest first; none if the ground is flat.
    pub creases: Vec<Crease>,
}

/// Position of a segment in the folded world.
struct Fold {
    /// The folded world from the segment's axes, which are those of the flat world.
    folded_from_flat: Se3,
    /// A point of the plane where the segment begins, in the folded world.
    point: Vector3<f64>,
    /// Normal of that plane, towards the segment.
    normal: Vector3<f64>,
}

impl Folds {
    /// The segments ahead of a camera, the one that it stands in first.
    fn segments(&self, foot: &Vector3<f64>) -> Vec<Fold> {
        let ahead = Vector3::new(self.heading.cos(), self.heading.sin(), 0.0);
        let right = Vector3::new(ahead.y, -ahead.x, 0.0);
        let foot = Vector3::new(foot.x, foot.y, 0.0);
        let mut folded_from_flat = Se3::identity();
        let mut all = vec![Fold {
            folded_from_flat,
            point: foot,
            normal: ahead,
        }];
        for Crease { distance, angle } in &self.creases {
            let crease = foot + ahead * *distance;
            let half = 0.5 * angle;
            let normal = ahead * half.cos() + Vector3::z() * half.sin();
            let (point, normal) = (
                folded_from_flat.transform(&crease),
                folded_from_flat.rotate(&normal),
            );
            let turn = Se3::from_axis_angle(right * *angle, Vector3::zeros());
            let shift = Se3::from_axis_angle(Vector3::zeros(), crease - turn.rotate(&crease));
            folded_from_flat = folded_from_flat * shift * turn;
            all.push(Fold {
                folded_from_flat,
                point,
                normal,
            });
        }
        all
    }

    /// Whether any part of a solid may be in a segment.
    fn reaches(
        &self,
        segment: usize,
        world: &World,
        solid: &Primitive,
        foot: &Vector3<f64>,
    ) -> bool {
        let (half_x, half_y, low, high) = solid.bounds(&world.hulls);
        let z = solid.position[2];
        let highest = (z + f64::from(low)).abs().max((z + f64::from(high)).abs());
        let (x, y) = (solid.position[0] - foot.x, solid.position[1] - foot.y);
        let along = x * self.heading.cos() + y * self.heading.sin();
        // The planes between the segments are tilted by half the angle of their crease.
        let reach = |crease: &Crease| {
            f64::from(half_x.hypot(half_y)) + highest * (0.5 * crease.angle).tan().abs() + 0.01
        };
        let begin = segment.checked_sub(1).map(|before| &self.creases[before]);
        let end = self.creases.get(segment);
        begin.is_none_or(|crease| along + reach(crease) > crease.distance)
            && end.is_none_or(|crease| along - reach(crease) < crease.distance)
    }
}

/// A part of the world between two creases.
pub(super) struct Segment<'a> {
    /// The pose of the camera in the segment's axes.
    pub world_from_cam: Se3,
    /// The rays of the camera in the segment's axes.
    pub camera: Camera,
    /// The camera's view of the flat world from there.
    pub eye: Eye<'a>,
    tiles: Tiles,
    /// The plane where the segment begins: its normal in the first segment's axes, and its distance ahead of the camera along that normal,
    /// metres.
    begin: (V3, f32),
}

/// The folded world, as the camera sees it.
pub(super) struct Folded<'a> {
    /// The segments, nearest first; the camera is in the first.
    pub segments: Vec<Segment<'a>>,
}

impl<'a> Segment<'a> {
    fn new(
        input: &RenderInput<'a>,
        solids: Vec<Primitive>,
        world_from_cam: Se3,
        begin: (V3, f32),
    ) -> Self {
        let (world, k) = (input.world, input.intrinsics);
        let (tiles, solids) = Tiles::bin(world, solids, &world_from_cam, k);
        Self {
            camera: Camera::new(&world_from_cam, k),
            eye: Eye {
                world,
                position: world_from_cam.translation(),
                solids,
            },
            tiles,
            begin,
            world_from_cam,
        }
    }
}

impl<'a> Folded<'a> {
    /// The segments of a world with these solids.
    pub(super) fn new(input: &RenderInput<'a>, solids: Vec<Primitive>) -> Self {
        let (folds, pose) = (input.folds, *input.world_from_cam);
        if folds.creases.is_empty() {
            let all = Segment::new(input, solids, pose, (V3::zeros(), 0.0));
            return Self {
                segments: vec![all],
            };
        }
        let eye = pose.translation();
        let segment = |(number, fold): (usize, Fold)| {
            let within = |solid: &&Primitive| folds.reaches(number, input.world, solid, &eye);
            let own = solids.iter().filter(within).copied().collect();
            let ahead = fold.normal.dot(&(fold.point - eye));
            let begin = (fold.normal.map(|x| x as f32), ahead as f32);
            Segment::new(input, own, fold.folded_from_flat.inverse() * pose, begin)
        };
        Self {
            segments: folds
                .segments(&eye)
                .into_iter()
                .enumerate()
                .map(segment)
                .collect(),
        }
    }

    /// The hit of the ray through (`x`, `y`), which is within the pixel (`u`, `v`), and the ray as [`Folded::ray`] returns it.
    #[inline]
    pub(super) fn trace(&self, (u, v): (usize, usize), (x, y): (f32, f32)) -> (Hit, V3) {
        let first = &self.segments[0];
        let d = first.camera.ray(x, y);
        if self.segments.len() > 1 {
            return self.walk((u, v), (x, y), d);
        }
        (first.eye.trace(first.tiles.at(u, v), &d), d)
    }

    /// Follows a ray from segment to segment; `d` is its direction in the first one's axes.
    #[inline(never)]
    fn walk(&self, (u, v): (usize, usize), (x, y): (f32, f32), d: V3) -> (Hit, V3) {
        let mut from = 0.0;
        for (number, segment) in self.segments.iter().enumerate() {
            let next = self.segments.get(number + 1);
            let to = next.map_or(f32::INFINITY, |next| {
                let rate = next.begin.0.dot(&d);
                if rate > 1e-6 {
                    (next.begin.1 / rate).max(from)
                } else {
                    f32::INFINITY
                }
            });
            let own = segment.camera.ray(x, y);
            let candidates = segment.tiles.at(u, v);
            let hit = segment.eye.trace_between(candidates, &own, (from, to));
            if hit.surface != Surface::Sky {
                let segment = number as u8;
                return (Hit { segment, ..hit }, own);
            }
            if to == f32::INFINITY {
                break;
            }
            from = to;
        }
        (Hit::SKY, d)
    }

    /// The ray through (`x`, `y`), in the axes of the segment that it ends in; for the sky, in those of the first.
    #[inline]
    pub(super) fn ray(&self, hit: &Hit, (x, y): (f32, f32)) -> V3 {
        self.segments[usize::from(hit.segment)].camera.ray(x, y)
    }
}
