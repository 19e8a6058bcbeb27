//! The flow decoder in both directions, forward and backward: `cargo bench -p deepfusion-train --bench flow`.
//! `benches/peers/torch_flow.py` measures the same in PyTorch.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a benchmark that cannot run may panic"
)]

use burn::module::Module;
use burn::tensor::{Device, Distribution, Tensor};
use criterion::{Criterion, criterion_group};
use deepfusion_nn::{FlowDecoder, FlowDecoderConfig, ResNetConfig, ResNetDepth, WeightRng};

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

const BATCH: usize = 4;

/// The flow decoder on features of a ResNet-18; the backward pass computes the gradients of features and weights.
fn flow_decoder(criterion: &mut Criterion) {
    let device = Device::flex().autodiff();
    let channels = ResNetConfig::new(ResNetDepth::ResNet18).channels();
    let config = FlowDecoderConfig::default();
    let decoder = FlowDecoder::new(&config, channels, &mut WeightRng::new(0), &device)
        .expect("the default is valid");
    for (height, width) in [(96, 320), (192, 640)] {
        let [first, second] = [0, 1].map(|_| -> [Tensor<4>; 5] {
            std::array::from_fn(|k| {
                let size = [BATCH, channels[k], height >> (k + 1), width >> (k + 1)];
                Tensor::random(size, Distribution::Uniform(0.0, 1.0), &device).require_grad()
            })
        });
        let name = |what: &str| {
            format!("flow decoder {what}, both directions, {width}x{height}, batch {BATCH}")
        };
        let valid = decoder.valid();
        let [plain, other] = [&first, &second].map(|f| f.clone().map(Tensor::inner));
        criterion.bench_function(&name("forward"), |b| {
            b.iter(|| valid.forward_both(&plain, &other));
        });
        criterion.bench_function(&name("forward + backward"), |b| {
            b.iter(|| {
                let [there, back] = decoder.forward_both(&first, &second);
                (there.flow.mean() + back.flow.mean()).backward()
            });
        });
    }
}

// The macro makes a public function that cannot be documented.
#[allow(missing_docs)]
mod group {
    use super::{Criterion, criterion_group, flow_decoder};

    criterion_group! {
        name = flow;
        config = Criterion::default().sample_size(10);
        targets = flow_decoder
    }
}

/// Runs on one of rayon's threads, as the program does.
fn main() {
    rayon::scope(|_| group::flow());
    Criterion::default().configure_from_args().final_summary();
}
