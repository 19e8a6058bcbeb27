//! Convolutions of the networks on a GPU or, without a GPU feature, on the processor through Burn's tensors:
//! `cargo bench -p deepfusion-nn --features vulkan --bench convolution`. `benches/peers/torch_convolution.py` measures the same in PyTorch.
//!
//! Throughput is in multiply-adds: those of a forward pass; forward and backward together have three times as many.

#![allow(clippy::expect_used, reason = "a benchmark's panic is its message")]

use burn::tensor::{Device, Distribution, Tensor};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use deepfusion_nn::ops::{ConvOptions, Precision, conv2d, supports};
use std::time::Instant;

/// Passes that are queued before waiting for the device, so that launches do not limit the throughput.
const AT_ONCE: u64 = 20;

/// A layer: its name, channels in and out, height and width, kernel, stride, and whether its padding mirrors.
type Layer = (&'static str, [usize; 2], [usize; 2], usize, usize, bool);

/// Layers of the ResNet-18 depth network at 640×192, for both frames of four samples.
const LAYERS: [Layer; 8] = [
    ("layer1", [64, 64], [48, 160], 3, 1, false),
    ("layer2 3x3/2", [64, 128], [48, 160], 3, 2, false),
    ("layer2", [128, 128], [24, 80], 3, 1, false),
    ("layer3", [256, 256], [12, 40], 3, 1, false),
    ("layer4", [512, 512], [6, 20], 3, 1, false),
    ("decoder 512-256", [512, 256], [6, 20], 3, 1, true),
    ("decoder 96-32", [96, 32], [96, 320], 3, 1, true),
    ("decoder 16-16", [16, 16], [192, 640], 3, 1, true),
];
const IMAGES: usize = 8;

fn device() -> Device {
    #[cfg(feature = "vulkan")]
    return Device::vulkan(burn::tensor::DeviceKind::DefaultDevice);
    #[cfg(all(feature = "wgpu", not(feature = "vulkan")))]
    return Device::wgpu(burn::tensor::DeviceKind::DefaultDevice);
    #[cfg(all(feature = "cuda", not(any(feature = "vulkan", feature = "wgpu"))))]
    return Device::cuda(0);
    #[cfg(all(feature = "metal", not(any(feature = "vulkan", feature = "wgpu"))))]
    return Device::metal(burn::tensor::DeviceKind::DefaultDevice);
    #[cfg(not(any(
        feature = "vulkan",
        feature = "wgpu",
        feature = "cuda",
        feature = "metal"
    )))]
    Device::flex()
}

fn convolution(criterion: &mut Criterion) {
    let device = device();
    for (name, [channels, out_channels], [height, width], kernel, stride, reflect) in LAYERS {
        let mut group = criterion.benchmark_group(name);
        let random = |shape: [usize; 4], device: &Device| {
            Tensor::<4>::random(shape, Distribution::Uniform(-1.0, 1.0), device)
        };
        let shape = [IMAGES, channels, height, width];
        let weights = [out_channels, channels, kernel, kernel];
        let out = [
            IMAGES,
            out_channels,
            height.div_ceil(stride),
            width.div_ceil(stride),
        ];
        let multiply_adds = out.iter().product::<usize>() * channels * kernel * kernel;
        group.throughput(Throughput::Elements(multiply_adds as u64));
        let differentiable = device.clone().autodiff();
        let (x, w) = (random(shape, &device), random(weights, &device));
        let (leaf, leaf_w) = (
            random(shape, &differentiable).require_grad(),
            random(weights, &differentiable).require_grad(),
        );
        let weigh = random(out, &differentiable);
        for precision in [Precision::F32, Precision::Bf16] {
            if !supports(&device, precision) {
                continue;
            }
            let options = ConvOptions {
                stride,
                padding: kernel / 2,
                reflect,
                precision,
                ..ConvOptions::default()
            };
            let id = |pass: &str| BenchmarkId::from_parameter(format!("{pass} {precision:?}"));
            group.bench_function(id("forward"), |bencher| {
                bencher.iter_custom(|passes| {
                    timed(&device, passes, || {
                        drop(conv2d(x.clone(), w.clone(), None, options));
                    })
                });
            });
            group.bench_function(id("forward, backward"), |bencher| {
                bencher.iter_custom(|passes| {
                    timed(&device, passes, || {
                        let y = conv2d(leaf.clone(), leaf_w.clone(), None, options);
                        drop(y.mul(weigh.clone()).sum().backward());
                    })
                });
            });
        }
    }
}

/// How long `passes` take, until the device has finished.
fn timed(device: &Device, passes: u64, mut pass: impl FnMut()) -> std::time::Duration {
    let wait = || device.sync().expect("the device answers");
    wait();
    let begun = Instant::now();
    for done in 1..=passes {
        pass();
        if done % AT_ONCE == 0 {
            wait();
        }
    }
    wait();
    begun.elapsed()
}

// The macro makes a public function that cannot be documented.
#[allow(missing_docs)]
mod group {
    use super::{Criterion, convolution, criterion_group};
    use std::time::Duration;

    criterion_group! {
        name = benches;
        config = Criterion::default()
            .sample_size(10)
            .warm_up_time(Duration::from_millis(300))
            .measurement_time(Duration::from_millis(600));
        targets = convolution
    }
}
criterion_main!(group::benches);
