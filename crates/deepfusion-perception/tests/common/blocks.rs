//! A level road with boxes on it, seen by an exact camera.

use deepfusion_geometry::{DepthMap, Intrinsics};
use nalgebra::Vector3;

pub(crate) const SIZE: (usize, usize) = (640, 192);
pub(crate) const HEIGHT_M: f64 = 1.65;

pub(crate) fn camera() -> Intrinsics {
    Intrinsics::from_numbers([370.0, 370.0, 319.5, 80.0], (SIZE.0 as u32, SIZE.1 as u32))
}

/// A box on a level ground: (left, front), (right, back) and height, in metres.
pub(crate) type Block = ([f64; 2], [f64; 2], f64);

/// Two cars door to door with their fronts in line: a single wall in the depth image.
pub(crate) const CARS: [Block; 2] = [
    ([-2.6, 10.0], [-0.8, 14.2], 1.5),
    ([-0.8, 10.0], [1.0, 14.2], 1.5),
];

/// Depth of each pixel, and the block that it shows.
pub(crate) fn scene(blocks: &[Block]) -> (DepthMap, Vec<Option<usize>>) {
    let k = camera();
    let (width, height) = SIZE;
    let seen = |i: usize| {
        let ray = k.inverse_matrix() * Vector3::new((i % width) as f64, (i / width) as f64, 1.0);
        let ground = (ray.y > 1e-6)
            .then(|| HEIGHT_M / ray.y)
            .filter(|z| *z < 80.0);
        let hit = |(n, (low, high, tall)): (usize, &Block)| {
            // Where the ray enters and leaves between the planes of each axis.
            let slab = |from: f64, to: f64, along: f64| {
                let (a, b) = (from / along, to / along);
                (a.min(b), a.max(b))
            };
            let x = slab(low[0], high[0], ray.x);
            let y = slab(HEIGHT_M - tall, HEIGHT_M, ray.y);
            let enter = x.0.max(y.0).max(low[1]);
            (enter <= x.1.min(y.1).min(high[1])).then_some((enter, Some(n)))
        };
        let blocks = blocks.iter().enumerate().filter_map(hit);
        let all = blocks.chain(ground.map(|z| (z, None)));
        all.min_by(|a, b| a.0.total_cmp(&b.0))
            .unwrap_or((0.0, None))
    };
    let pixels: Vec<(f64, Option<usize>)> = (0..width * height).map(seen).collect();
    let depth = DepthMap {
        width,
        height,
        data: pixels.iter().map(|(z, _)| *z as f32).collect(),
    };
    (depth, pixels.into_iter().map(|(_, block)| block).collect())
}
