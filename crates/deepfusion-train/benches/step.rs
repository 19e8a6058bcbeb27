//! Training steps and inference on random images: `cargo bench -p deepfusion-train`. `benches/peers/torch_step.py` measures the same in
//! PyTorch; for the whole step, `torch_light_step.py` and `torch_full_step.py` beside it.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a benchmark that cannot run may panic"
)]

use burn::tensor::{Device, Distribution, Tensor};
use criterion::{BatchSize, Criterion, criterion_group};
use deepfusion_infer::{Engine, Precision};
use deepfusion_model::depth_graph;
use deepfusion_nn::ops::{self, Precision::Bf16};
use deepfusion_nn::{DepthNet, DepthNetConfig, ResNetDepth, weights};
use deepfusion_train::{
    Adam, Model, Motion, NamedGradients, Preset, Schedule, SnippetBatch, TrainConfig, ViewMotion,
};

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Adam's learning rate.
const LEARNING_RATE: f64 = 1e-4;
/// Norm to which longer gradients are clipped.
const CLIP_NORM: f64 = 10.0;

fn images(batch: usize, height: usize, width: usize, device: &Device) -> Tensor<4> {
    let shape = [batch, 3, height, width];
    Tensor::random(shape, Distribution::Uniform(0.0, 1.0), device)
}

fn depth_net(depth: ResNetDepth, device: &Device) -> DepthNet {
    let net = DepthNet::new(&DepthNetConfig::new(depth), device);
    net.expect("the preset is valid")
}

/// The sum of the four disparities' means.
fn loss_of(net: &DepthNet, x: Tensor<4>) -> Tensor<1> {
    let means = net.forward(x).into_iter().map(Tensor::mean);
    means.reduce(|a, b| a + b).expect("four scales")
}

/// Forward and backward of the ResNet-18 depth network at 320×96, batch 4 (no optimiser).
fn depth_net_gradients(criterion: &mut Criterion) {
    let device = Device::flex().autodiff();
    let net = depth_net(ResNetDepth::ResNet18, &device);
    criterion.bench_function(
        "depth net forward + backward, ResNet-18, 320x96, batch 4",
        |b| {
            b.iter_batched(
                || images(4, 96, 320, &device),
                |x| loss_of(&net, x).backward(),
                BatchSize::LargeInput,
            );
        },
    );
}

/// The same with an Adam step and gradient clipping, and once more with a ResNet-50 at 640×192, batch 2.
fn depth_net_step(criterion: &mut Criterion) {
    let device = Device::flex().autodiff();
    for (name, depth, (batch, height, width)) in [
        (
            "depth net forward + backward + Adam, ResNet-18, 320x96, batch 4",
            ResNetDepth::ResNet18,
            (4, 96, 320),
        ),
        (
            "depth net forward + backward + Adam, ResNet-50, 640x192, batch 2",
            ResNetDepth::ResNet50,
            (2, 192, 640),
        ),
    ] {
        let mut net = Some(depth_net(depth, &device));
        let mut adam = Adam::default();
        let x = images(batch, height, width, &device);
        criterion.bench_function(name, |b| {
            b.iter(|| {
                // Moved, as in the trainer: with the only copy, the optimiser updates the weights in place.
                let before = net.take().expect("given back by the step before");
                let mut raw = loss_of(&before, x.clone()).backward();
                let mut gradients = NamedGradients::default();
                gradients.add("depth", &before, &mut raw, 1.0);
                let (_, step) = adam.begin(&gradients, LEARNING_RATE, CLIP_NORM, 0.0);
                let step = step.expect("the gradient is finite");
                net = Some(adam.apply(&step, "depth", before, &gradients));
            });
        });
    }
}

/// A batch of random images whose cameras drive 0.8 m ahead, with KITTI's focal length.
fn snippets(batch: usize, height: usize, width: usize, device: &Device) -> SnippetBatch {
    let (w, h) = (width as f32, height as f32);
    let (fx, fy, cx, cy) = (0.58 * w, 1.92 * h, 0.5 * w, 0.5 * h);
    let k = [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]];
    let inverse = [[1.0 / fx, 0.0, -cx / fx], [0.0, 1.0 / fy, -cy / fy], k[2]];
    let matrices = |m: [[f32; 3]; 3]| {
        let one = Tensor::<3>::from_data([m], device);
        one.expand([batch, 3, 3])
    };
    let ahead = Tensor::<2>::from_data([[0.0, 0.0, -0.8]], device);
    let frames = [0, 1].map(|_| images(batch, height, width, device));
    SnippetBatch {
        factors: None,
        clean: frames.to_vec(),
        network: frames.to_vec(),
        intrinsics: matrices(k),
        inverse_intrinsics: matrices(inverse),
        distance_m: vec![Tensor::full([batch], 0.8, device)],
        distance_weight: vec![None],
        measured: vec![Motion::new(
            Tensor::zeros([batch, 3], device),
            ahead.expand([batch, 3]),
        )],
        turns_known: None,
        other_camera: None,
        offsets: vec![1],
        names: vec![String::new(); batch],
    }
}

/// A whole training step of the preset `light` at 320×96, batch 4: depth of both frames, motion, view synthesis, the preset's losses,
/// backward pass, Adam with gradient clipping. The batch is already loaded.
fn light_step(criterion: &mut Criterion) {
    let mut config = Preset::Light.config();
    training_step(criterion, "training step, preset light", config.clone());
    config.precision = Bf16;
    if ops::supports(&Device::flex(), Bf16) {
        training_step(criterion, "training step, preset light, bf16", config);
    }
}

/// The same with every loss: optical flow both ways, dynamic pixels, agreement, affine invariance.
fn full_step(criterion: &mut Criterion) {
    let mut config = Preset::Light.config();
    config.loss = config.loss.with_every_term();
    let name = "training step, preset light, every loss";
    training_step(criterion, name, config);
}

fn training_step(criterion: &mut Criterion, name: &str, mut config: TrainConfig) {
    let device = Device::flex().autodiff();
    config.pose_net.metres_per_unit = 0.8;
    // The gradient of view synthesis passes through PoseNet, as in PyTorch's steps.
    config.view_motion = ViewMotion::Distance;
    (config.size.width, config.size.height) = (320, 96);
    let mut model = Some(Model::new(&config, &device).expect("the preset is valid"));
    let mut adam = Adam::default();
    let batch = snippets(4, 96, 320, &device);
    let schedule = Schedule {
        speed_weight: config.loss.speed,
        masks_active: true,
    };
    criterion.bench_function(&format!("{name}, 320x96, batch 4"), |b| {
        b.iter(|| {
            let before = model.take().expect("given back by the step before");
            let loss = ops::autocast(config.precision, || {
                before.loss(&before.forward(&batch), &batch, schedule)
            });
            let mut gradients = NamedGradients::default();
            before.add_gradients(&loss.total, 1.0, &mut gradients);
            let (_, step) = adam.begin(&gradients, LEARNING_RATE, CLIP_NORM, 0.0);
            let step = step.expect("the gradient is finite");
            model = Some(before.updated(&mut adam, &step, &gradients));
            loss.terms.total
        });
    });
}

/// Inference of a ResNet depth network at 640×192: in Burn and in the fused engine.
fn inference(criterion: &mut Criterion) {
    let device = Device::flex();
    for (name, depth) in [
        ("ResNet-18", ResNetDepth::ResNet18),
        ("ResNet-50", ResNetDepth::ResNet50),
    ] {
        let net = depth_net(depth, &device);
        let x = images(1, 192, 640, &device);
        criterion.bench_function(&format!("inference, {name}, 640x192, burn"), |b| {
            b.iter(|| net.forward(x.clone()).swap_remove(0).into_data());
        });
        let image: Vec<f32> = x.into_data().iter::<f32>().collect();
        for (precision, word) in [(Precision::F32, "f32"), (Precision::Bf16, "bf16")] {
            if precision == Precision::Bf16 && !Engine::has_bf16() {
                continue;
            }
            let config = DepthNetConfig::new(depth);
            let graph = depth_graph(&config, weights::collect(&net)).expect("its own weights");
            let mut engine = Engine::new(graph, 640, 192, precision).expect("the size halves");
            let name = format!("inference, {name}, 640x192, fused {word}");
            criterion.bench_function(&name, |b| {
                b.iter(|| {
                    engine.run(&image);
                    engine.output(0)
                });
            });
        }
    }
}

// The macro makes a public function that cannot be documented.
#[allow(missing_docs)]
mod group {
    use super::{
        Criterion, criterion_group, depth_net_gradients, depth_net_step, full_step, inference,
        light_step,
    };

    criterion_group! {
        name = step;
        config = Criterion::default().sample_size(10);
        targets = depth_net_gradients, depth_net_step, light_step, full_step, inference
    }
}

/// Runs on one of rayon's threads, as the program does.
fn main() {
    rayon::scope(|_| group::step());
    Criterion::default().configure_from_args().final_summary();
}
