//! Convolutions of the networks, forward and backward: `cargo bench -p deepfusion-kernels`. Throughput is in multiply-adds, each of which
//! is two floating-point operations.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use deepfusion_kernels::{
    ConvShape, Precision, conv2d, conv2d_backward_input, conv2d_backward_weight, has_bf16,
};

/// Layers of the ResNet-18 depth network at 320×96, both frames of a batch of 4.
fn shapes() -> Vec<(&'static str, ConvShape)> {
    let layer = |(c, o), (h, w), k, stride, reflect| ConvShape {
        batch: 8,
        in_channels: c,
        in_height: h,
        in_width: w,
        out_channels: o,
        kernel_height: k,
        kernel_width: k,
        stride,
        padding: k / 2,
        dilation: 1,
        reflect,
        precision: Precision::F32,
    };
    vec![
        ("conv1 7x7/2", layer((3, 64), (96, 320), 7, 2, false)),
        ("layer1 3x3", layer((64, 64), (24, 80), 3, 1, false)),
        ("layer2 3x3/2", layer((64, 128), (24, 80), 3, 2, false)),
        ("layer2 3x3", layer((128, 128), (12, 40), 3, 1, false)),
        ("layer3 3x3", layer((256, 256), (6, 20), 3, 1, false)),
        (
            "decoder 512-256 6x20",
            layer((512, 256), (6, 20), 3, 1, true),
        ),
        ("decoder 256-128", layer((256, 128), (12, 40), 3, 1, true)),
        ("layer4 3x3", layer((512, 512), (3, 10), 3, 1, false)),
        ("layer4 1x1/2", layer((256, 512), (6, 20), 1, 2, false)),
        ("decoder 512-256", layer((512, 256), (3, 10), 3, 1, true)),
        ("decoder 128-64", layer((128, 64), (12, 40), 3, 1, true)),
        ("decoder 96-32", layer((96, 32), (48, 160), 3, 1, true)),
        ("decoder 16-16", layer((16, 16), (96, 320), 3, 1, true)),
        ("head 16-1", layer((16, 1), (96, 320), 3, 1, true)),
        ("flow 32-2", layer((32, 2), (24, 80), 3, 1, false)),
    ]
}

/// Values that are neither zero nor denormal.
fn values(len: usize) -> Vec<f32> {
    (0..len).map(|i| (i as f32 * 0.37).sin()).collect()
}

fn conv(criterion: &mut Criterion) {
    for (name, shape) in shapes() {
        let mut group = criterion.benchmark_group(name);
        group.throughput(Throughput::Elements(shape.multiply_adds() as u64));
        let (x, weight) = (values(shape.in_len()), values(shape.weight_len()));
        let grad = values(shape.out_len());
        let mut out = vec![0.0; shape.out_len()];
        let (mut grad_x, mut grad_weight) = (x.clone(), weight.clone());
        for (precision, suffix) in [(Precision::F32, ""), (Precision::Bf16, " bf16")] {
            let pairs = |channels: usize| channels.is_multiple_of(16);
            let fits = pairs(shape.in_channels) && pairs(shape.out_channels) && has_bf16();
            if precision == Precision::Bf16 && !fits {
                continue;
            }
            let shape = ConvShape { precision, ..shape };
            let id = |pass: &str| BenchmarkId::from_parameter(format!("{pass}{suffix}"));
            group.bench_function(id("forward"), |b| {
                b.iter(|| conv2d(&shape, &x, &weight, None, &mut out));
            });
            group.bench_function(id("input gradient"), |b| {
                b.iter(|| conv2d_backward_input(&shape, &weight, &grad, &mut grad_x));
            });
            group.bench_function(id("weight gradient"), |b| {
                b.iter(|| conv2d_backward_weight(&shape, &x, &grad, &mut grad_weight));
            });
        }
    }
}

// The macro creates a public function that cannot be documented.
#[allow(missing_docs)]
mod group {
    use super::{Criterion, conv, criterion_group};
    use std::time::Duration;

    criterion_group! {
        name = layers;
        config = Criterion::default().sample_size(20).warm_up_time(Duration::from_millis(300))
            .measurement_time(Duration::from_millis(1500));
        targets = conv
    }
}
use group::layers;
criterion_main!(layers);
