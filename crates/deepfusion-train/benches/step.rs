//! The training step and inference on random images: `cargo bench -p deepfusion-train`. The peer is
//! `benches/peers/torch_step.py`.

use burn::tensor::{Device, Distribution, Tensor};
use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use deepfusion_nn::{DepthNetConfig, ResNetDepth};

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn images(batch: usize, height: usize, width: usize, device: &Device) -> Tensor<4> {
    let shape = [batch, 3, height, width];
    Tensor::random(shape, Distribution::Uniform(0.0, 1.0), device)
}

/// Forward and backward of the ResNet-18 depth network at 320×96, batch 4 (no optimiser).
fn depth_net_step(criterion: &mut Criterion) {
    let device = Device::flex().autodiff();
    let net = DepthNetConfig::new(ResNetDepth::ResNet18)
        .init(&device)
        .expect("the preset is valid");
    criterion.bench_function(
        "depth net forward + backward, ResNet-18, 320x96, batch 4",
        |b| {
            b.iter_batched(
                || images(4, 96, 320, &device),
                |x| {
                    let outputs = net.forward(x).into_iter().map(Tensor::mean);
                    let loss = outputs.reduce(|a, b| a + b).expect("four scales");
                    loss.backward()
                },
                BatchSize::LargeInput,
            );
        },
    );
}

/// Inference of a ResNet's depth network at 640×192.
fn inference(criterion: &mut Criterion) {
    let device = Device::flex();
    for (name, depth) in [
        ("inference, ResNet-18, 640x192", ResNetDepth::ResNet18),
        ("inference, ResNet-50, 640x192", ResNetDepth::ResNet50),
    ] {
        let net = DepthNetConfig::new(depth)
            .init(&device)
            .expect("the preset is valid");
        let x = images(1, 192, 640, &device);
        criterion.bench_function(name, |b| {
            b.iter(|| net.forward(x.clone()).swap_remove(0).into_data());
        });
    }
}

// The macro makes a public function that cannot be documented.
#[allow(missing_docs)]
mod group {
    use super::{Criterion, criterion_group, depth_net_step, inference};

    criterion_group! {
        name = step;
        config = Criterion::default().sample_size(10);
        targets = depth_net_step, inference
    }
}
use group::step;
criterion_main!(step);
