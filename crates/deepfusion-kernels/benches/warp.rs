//! The bilinear warp, forward and backward for image and coordinates: `cargo bench -p deepfusion-kernels --bench warp`.
//! `benches/peers/torch_warp.py` measures PyTorch for comparison.

use criterion::{Criterion, criterion_group, criterion_main};
use deepfusion_kernels::{WarpShape, warp, warp_backward_coords, warp_backward_image};

const BATCH: usize = 4;
const CHANNELS: usize = 3;
const HEIGHT: usize = 192;
const WIDTH: usize = 640;

/// Four RGB images of 640×192, sampled at coordinates as in view synthesis: smooth, a few pixels away, some beyond the border.
fn warp_640x192(criterion: &mut Criterion) {
    let area = HEIGHT * WIDTH;
    let shape = WarpShape {
        channels: CHANNELS,
        in_height: HEIGHT,
        in_width: WIDTH,
        out_area: area,
    };
    let value = |i: usize| (i as f32 * 0.37).sin();
    let image: Vec<f32> = (0..BATCH * CHANNELS * area).map(value).collect();
    let mut coords = Vec::with_capacity(BATCH * 2 * area);
    for n in 0..BATCH {
        let zoom = 1.02 + 0.01 * n as f32;
        let at = |p: usize| ((p % WIDTH) as f32, (p / WIDTH) as f32);
        coords.extend((0..area).map(|p| (at(p).0 - 320.0) * zoom + 320.3));
        coords.extend((0..area).map(|p| (at(p).1 - 96.0) * zoom + 96.2));
    }
    let gradient: Vec<f32> = (0..BATCH * CHANNELS * area).map(value).collect();
    let mut out = vec![0.0; image.len()];
    let mut image_gradient = vec![0.0; image.len()];
    let mut coords_gradient = vec![0.0; coords.len()];
    criterion.bench_function("warp forward + backward, 4x3x192x640, border", |b| {
        b.iter(|| {
            warp(&shape, &image, &coords, &mut out);
            warp_backward_image(&shape, &coords, &gradient, &mut image_gradient);
            warp_backward_coords(&shape, &image, &coords, &gradient, &mut coords_gradient);
        });
    });
    criterion.bench_function("warp forward, 4x3x192x640, border", |b| {
        b.iter(|| warp(&shape, &image, &coords, &mut out));
    });
}

// The macro creates a public function that cannot be documented.
#[allow(missing_docs)]
mod group {
    use super::{criterion_group, warp_640x192};
    criterion_group!(benches, warp_640x192);
}
use group::benches;
criterion_main!(benches);
