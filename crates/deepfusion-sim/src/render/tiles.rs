//! The solids visible in each tile of the picture.

use super::FrameSolid;
use crate::primitive::Primitive;
use crate::scene::World;
use deepfusion_geometry::{Intrinsics, Se3};
use nalgebra::Vector3;

/// Side of a tile, in pixels.
pub(super) const TILE: usize = 8;

/// Nothing is drawn nearer than this depth, metres.
const NEAR: f64 = 0.2;

/// For each tile, the solids whose boxes overlap it, nearest first.
pub(super) struct Tiles {
    columns: usize,
    /// Start of each tile's list in `lists`.
    starts: Vec<u32>,
    lists: Vec<u32>,
}

impl Tiles {
    /// Projects every solid's box and sorts it into the tiles; also returns the visible solids.
    pub(super) fn bin(
        world: &World,
        solids: Vec<Primitive>,
        world_from_cam: &Se3,
        k: &Intrinsics,
    ) -> (Self, Vec<FrameSolid>) {
        let cam_from_world = world_from_cam.inverse();
        let eye = world_from_cam.translation();
        let mut seen: Vec<(FrameSolid, [usize; 4])> = solids
            .into_iter()
            .filter_map(|primitive| {
                let (window, nearest) = window(world, &primitive, &cam_from_world, k)?;
                let eye = primitive.local_point(&eye);
                let solid = FrameSolid {
                    primitive,
                    eye,
                    nearest,
                };
                Some((solid, window))
            })
            .collect();
        seen.sort_by(|a, b| a.0.nearest.total_cmp(&b.0.nearest));
        let columns = (k.width as usize).div_ceil(TILE);
        let rows = (k.height as usize).div_ceil(TILE);
        // Counting sort by tile keeps the order by distance.
        let mut starts = vec![0u32; columns * rows + 1];
        let each = |[x0, x1, y0, y1]: [usize; 4]| {
            (y0 / TILE..=y1 / TILE)
                .flat_map(move |y| (x0 / TILE..=x1 / TILE).map(move |x| y * columns + x))
        };
        for (_, window) in &seen {
            for tile in each(*window) {
                starts[tile + 1] += 1;
            }
        }
        for tile in 1..starts.len() {
            starts[tile] += starts[tile - 1];
        }
        let mut fill = starts.clone();
        let mut lists = vec![0u32; starts[columns * rows] as usize];
        for (index, (_, window)) in seen.iter().enumerate() {
            for tile in each(*window) {
                lists[fill[tile] as usize] = index as u32;
                fill[tile] += 1;
            }
        }
        let tiles = Self {
            columns,
            starts,
            lists,
        };
        (tiles, seen.into_iter().map(|s| s.0).collect())
    }

    /// The candidates for a pixel.
    #[inline]
    pub(super) fn at(&self, u: usize, v: usize) -> &[u32] {
        let tile = v / TILE * self.columns + u / TILE;
        &self.lists[self.starts[tile] as usize..self.starts[tile + 1] as usize]
    }
}

/// The window of pixels (x0, x1, y0, y1, inclusive) that a solid's box covers, and its least depth.
fn window(
    world: &World,
    primitive: &Primitive,
    cam_from_world: &Se3,
    k: &Intrinsics,
) -> Option<([usize; 4], f32)> {
    let (half_x, half_y, low, high) = primitive.bounds(&world.hulls);
    let [px, py, pz] = primitive.position;
    let middle = cam_from_world.transform(&Vector3::new(px, py, pz));
    let radius = f64::from(half_x.hypot(half_y).hypot(high.max(-low)));
    if middle.z < -radius {
        return None;
    }
    let (c, s) = (
        f64::from(primitive.heading.0),
        f64::from(primitive.heading.1),
    );
    let corners: [Vector3<f64>; 8] = std::array::from_fn(|i| {
        let x = f64::from(if i & 1 == 0 { -half_x } else { half_x });
        let y = f64::from(if i & 2 == 0 { -half_y } else { half_y });
        let z = f64::from(if i & 4 == 0 { low } else { high });
        cam_from_world.transform(&Vector3::new(
            px + c * x - s * y,
            py + s * x + c * y,
            pz + z,
        ))
    });
    let nearest = corners.iter().map(|p| p.z).fold(f64::MAX, f64::min);
    let farthest = corners.iter().map(|p| p.z).fold(f64::MIN, f64::max);
    if farthest < NEAR {
        return None;
    }
    let mut bounds = [f64::MAX, f64::MIN, f64::MAX, f64::MIN];
    let mut cover = |p: &Vector3<f64>| {
        let (u, v) = (k.fx * p.x / p.z + k.cx, k.fy * p.y / p.z + k.cy);
        bounds = [
            bounds[0].min(u),
            bounds[1].max(u),
            bounds[2].min(v),
            bounds[3].max(v),
        ];
    };
    for (i, a) in corners.iter().enumerate() {
        if a.z >= NEAR {
            cover(a);
        }
        // Edges connect corners that differ in one bit; an edge through the near plane is cut there.
        for bit in [1, 2, 4] {
            let b = &corners[i ^ bit];
            if a.z < NEAR && b.z >= NEAR {
                cover(&a.lerp(b, (NEAR - a.z) / (b.z - a.z)));
            }
        }
    }
    // The subsamples of a pixel reach half a pixel to each side.
    let (last_x, last_y) = (f64::from(k.width) - 1.0, f64::from(k.height) - 1.0);
    if bounds[1] < -1.0 || bounds[0] > last_x + 1.0 || bounds[3] < -1.0 || bounds[2] > last_y + 1.0
    {
        return None;
    }
    let clamp = |value: f64, last: f64| value.clamp(0.0, last) as usize;
    let window = [
        clamp(bounds[0] - 1.0, last_x),
        clamp(bounds[1] + 1.0, last_x),
        clamp(bounds[2] - 1.0, last_y),
        clamp(bounds[3] + 1.0, last_y),
    ];
    // Slightly less than the depth of the corner, which is rounded.
    Some((window, nearest.max(0.0) as f32 * 0.999))
}
