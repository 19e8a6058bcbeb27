//! Where the time of a training step of the depth network goes: `cargo run --release --example profile`.
use burn::tensor::{Device, Distribution, Tensor};
use deepfusion_nn::{DepthNetConfig, ResNetDepth};
use std::time::Instant;

fn main() {
    let device = Device::flex().autodiff();
    let net = DepthNetConfig::new(ResNetDepth::ResNet18)
        .init(&device)
        .expect("a valid preset");
    for batch in [4usize, 8] {
        let mut times = Vec::new();
        for _ in 0..4 {
            let x = Tensor::<4>::random(
                [batch, 3, 96, 320],
                Distribution::Uniform(0.0, 1.0),
                &device,
            );
            let start = Instant::now();
            let out = net.forward(x);
            let forward = start.elapsed();
            let loss = out
                .into_iter()
                .map(|d| d.mean())
                .reduce(|a, b| a + b)
                .expect("four scales");
            let grads = loss.backward();
            times.push((forward.as_secs_f64(), start.elapsed().as_secs_f64()));
            drop(grads);
        }
        println!("batch {batch}: {times:.3?}");
    }
}
