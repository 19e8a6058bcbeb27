//! The camera: rays through a frame's solids and the ground, shaded and antialiased.

mod air;
mod folds;
mod shade;
mod tiles;

use crate::light::{Foot, GroundLight};
use crate::primitive::{Entry, FACE_LEAVES, Primitive, V3, enter, enter_beyond};
use crate::road::StreetPoint;
use crate::scene::SceneObject;
use crate::scene::World;
use crate::texture::Rgb;
pub(crate) use air::{Air, Fog, Glow};
use deepfusion_geometry::{DepthMap, Intrinsics, Se3};
use folds::Folded;
pub(crate) use folds::{Crease, Folds};
use image::RgbImage;
use nalgebra::Vector3;
use rayon::prelude::*;
pub(crate) use shade::Shader;
use shade::encode_srgb;
use tiles::TILE;

/// Solids farther ahead along the street than this are not drawn, metres.
const AHEAD: f32 = 420.0;
/// Likewise behind it, for a camera that looks ahead.
pub(crate) const BEHIND: f32 = 70.0;

/// No solid reaches farther from its middle, metres, except the hills around the street.
pub(crate) const LARGEST_M: f32 = 60.0;

/// Ground beyond this depth counts as horizon, metres.
const FARTHEST_GROUND: f32 = 600.0;

/// A surface that a ray hits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Surface {
    /// No surface.
    Sky,
    /// A solid of the frame: its index and face.
    Solid(u32, u8),
    /// The carriageway.
    Road,
    /// The upright face of a kerb.
    Kerb,
    /// Ground beside the road.
    Beside,
}

impl Surface {
    /// Whether both are the same surface; all leaves of a lobe count as one.
    #[inline]
    pub(crate) fn is_like(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Solid(a, face), Self::Solid(b, other)) => {
                a == b && (face == other || *face.min(other) >= FACE_LEAVES)
            }
            _ => self == other,
        }
    }
}

/// Where a ray ends.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Hit {
    /// Position along the ray, in units of its direction; infinite for the sky.
    pub t: f32,
    /// The surface it hit.
    pub surface: Surface,
    /// Segment of the folded world; each has its own numbering of solids.
    pub segment: u8,
}

impl Hit {
    /// The sky.
    pub(crate) const SKY: Self = Self {
        t: f32::INFINITY,
        surface: Surface::Sky,
        segment: 0,
    };

    /// Whether both hits are on the same surface. Ground continues from one segment to the next, but not behind a crest.
    #[inline]
    fn is_like(&self, other: &Self) -> bool {
        let goes_on = || {
            let apart = (self.t - other.t).abs();
            !matches!(self.surface, Surface::Solid(..)) && apart < 0.2 * self.t.min(other.t)
        };
        self.surface.is_like(&other.surface) && (self.segment == other.segment || goes_on())
    }
}

/// A solid seen from one eye.
pub(crate) struct FrameSolid {
    /// The solid.
    pub primitive: Primitive,
    /// The eye in the solid's axes.
    pub eye: V3,
    /// Least possible depth (for the camera) or range (for a scanner) of the solid, metres.
    pub nearest: f32,
}

/// The solids around a place on the street, from `behind` metres behind it to [`AHEAD`] ahead, and the moving ones.
pub(crate) fn gather(
    world: &World,
    moving: &[Primitive],
    eye: &Vector3<f64>,
    behind: f32,
) -> Vec<Primitive> {
    let s = world.road.locate(eye.x, eye.y).s;
    let from = world.along.partition_point(|a| *a < s - behind);
    let to = world.along.partition_point(|a| *a < s + AHEAD);
    world.primitives[from..to]
        .iter()
        .chain(&world.far)
        .chain(moving)
        .copied()
        .collect()
}

/// The point that rays start from.
pub(crate) struct Eye<'a> {
    /// The world.
    pub world: &'a World,
    /// Position in the world.
    pub position: Vector3<f64>,
    /// Solids that may be visible, nearest first.
    pub solids: Vec<FrameSolid>,
}

impl Eye<'_> {
    /// The first of the `candidates` (indices of solids, nearest first), the ground or the sky, along `d`.
    #[inline]
    pub(crate) fn trace(&self, candidates: &[u32], d: &V3) -> Hit {
        self.first(
            candidates,
            d,
            (0.0, f32::INFINITY),
            |solid, local, limit| {
                let (shape, hulls) = (&solid.primitive.shape, &self.world.hulls);
                enter(shape, hulls, &solid.eye, local, limit)
            },
        )
    }

    /// As [`Eye::trace`], but only between two values of t. A solid that contains the start is cut there.
    #[inline(never)]
    pub(crate) fn trace_between(&self, candidates: &[u32], d: &V3, (from, to): (f32, f32)) -> Hit {
        if from <= 0.0 {
            // The camera is outside all solids.
            return self.first(candidates, d, (0.0, to), |solid, local, limit| {
                let (shape, hulls) = (&solid.primitive.shape, &self.world.hulls);
                enter(shape, hulls, &solid.eye, local, limit)
            });
        }
        self.first(candidates, d, (from, to), |solid, local, limit| {
            let (shape, hulls) = (&solid.primitive.shape, &self.world.hulls);
            enter_beyond(shape, hulls, (&solid.eye, local), (from, limit))
        })
    }

    /// The first of the solids, the ground or the sky. `enter` returns where the ray (in the solid's axes) enters a solid before a limit.
    #[inline(always)]
    fn first(
        &self,
        candidates: &[u32],
        d: &V3,
        (from, to): (f32, f32),
        enter: impl Fn(&FrameSolid, &V3, f32) -> Option<Entry>,
    ) -> Hit {
        let mut hit = Hit { t: to, ..Hit::SKY };
        for index in candidates {
            let solid = &self.solids[*index as usize];
            if solid.nearest > hit.t {
                break;
            }
            let local = solid.primitive.local_of(d);
            if let Some(entry) = enter(solid, &local, hit.t) {
                hit.t = entry.t;
                hit.surface = Surface::Solid(*index, entry.face);
            }
        }
        if d.z < -1e-5 {
            let (t, surface) = self.ground(d, (from, hit.t));
            if t < hit.t {
                return Hit {
                    t,
                    surface,
                    ..Hit::SKY
                };
            }
        }
        if hit.surface == Surface::Sky {
            return Hit::SKY;
        }
        hit
    }

    /// Street coordinates of the ray's point at `t`.
    #[inline]
    pub(crate) fn street_point(&self, d: &V3, t: f32) -> StreetPoint {
        let x = self.position.x + f64::from(d.x * t);
        let y = self.position.y + f64::from(d.y * t);
        self.world.road.locate(x, y)
    }

    /// The ground has height 0 on the road and the kerb's height elsewhere, with upright kerbs between. It is solid: a ray that begins
    /// inside it, at t = `from`, ends there.
    #[inline(always)]
    fn ground(&self, d: &V3, (from, limit): (f32, f32)) -> (f32, Surface) {
        let road = &self.world.road;
        let height = self.position.z as f32;
        let t_upper = ((road.kerb - height) / d.z).max(from);
        if t_upper >= limit || t_upper <= 0.0 || t_upper > FARTHEST_GROUND {
            return (f32::INFINITY, Surface::Sky);
        }
        let upper = road.kerb_distance(&self.street_point(d, t_upper));
        if upper >= 0.0 {
            return (t_upper, Surface::Beside);
        }
        let t_lower = (-height / d.z).max(from);
        let lower = road.kerb_distance(&self.street_point(d, t_lower));
        if lower < 0.0 {
            return (t_lower, Surface::Road);
        }
        // The kerb is where the distance changes sign: bisection, then one secant step.
        let (mut a, mut b) = ((t_upper, upper), (t_lower, lower));
        for _ in 0..5 {
            let middle = 0.5 * (a.0 + b.0);
            let distance = road.kerb_distance(&self.street_point(d, middle));
            if distance < 0.0 {
                a = (middle, distance);
            } else {
                b = (middle, distance);
            }
        }
        (a.0 + (b.0 - a.0) * a.1 / (a.1 - b.1), Surface::Kerb)
    }
}

/// A rendered picture.
pub(crate) struct Picture {
    /// Colours.
    pub rgb: RgbImage,
    /// Camera z in metres, 0 for the sky.
    pub depth: DepthMap,
    /// Pixels of dynamic objects.
    pub moving: Vec<bool>,
}

/// Light at the camera in linear colours, before image formation.
pub(crate) struct Exposure {
    /// Linear colours, row by row.
    pub light: Vec<Rgb>,
    /// The hits of the rays through the pixels' centres.
    pub hits: Vec<Hit>,
    /// Camera z in metres, 0 for the sky.
    pub depth: DepthMap,
    /// Pixels of dynamic objects.
    pub moving: Vec<bool>,
    /// World from the camera, in the axes of each segment.
    pub segments: Vec<Se3>,
}

/// The input of a rendering.
#[derive(Clone, Copy)]
pub(crate) struct RenderInput<'a> {
    /// The world.
    pub world: &'a World,
    /// Light on its ground.
    pub light: &'a GroundLight,
    /// Sky, sun and air.
    pub air: &'a Air,
    /// The boxes of dynamic objects.
    pub cars: &'a [SceneObject],
    /// World (z up) from the camera (x right, y down, z forward), metres.
    pub world_from_cam: &'a Se3,
    /// The camera.
    pub intrinsics: &'a Intrinsics,
    /// The hills ahead of the camera.
    pub folds: &'a Folds,
}

/// Renders what a camera sees; `moving` are the solids of the moving `cars`.
pub(crate) fn render(
    world: &World,
    light: &GroundLight,
    moving: &[Primitive],
    cars: &[SceneObject],
    world_from_cam: &Se3,
    k: &Intrinsics,
) -> Picture {
    let air = Air::of(world);
    let input = RenderInput {
        world,
        light,
        air: &air,
        cars,
        world_from_cam,
        intrinsics: k,
        folds: &Folds::default(),
    };
    let solids = gather(world, moving, &world_from_cam.translation(), BEHIND);
    let exposure = expose(&input, solids, Cores::All, Edges::EachRay);
    Picture {
        rgb: encode(&exposure.light, k.width, k.height),
        depth: exposure.depth,
        moving: exposure.moving,
    }
}

/// The image of an ideal camera, without the imperfections of a real one.
pub(crate) fn encode(light: &[Rgb], width: u32, height: u32) -> RgbImage {
    let bytes = light.iter().flat_map(encode_srgb).collect();
    // The buffer has 3 · width · height bytes by construction.
    RgbImage::from_raw(width, height, bytes).unwrap_or_else(|| RgbImage::new(width, height))
}

/// The threads to use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Cores {
    /// The calling thread alone, for callers that use several threads themselves.
    One,
    /// All threads of rayon.
    All,
}

impl Cores {
    /// Calls `work` with the number and the items of each piece of `size` items.
    pub(crate) fn split<T: Send>(
        self,
        items: &mut [T],
        size: usize,
        work: impl Fn(usize, &mut [T]) + Send + Sync,
    ) {
        match self {
            Self::One => {
                for (number, piece) in items.chunks_mut(size).enumerate() {
                    work(number, piece);
                }
            }
            Self::All => items
                .par_chunks_mut(size)
                .enumerate()
                .for_each(|(number, piece)| work(number, piece)),
        }
    }
}

/// How a pixel that contains several surfaces is antialiased, from four rays through it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Edges {
    /// Every ray is shaded.
    EachRay,
    /// Every surface is shaded once: twice as fast, with edges as smooth.
    EachSurface,
}

/// The light that falls on each pixel, and the exact depth.
pub(crate) fn expose(
    input: &RenderInput,
    solids: Vec<Primitive>,
    cores: Cores,
    edges: Edges,
) -> Exposure {
    let (world, k) = (input.world, input.intrinsics);
    let folded = Folded::new(input, solids);
    let (width, height) = (k.width as usize, k.height as usize);
    let mut hits = vec![Hit::SKY; width * height];
    cores.split(&mut hits, width * TILE, |band, hits| {
        for (row, hits) in hits.chunks_mut(width).enumerate() {
            let v = band * TILE + row;
            for (u, hit) in hits.iter_mut().enumerate() {
                *hit = folded.trace((u, v), (u as f32, v as f32)).0;
            }
        }
    });
    let feet: Vec<Foot> = input.cars.iter().map(|car| Foot::of(world, car)).collect();
    let shaders = |share: f32, samples: f32| -> Vec<Shader> {
        let segments = folded.segments.iter();
        let shader = segments.map(|segment| Shader {
            eye: &segment.eye,
            light: input.light,
            air: input.air,
            pixel: share * segment.camera.pixel,
            samples,
            moving: &feet,
        });
        shader.collect()
    };
    // Each of the four rays of a pixel covers a part of it.
    let (whole, part) = (shaders(1.0, 3.0), shaders(0.6, 2.0));
    let mut colours = vec![Rgb::zeros(); width * height];
    cores.split(&mut colours, width, |v, row| {
        for (u, colour) in row.iter_mut().enumerate() {
            let hit = &hits[v * width + u];
            *colour = if !on_edge(&hits, width, height, u, v) {
                colour_of(&whole, hit, &folded.ray(hit, (u as f32, v as f32)))
            } else {
                // Four rays on a rotated grid; the depth stays that of the centre.
                let rays = [
                    (-0.125, -0.375),
                    (0.375, -0.125),
                    (0.125, 0.375),
                    (-0.375, 0.125),
                ]
                .map(|(du, dv)| folded.trace((u, v), (u as f32 + du, v as f32 + dv)));
                match edges {
                    Edges::EachRay => {
                        let sum: V3 = rays.iter().map(|(hit, d)| colour_of(&part, hit, d)).sum();
                        sum * 0.25
                    }
                    Edges::EachSurface => by_surface(&part, &rays),
                }
            };
        }
    });
    let depth = hits
        .iter()
        .map(|hit| if hit.t.is_finite() { hit.t } else { 0.0 });
    let is_moving = |hit: &Hit| match hit.surface {
        Surface::Solid(index, _) => {
            let solids = &folded.segments[usize::from(hit.segment)].eye.solids;
            solids[index as usize].primitive.moving
        }
        _ => false,
    };
    Exposure {
        depth: DepthMap {
            width,
            height,
            data: depth.collect(),
        },
        moving: hits.iter().map(is_moving).collect(),
        light: colours,
        hits,
        segments: folded.segments.iter().map(|s| s.world_from_cam).collect(),
    }
}

/// The colour of a hit, by the shader of its segment.
#[inline]
fn colour_of(shaders: &[Shader], hit: &Hit, d: &V3) -> Rgb {
    shaders[usize::from(hit.segment)].colour(hit, d)
}

/// The mean of the rays of one pixel. Each surface is shaded once, where the first ray hits it.
fn by_surface(shaders: &[Shader], rays: &[(Hit, V3); 4]) -> Rgb {
    let mut sum = Rgb::zeros();
    for (i, (hit, d)) in rays.iter().enumerate() {
        let same = |other: &&(Hit, V3)| other.0.is_like(hit);
        if !rays[..i].iter().any(|other| same(&other)) {
            let share = 0.25 * rays[i..].iter().filter(same).count() as f32;
            sum += colour_of(shaders, hit, d) * share;
        }
    }
    sum
}

/// Whether a pixel and one of its four neighbours see different surfaces.
#[inline]
fn on_edge(hits: &[Hit], width: usize, height: usize, u: usize, v: usize) -> bool {
    let here = hits[v * width + u];
    let differs = |other: &Hit| {
        !other.is_like(&here)
            // A solid can hide a part of itself, so a large step in depth also counts.
            || (here.t.is_finite() && (other.t - here.t).abs() > 0.2 * here.t.min(other.t)
                && matches!(here.surface, Surface::Solid(..)))
    };
    (u > 0 && differs(&hits[v * width + u - 1]))
        || (u + 1 < width && differs(&hits[v * width + u + 1]))
        || (v > 0 && differs(&hits[(v - 1) * width + u]))
        || (v + 1 < height && differs(&hits[(v + 1) * width + u]))
}

/// The rays of a pinhole camera, in world axes.
pub(crate) struct Camera {
    columns: [V3; 3],
    inverse: [f32; 4],
    /// Width of a pixel at depth 1.
    pixel: f32,
}

impl Camera {
    /// The rays of a camera at a pose.
    pub(crate) fn new(world_from_cam: &Se3, k: &Intrinsics) -> Self {
        let rotation = world_from_cam.rotation();
        let column = |i: usize| rotation.column(i).map(|x| x as f32).into_owned();
        Self {
            columns: [column(0), column(1), column(2)],
            inverse: [
                (1.0 / k.fx) as f32,
                (-k.cx / k.fx) as f32,
                (1.0 / k.fy) as f32,
                (-k.cy / k.fy) as f32,
            ],
            pixel: (1.0 / k.fx.min(k.fy)) as f32,
        }
    }

    /// The ray of a pixel, with camera z = 1, so that its parameter is the depth.
    #[inline]
    pub(crate) fn ray(&self, u: f32, v: f32) -> V3 {
        let x = u * self.inverse[0] + self.inverse[1];
        let y = v * self.inverse[2] + self.inverse[3];
        self.columns[0] * x + self.columns[1] * y + self.columns[2]
    }
}
