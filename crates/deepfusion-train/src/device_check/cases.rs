//! The operations that networks and losses are made of, small enough for any device.

use burn::module::Module;
use burn::tensor::activation::sigmoid;
use burn::tensor::{Device, Gradients, Tensor};
use deepfusion_nn::ops::{self, ConvOptions};
use deepfusion_nn::{DepthNet, DepthNetConfig, LiteMonoSize, PoseNet, PoseNetConfig, ResNetDepth};

use super::NeededBy;
use super::inputs::{Outcome, fixed, gradient, noise, outcome, values};
use crate::losses::{DepthTruth, affine_invariant, depth};
use crate::{
    Adam, BilinearResize, DepthLossConfig, Model, Motion, NamedGradients, Preset, Schedule,
    SnippetBatch, TrainConfig,
};

/// One operation.
pub(super) struct Case {
    pub(super) operation: &'static str,
    pub(super) needed_by: NeededBy,
    pub(super) run: fn(&Device) -> Outcome,
}

/// Values about zero.
const SIGNED: (f32, f32) = (-1.0, 1.0);
/// Values of images.
const IMAGE: (f32, f32) = (0.0, 1.0);

/// All of them, the simple ones first.
pub(super) fn all() -> Vec<Case> {
    let case = |operation, needed_by, run| Case {
        operation,
        needed_by,
        run,
    };
    vec![
        case("convolution 3x3", NeededBy::Network, |d| {
            conv(
                3,
                ConvOptions {
                    padding: 1,
                    ..plain()
                },
                d,
            )
        }),
        case("convolution 3x3, mirrored border", NeededBy::Network, |d| {
            conv(
                3,
                ConvOptions {
                    padding: 1,
                    reflect: true,
                    ..plain()
                },
                d,
            )
        }),
        case("convolution 3x3 at stride 2", NeededBy::Network, |d| {
            conv(
                3,
                ConvOptions {
                    padding: 1,
                    stride: 2,
                    ..plain()
                },
                d,
            )
        }),
        case("convolution 3x3, dilated", NeededBy::Network, |d| {
            conv(
                3,
                ConvOptions {
                    padding: 2,
                    dilation: 2,
                    ..plain()
                },
                d,
            )
        }),
        case("convolution 7x7 at stride 2", NeededBy::Network, |d| {
            conv(
                7,
                ConvOptions {
                    padding: 3,
                    stride: 2,
                    ..plain()
                },
                d,
            )
        }),
        case("convolution 1x1", NeededBy::Network, |d| {
            conv(1, plain(), d)
        }),
        case("batch normalisation", NeededBy::Network, batch_norm),
        case("ELU", NeededBy::Network, |d| pointwise(ops::elu, d)),
        case("sigmoid", NeededBy::Network, |d| pointwise(sigmoid, d)),
        case(
            "enlarging, with a skip feature",
            NeededBy::Network,
            upsample_concat,
        ),
        case("depthwise convolution", NeededBy::LiteMono, depthwise),
        case("GELU", NeededBy::LiteMono, |d| pointwise(ops::gelu, d)),
        case("projection into another view", NeededBy::Views, project),
        case("warp", NeededBy::Views, warp),
        case("photometric error", NeededBy::Views, photometric),
        case("smoothness", NeededBy::Views, smoothness),
        case("bilinear resize", NeededBy::Views, resize),
        case("rigid motion", NeededBy::Views, motion),
        case("loss of known depth", NeededBy::Depth, known_depth),
        case("correlation", NeededBy::Flow, correlation),
        case("affine invariant loss", NeededBy::Affine, affine),
        case("depth network, ResNet-18", NeededBy::Network, |d| {
            let config = Preset::Tiny.config();
            depth_net(&config.depth_net, d)
        }),
        case("depth network, Lite-Mono", NeededBy::LiteMono, |d| {
            depth_net(&DepthNetConfig::lite_mono(LiteMonoSize::Tiny), d)
        }),
        case("depth network, R-MSFM3", NeededBy::RMsfm, |d| {
            depth_net(&DepthNetConfig::r_msfm(3), d)
        }),
        case("pose network", NeededBy::Learning, pose_net),
        case("optimiser", NeededBy::Learning, optimiser),
        case("losses of three steps", NeededBy::Views, |d| {
            steps(Preset::Tiny.config(), d)
        }),
        case("losses of three steps, optical flow", NeededBy::Flow, |d| {
            let mut config = Preset::Tiny.config();
            config.loss = config.loss.with_every_term();
            config.loss.affine = 0.0;
            steps(config, d)
        }),
    ]
}

fn plain() -> ConvOptions {
    ConvOptions::default()
}

fn conv(kernel: usize, options: ConvOptions, device: &Device) -> Outcome {
    let x = noise([2, 6, 12, 20], 1, SIGNED, device);
    let weight = noise([10, 6, kernel, kernel], 2, SIGNED, device);
    let bias = noise([10], 3, SIGNED, device);
    let result = ops::conv2d(x.clone(), weight.clone(), Some(bias.clone()), options);
    outcome(result, |raw| {
        vec![
            gradient(&x, raw),
            gradient(&weight, raw),
            gradient(&bias, raw),
        ]
    })
}

fn batch_norm(device: &Device) -> Outcome {
    let x = noise([2, 6, 12, 20], 4, SIGNED, device);
    let (gamma, beta) = (
        noise([6], 5, (0.5, 1.5), device),
        noise([6], 6, SIGNED, device),
    );
    let result = ops::batch_norm(x.clone(), gamma.clone(), beta.clone(), 1e-5, true);
    outcome(result.output, |raw| {
        vec![
            gradient(&x, raw),
            gradient(&gamma, raw),
            gradient(&beta, raw),
        ]
    })
}

fn pointwise(operation: fn(Tensor<4>) -> Tensor<4>, device: &Device) -> Outcome {
    let x = noise([2, 6, 12, 20], 7, (-3.0, 3.0), device);
    outcome(operation(x.clone()), |raw| vec![gradient(&x, raw)])
}

fn upsample_concat(device: &Device) -> Outcome {
    let x = noise([2, 6, 6, 10], 8, SIGNED, device);
    let skip = noise([2, 4, 12, 20], 9, SIGNED, device);
    let result = ops::upsample_concat(x.clone(), Some(skip.clone()));
    outcome(result, |raw| vec![gradient(&x, raw), gradient(&skip, raw)])
}

fn depthwise(device: &Device) -> Outcome {
    let x = noise([2, 6, 12, 20], 10, SIGNED, device);
    let weight = noise([6, 1, 3, 3], 11, SIGNED, device);
    let result = ops::depthwise(x.clone(), weight.clone(), 2);
    outcome(result, |raw| {
        vec![gradient(&x, raw), gradient(&weight, raw)]
    })
}

/// Coordinates that stay inside and away from whole pixels, where the derivative jumps.
fn coordinates(device: &Device) -> Tensor<4> {
    let shift = fixed([2, 2, 12, 20], 12, (0.1, 0.9), device);
    let [xs, ys] = [0, 1].map(|axis| {
        let length = [20, 12][axis] as f32;
        let place = |x: usize, y: usize| ([x, y][axis] as f32).clamp(1.0, length - 3.0);
        let rows = (0..12).flat_map(|y| (0..20).map(move |x| place(x, y)));
        Tensor::<1>::from_data(rows.collect::<Vec<f32>>().as_slice(), device)
            .reshape([1, 1, 12, 20])
    });
    let grid = Tensor::cat(vec![xs, ys], 1).expand([2, 2, 12, 20]);
    (grid + shift).detach().require_grad()
}

fn warp(device: &Device) -> Outcome {
    let (image, coords) = (
        noise([2, 3, 12, 20], 13, IMAGE, device),
        coordinates(device),
    );
    let result = ops::warp(image.clone(), coords.clone());
    outcome(result, |raw| {
        vec![gradient(&image, raw), gradient(&coords, raw)]
    })
}

fn project(device: &Device) -> Outcome {
    let inverse_depth = noise([2, 1, 12, 20], 14, (0.02, 0.5), device);
    let near_identity = Tensor::<3>::from_data(
        [[[1.0, 0.01, 0.5], [-0.01, 1.0, -0.3], [0.0005, 0.0002, 1.0]]],
        device,
    );
    let homography = near_identity.expand([2, 3, 3]).detach().require_grad();
    let shift = noise([2, 3], 15, (-0.5, 0.5), device);
    let result = ops::project(inverse_depth.clone(), homography.clone(), shift.clone());
    outcome(result, |raw| {
        vec![
            gradient(&inverse_depth, raw),
            gradient(&homography, raw),
            gradient(&shift, raw),
        ]
    })
}

fn photometric(device: &Device) -> Outcome {
    let image = noise([2, 3, 12, 20], 16, IMAGE, device);
    let target = fixed([2, 3, 12, 20], 17, IMAGE, device);
    let result = ops::photometric_error(image.clone(), target, 0.85);
    outcome(result, |raw| vec![gradient(&image, raw)])
}

fn smoothness(device: &Device) -> Outcome {
    let disparity = noise([2, 1, 12, 20], 18, (0.1, 0.9), device);
    let image = fixed([2, 3, 12, 20], 19, IMAGE, device);
    outcome(ops::smoothness(disparity.clone(), image), |raw| {
        vec![gradient(&disparity, raw)]
    })
}

fn resize(device: &Device) -> Outcome {
    let x = noise([2, 1, 6, 10], 20, SIGNED, device);
    let result = BilinearResize::new([6, 10], [24, 40], device).apply(x.clone());
    outcome(result, |raw| vec![gradient(&x, raw)])
}

fn motion(device: &Device) -> Outcome {
    let axis_angle = noise([4, 3], 21, (-0.1, 0.1), device);
    let translation = noise([4, 3], 22, SIGNED, device);
    let inverse = Motion::new(axis_angle.clone(), translation.clone()).inverse();
    let result = Tensor::cat(
        vec![
            inverse.rotation.reshape([36]),
            inverse.translation.reshape([12]),
        ],
        0,
    );
    outcome(result, |raw| {
        vec![gradient(&axis_angle, raw), gradient(&translation, raw)]
    })
}

fn known_depth(device: &Device) -> Outcome {
    let inverse_depths: Vec<_> = (0..4)
        .map(|scale| noise([2, 1, 24, 40], 23 + scale, (0.02, 0.5), device))
        .collect();
    let far = fixed([2, 1, 24, 40], 30, IMAGE, device)
        .greater_elem(0.8)
        .float();
    let truth = DepthTruth {
        log_depth: fixed([2, 1, 24, 40], 31, (0.5, 4.0), device),
        known: far.clone().neg().add_scalar(1.0),
        far,
    };
    let settings = DepthLossConfig {
        weight: 1.0,
        gradient: 0.5,
    };
    let found = depth(&inverse_depths, &truth, &settings);
    outcome(found.loss, |raw| {
        inverse_depths.iter().map(|x| gradient(x, raw)).collect()
    })
}

fn correlation(device: &Device) -> Outcome {
    let first = noise([2, 6, 12, 20], 32, SIGNED, device);
    let second = noise([2, 6, 12, 20], 33, SIGNED, device);
    let result = ops::local_correlation(first.clone(), second.clone(), 3);
    outcome(result, |raw| {
        vec![gradient(&first, raw), gradient(&second, raw)]
    })
}

fn affine(device: &Device) -> Outcome {
    let x = noise([2, 1, 12, 20], 34, (2.0, 40.0), device);
    let y = fixed([2, 1, 12, 20], 35, (2.0, 40.0), device);
    let valid = fixed([2, 1, 12, 20], 36, IMAGE, device).greater_elem(0.2);
    outcome(affine_invariant(x.clone(), y, &valid), |raw| {
        vec![gradient(&x, raw)]
    })
}

/// The gradients of all of a module's parameters, in the order of their names.
fn parameters<M: Module>(module: &M, raw: Gradients) -> Vec<f32> {
    let (mut raw, mut named, mut flat) = (raw, NamedGradients::default(), Vec::new());
    named.add("", module, &mut raw, 1.0);
    named.append_to(&mut flat);
    flat
}

/// A sum that all of a network's outputs are part of.
fn whole<const D: usize>(outputs: Vec<Tensor<D>>) -> Tensor<1> {
    let outputs = outputs.into_iter().map(|output| {
        let count = output.shape().num_elements();
        output.reshape([count])
    });
    Tensor::cat(outputs.collect(), 0)
}

#[expect(clippy::expect_used, reason = "the presets' networks can be built")]
fn depth_net(config: &DepthNetConfig, device: &Device) -> Outcome {
    let net = DepthNet::new(config, device).expect("a preset's network");
    let result = whole(net.forward(fixed([2, 3, 64, 96], 40, IMAGE, device)));
    let forward = values(result.clone());
    Outcome {
        forward,
        backward: parameters(&net, result.powi_scalar(2).mean().backward()),
    }
}

#[expect(clippy::expect_used, reason = "the presets' networks can be built")]
fn pose_net(device: &Device) -> Outcome {
    let net = PoseNet::new(&PoseNetConfig::new(ResNetDepth::ResNet18), device);
    let net = net.expect("a preset's network");
    let motion = net.forward(fixed([2, 6, 64, 96], 41, IMAGE, device));
    let result = whole(vec![
        motion.axis_angle.mul_scalar(100.0),
        motion.translation,
    ]);
    let forward = values(result.clone());
    Outcome {
        forward,
        backward: parameters(&net, result.powi_scalar(2).mean().backward()),
    }
}

/// The parameters of a network after two steps.
#[expect(
    clippy::expect_used,
    reason = "the presets' networks can be built, and the gradients are finite"
)]
fn optimiser(device: &Device) -> Outcome {
    let config = PoseNetConfig::new(ResNetDepth::ResNet18);
    let mut net = PoseNet::new(&config, device).expect("a preset's network");
    let mut adam = Adam::default();
    for seed in [42, 43] {
        let motion = net.forward(fixed([2, 6, 64, 96], seed, IMAGE, device));
        let loss = motion.translation.powi_scalar(2).mean();
        let (mut raw, mut gradients) = (loss.backward(), NamedGradients::default());
        gradients.add("", &net, &mut raw, 1.0);
        let (_, step) = adam.begin(&gradients, 1e-3, 1.0, 0.01);
        net = adam.apply(&step.expect("finite"), "", net, &gradients);
    }
    let moments = adam.state().tensors.into_values();
    Outcome {
        // Each tensor has its own size of moments; together the largest would hide the others.
        forward: moments
            .flat_map(|moment| {
                let largest = moment.values.iter().fold(1e-20_f32, |m, v| m.max(v.abs()));
                moment.values.into_iter().map(move |v| v / largest)
            })
            .collect(),
        backward: Vec::new(),
    }
}

/// Frames of a camera that drives 0.8 m ahead.
fn snippets(device: &Device) -> SnippetBatch {
    let (height, width) = (64, 96);
    let (fx, fy, cx, cy) = (58.0_f32, 60.0_f32, 47.5_f32, 31.5_f32);
    let matrix = |m: [[f32; 3]; 3]| Tensor::<3>::from_data([m], device).expand([2, 3, 3]);
    let ahead = Tensor::<2>::from_data([[0.0, 0.0, -0.8]], device).expand([2, 3]);
    // Smooth, so that a step of the views' sampling does not decide over the error.
    let frames = [50, 51].map(|seed| {
        let coarse = fixed([2, 3, 8, 12], seed, IMAGE, device);
        let resize = BilinearResize::new([8, 12], [height, width], device);
        resize.apply(coarse).detach()
    });
    SnippetBatch {
        clean: frames.to_vec(),
        network: frames.to_vec(),
        intrinsics: matrix([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]),
        inverse_intrinsics: matrix([
            [1.0 / fx, 0.0, -cx / fx],
            [0.0, 1.0 / fy, -cy / fy],
            [0.0, 0.0, 1.0],
        ]),
        distance_m: vec![Tensor::full([2], 0.8, device)],
        distance_weight: vec![None],
        measured: vec![Motion::new(Tensor::zeros([2, 3], device), ahead)],
        offsets: vec![1],
        names: vec![String::new(); 2],
        factors: None,
    }
}

/// Every term of the losses of three steps, each after the one before.
#[expect(
    clippy::expect_used,
    reason = "the presets' networks can be built, and the gradients are finite"
)]
fn steps(mut config: TrainConfig, device: &Device) -> Outcome {
    config.pose_net.metres_per_unit = 0.8;
    (config.size.width, config.size.height) = (96, 64);
    let mut model = Model::new(&config, device).expect("a preset's networks");
    let (batch, mut adam) = (snippets(device), Adam::default());
    let schedule = Schedule {
        speed_weight: config.loss.speed,
        masks_active: true,
    };
    let mut losses = Vec::new();
    for _ in 0..3 {
        let loss = model.loss(&model.forward(&batch), &batch, schedule);
        losses.extend(loss.terms.named().map(|(_, value)| value as f32));
        let (mut raw, mut gradients) = (loss.total.backward(), NamedGradients::default());
        gradients.add("depth", &model.depth_net, &mut raw, 1.0);
        gradients.add("pose", &model.pose_net, &mut raw, 1.0);
        if let Some(decoder) = &model.flow_decoder {
            gradients.add("flow", decoder, &mut raw, 1.0);
        }
        let (_, step) = adam.begin(&gradients, 1e-4, 10.0, 0.0);
        let step = step.expect("finite");
        let Model {
            depth_net,
            pose_net,
            flow_decoder,
            ..
        } = model.clone();
        model.depth_net = adam.apply(&step, "depth", depth_net, &gradients);
        model.pose_net = adam.apply(&step, "pose", pose_net, &gradients);
        model.flow_decoder =
            flow_decoder.map(|decoder| adam.apply(&step, "flow", decoder, &gradients));
    }
    Outcome {
        forward: losses,
        backward: Vec::new(),
    }
}
