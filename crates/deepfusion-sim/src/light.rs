//! Shadows of the sun and of the sky on the ground, baked along the street.

use crate::primitive::{Primitive, Shape, V3, enter};
use crate::render::Cores;
use crate::road::StreetPoint;
use crate::scene::{ObjectClass, SceneObject, World};
use crate::texture::noise::length;
use nalgebra::Vector3;

/// Size of a cell along the street and across it, metres.
const CELL: f32 = 0.16;

/// Width of the baked strip on each side of the centreline, metres.
const REACH: f32 = 26.0;

/// Cells across.
const ACROSS: usize = (2.0 * REACH / CELL) as usize;

/// Longest shadow, metres.
const LONGEST: f32 = 26.0;

/// Rows of cells that are baked together.
const CHUNK: usize = 64;

/// The shares of sun and sky that are visible from each point of the street.
pub(crate) struct GroundLight {
    start: f32,
    rows: usize,
    /// Sun and sky, 0–255, row by row along the street.
    cells: Vec<[u8; 2]>,
    /// The same, averaged over blocks of 4 × 4.
    coarse: Vec<[u8; 2]>,
}

/// A solid that casts a shadow, prepared for baking.
struct Caster {
    primitive: Primitive,
    s: f32,
    /// How far along the street its shadow can reach.
    reach: f32,
    middle: (f64, f64),
    radius: f32,
    /// Greatest length of its shadow, metres.
    length: f32,
}

/// Footprint of an object that hides a part of the sky from the ground beside it.
pub(crate) struct Foot {
    middle: (f64, f64),
    heading: (f32, f32),
    half: [f32; 2],
    s: f32,
    depth: f32,
    range: f32,
}

impl GroundLight {
    /// Bakes the light of all static objects.
    pub(crate) fn bake(world: &World, cores: Cores) -> Self {
        let (start, end) = (world.road.start as f32, world.road.end() as f32);
        let rows = (((end - start) / CELL).ceil() as usize).next_multiple_of(CHUNK);
        let casters = casters(world);
        let feet: Vec<Foot> = world.objects.iter().map(|o| Foot::of(world, o)).collect();
        let mut cells = vec![[255u8; 2]; rows * ACROSS];
        cores.split(&mut cells, CHUNK * ACROSS, |chunk, cells| {
            let from = start + (chunk * CHUNK) as f32 * CELL;
            bake_chunk(world, &casters, &feet, from, cells);
        });
        let coarse = shrink(&cells, rows);
        Self {
            start,
            rows,
            cells,
            coarse,
        }
    }

    /// Shares of the sun and of the sky that reach a patch of ground of this size.
    #[inline]
    pub(crate) fn at(&self, p: &StreetPoint, size: f32) -> (f32, f32) {
        if p.lateral.abs() >= REACH - 1.0 {
            return (1.0, 1.0);
        }
        let fine = (1.0 - (size - 0.2) / 0.4).clamp(0.0, 1.0);
        let (u, v) = ((p.s - self.start) / CELL, (p.lateral + REACH) / CELL);
        let mut sum = [0.0f32; 2];
        if fine > 0.0 {
            let near = bilinear(&self.cells, ACROSS, self.rows, u - 0.5, v - 0.5);
            sum = near.map(|x| x * fine);
        }
        if fine < 1.0 {
            let far = bilinear(
                &self.coarse,
                ACROSS / 4,
                self.rows / 4,
                0.25 * u - 0.5,
                0.25 * v - 0.5,
            );
            sum[0] += far[0] * (1.0 - fine);
            sum[1] += far[1] * (1.0 - fine);
        }
        (sum[0] / 255.0, sum[1] / 255.0)
    }
}

#[inline]
fn bilinear(cells: &[[u8; 2]], width: usize, rows: usize, u: f32, v: f32) -> [f32; 2] {
    let u = u.clamp(0.0, rows as f32 - 1.001);
    let v = v.clamp(0.0, width as f32 - 1.001);
    let (row, column) = (u as usize, v as usize);
    let (fu, fv) = (u - row as f32, v - column as f32);
    let weights = [
        (1.0 - fu) * (1.0 - fv),
        (1.0 - fu) * fv,
        fu * (1.0 - fv),
        fu * fv,
    ];
    let first = row * width + column;
    let corners = [first, first + 1, first + width, first + width + 1];
    let mut sum = [0.0f32; 2];
    for (corner, weight) in corners.iter().zip(weights) {
        let [sun, sky] = cells[*corner];
        sum[0] += f32::from(sun) * weight;
        sum[1] += f32::from(sky) * weight;
    }
    sum
}

fn shrink(cells: &[[u8; 2]], rows: usize) -> Vec<[u8; 2]> {
    let width = ACROSS / 4;
    let mut coarse = Vec::with_capacity(rows / 4 * width);
    for row in 0..rows / 4 {
        for column in 0..width {
            coarse.push([0, 1].map(|k| {
                let sum: u32 = (0..16)
                    .map(|i| {
                        let cell = (4 * row + i / 4) * ACROSS + 4 * column + i % 4;
                        u32::from(cells[cell][k])
                    })
                    .sum();
                (sum / 16) as u8
            }));
        }
    }
    coarse
}

fn casters(world: &World) -> Vec<Caster> {
    if !world.rooms.is_empty() {
        // Rooms have no sun.
        return Vec::new();
    }
    let slope = world.sun.x.hypot(world.sun.y) / world.sun.z;
    world
        .primitives
        .iter()
        .zip(&world.along)
        .filter_map(|(primitive, s)| {
            let (half_x, half_y, _, top) = primitive.bounds(&world.hulls);
            let top = top + primitive.position[2] as f32;
            let radius = half_x.hypot(half_y);
            let p = world
                .road
                .locate(primitive.position[0], primitive.position[1]);
            let length = (top * slope).min(LONGEST);
            (p.lateral.abs() < REACH + length + radius).then(|| Caster {
                primitive: *primitive,
                s: *s,
                // Street coordinates are stretched on the inside of a bend.
                reach: 1.8 * (radius + length) + 2.0,
                middle: (primitive.position[0], primitive.position[1]),
                radius,
                length,
            })
        })
        .collect()
}

impl Foot {
    /// The footprint of an object.
    pub(crate) fn of(world: &World, object: &SceneObject) -> Self {
        let t = object.world_from_object.translation();
        let forward = object.world_from_object.rotate(&Vector3::x());
        let (depth, range, shrink) = match object.class {
            ObjectClass::Car => (0.85, 0.45, 1.0),
            ObjectClass::Building => (0.45, 1.6, 1.0),
            ObjectClass::Fence => (0.45, 0.6, 1.0),
            ObjectClass::Tree => (0.3, 1.2, 0.3),
            ObjectClass::Pole => (0.35, 0.25, 0.7),
            ObjectClass::Van | ObjectClass::Truck | ObjectClass::Tram => (0.85, 0.5, 1.0),
            ObjectClass::Cyclist | ObjectClass::Bicycle => (0.4, 0.3, 0.8),
            ObjectClass::Pedestrian => (0.45, 0.25, 0.7),
            ObjectClass::Misc => (0.5, 0.3, 0.9),
        };
        Self {
            middle: (t.x, t.y),
            heading: (forward.x as f32, forward.y as f32),
            half: [0, 1].map(|i| 0.5 * shrink * object.size[i] as f32),
            s: world.road.locate(t.x, t.y).s,
            depth,
            range,
        }
    }

    /// Share of the sky that is still visible from the ground at a place.
    #[inline]
    pub(crate) fn open_at(&self, x: f64, y: f64) -> f32 {
        let (dx, dy) = ((x - self.middle.0) as f32, (y - self.middle.1) as f32);
        let reach = self.half[0] + self.half[1] + 4.0 * self.range;
        if dx.abs() > reach || dy.abs() > reach {
            return 1.0;
        }
        let (c, s) = self.heading;
        let u = ((c * dx + s * dy).abs() - self.half[0]).max(0.0);
        let v = ((c * dy - s * dx).abs() - self.half[1]).max(0.0);
        let away = length(u, v);
        if away > 4.0 * self.range {
            return 1.0;
        }
        1.0 - self.depth * (-away / self.range).exp()
    }
}

fn bake_chunk(world: &World, casters: &[Caster], feet: &[Foot], from: f32, cells: &mut [[u8; 2]]) {
    let to = from + CHUNK as f32 * CELL;
    let rows: Vec<Row> = (0..CHUNK)
        .map(|row| {
            let s = from + (row as f32 + 0.5) * CELL;
            let (x, y, heading, _) = world.road.centre(f64::from(s));
            Row {
                x,
                y,
                across: (-heading.sin(), heading.cos()),
            }
        })
        .collect();
    let mut shaded = vec![false; cells.len()];
    let near = casters
        .iter()
        .filter(|c| c.s + c.reach > from && c.s - c.reach < to);
    for caster in near {
        for (row, shaded) in rows.iter().zip(shaded.chunks_mut(ACROSS)) {
            row.shade(world, caster, shaded);
        }
    }
    let mut sky = vec![1.0f32; cells.len()];
    for foot in feet {
        let reach = 1.8 * foot.half[0].hypot(foot.half[1]) + 8.0;
        if foot.s + reach <= from || foot.s - reach >= to {
            continue;
        }
        for (row, sky) in rows.iter().zip(sky.chunks_mut(ACROSS)) {
            row.close(foot, sky);
        }
    }
    for ((cell, shaded), sky) in cells.iter_mut().zip(shaded).zip(sky) {
        *cell = [if shaded { 0 } else { 255 }, (sky * 255.0) as u8];
    }
}

/// One row of cells across the street.
struct Row {
    x: f64,
    y: f64,
    across: (f64, f64),
}

impl Row {
    /// The middle of a cell.
    #[inline]
    fn place(&self, column: usize) -> (f64, f64) {
        let lateral = f64::from((column as f32 + 0.5) * CELL - REACH);
        (
            self.x + lateral * self.across.0,
            self.y + lateral * self.across.1,
        )
    }

    /// The cells whose lateral position is in all of these ranges, each given as [value, slope, least, most] with least ≤ value + slope ·
    /// lateral ≤ most.
    fn columns(&self, ranges: [[f64; 4]; 2]) -> std::ops::Range<usize> {
        let (mut low, mut high) = (-f64::from(REACH), f64::from(REACH));
        for [value, slope, least, most] in ranges {
            if slope.abs() < 1e-9 {
                if value < least || value > most {
                    return 0..0;
                }
                continue;
            }
            let (a, b) = ((least - value) / slope, (most - value) / slope);
            low = low.max(a.min(b));
            high = high.min(a.max(b));
        }
        if low > high {
            return 0..0;
        }
        // One more on each side, since an exact test follows.
        let column = |lateral: f64| (lateral + f64::from(REACH)) / f64::from(CELL);
        let first = (column(low) - 1.5).max(0.0) as usize;
        first..((column(high) + 1.5) as usize).min(ACROSS)
    }

    /// Marks the cells in the shadow of a caster.
    fn shade(&self, world: &World, caster: &Caster, shaded: &mut [bool]) {
        let sun = world.sun;
        let flat = sun.x.hypot(sun.y);
        let towards = (f64::from(sun.x / flat), f64::from(sun.y / flat));
        let (dx, dy) = (caster.middle.0 - self.x, caster.middle.1 - self.y);
        let (nx, ny) = self.across;
        let radius = f64::from(caster.radius) + 0.05;
        let columns = self.columns([
            [
                dx * towards.1 - dy * towards.0,
                ny * towards.0 - nx * towards.1,
                -radius,
                radius,
            ],
            [
                dx * towards.0 + dy * towards.1,
                -(nx * towards.0 + ny * towards.1),
                -radius,
                f64::from(caster.length) + radius + 0.5,
            ],
        ]);
        for column in columns {
            if shaded[column] {
                continue;
            }
            let (x, y) = self.place(column);
            // Skip unless the ray towards the sun passes over the caster's circle.
            let (dx, dy) = ((caster.middle.0 - x) as f32, (caster.middle.1 - y) as f32);
            let along = (dx * sun.x + dy * sun.y) / flat;
            let across = (dx * sun.y - dy * sun.x) / flat;
            if across.abs() > caster.radius
                || along < -caster.radius
                || along > LONGEST + caster.radius
            {
                continue;
            }
            let ground = Vector3::new(x, y, f64::from(world.road.kerb));
            let o = caster.primitive.local_point(&ground);
            // A ray from within the solid's footprint has no entry; the solid still shades it.
            let d = caster.primitive.local_of(&sun);
            shaded[column] = enter(&caster.primitive.shape, &world.hulls, &o, &d, 1e4).is_some()
                || inside_foot(&caster.primitive.shape, &o);
        }
    }

    /// Darkens the sky of the cells beside a footprint.
    fn close(&self, foot: &Foot, sky: &mut [f32]) {
        let reach = f64::from(foot.half[0] + foot.half[1] + 4.0 * foot.range);
        let (dx, dy) = (foot.middle.0 - self.x, foot.middle.1 - self.y);
        let columns = self.columns([
            [dx, -self.across.0, -reach, reach],
            [dy, -self.across.1, -reach, reach],
        ]);
        for column in columns {
            let (x, y) = self.place(column);
            sky[column] *= foot.open_at(x, y);
        }
    }
}

fn inside_foot(shape: &Shape, o: &V3) -> bool {
    match *shape {
        Shape::Box { half_x, half_y, .. } => o.x.abs() < half_x && o.y.abs() < half_y && o.z > -0.2,
        Shape::Cylinder { radius, .. } => o.x.hypot(o.y) < radius,
        _ => false,
    }
}
