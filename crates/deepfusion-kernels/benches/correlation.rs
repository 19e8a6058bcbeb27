//! Local correlation of radius 4, forward and both gradients, at the flow decoder's three sizes:
//! `cargo bench -p deepfusion-kernels --bench correlation`. `benches/peers/torch_correlation.py` measures PyTorch for comparison.

use criterion::{Criterion, criterion_group, criterion_main};
use deepfusion_kernels::{
    CorrelationShape, local_correlation, local_correlation_backward_first,
    local_correlation_backward_second,
};

/// Both directions of a batch of 4.
const BATCH: usize = 8;
const CHANNELS: usize = 32;

/// 1/4, 1/8 and 1/16 of 320×96, and 1/4 of 640×192.
const SIZES: [(usize, usize); 4] = [(24, 80), (12, 40), (6, 20), (48, 160)];

fn correlation(criterion: &mut Criterion) {
    for (height, width) in SIZES {
        let shape = CorrelationShape {
            channels: CHANNELS,
            height,
            width,
            radius: 4,
        };
        let area = height * width;
        let values = |count: usize| -> Vec<f32> {
            (0..count * area).map(|i| (i as f32 * 0.37).sin()).collect()
        };
        let (first, second) = (values(BATCH * CHANNELS), values(BATCH * CHANNELS));
        let grad = values(BATCH * shape.displacements());
        let (mut out, mut grad_first) = (grad.clone(), first.clone());
        let mut grad_second = first.clone();
        let size = format!("{BATCH}x{CHANNELS}x{height}x{width}");
        criterion.bench_function(&format!("correlation forward, {size}"), |b| {
            b.iter(|| local_correlation(&shape, &first, &second, &mut out));
        });
        criterion.bench_function(&format!("correlation forward + backward, {size}"), |b| {
            b.iter(|| {
                local_correlation(&shape, &first, &second, &mut out);
                local_correlation_backward_first(&shape, &second, &grad, &mut grad_first);
                local_correlation_backward_second(&shape, &first, &grad, &mut grad_second);
            });
        });
    }
}

// The macro creates a public function that cannot be documented.
#[allow(missing_docs)]
mod group {
    use super::{correlation, criterion_group};
    criterion_group!(benches, correlation);
}
use group::benches;
criterion_main!(benches);
