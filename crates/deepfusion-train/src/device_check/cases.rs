//! The operations that networks and losses are made of, small enough for any device.

use burn::module::{Module, Param};
use burn::tensor::{Gradients, Tensor};
use deepfusion_nn::ops::{self, ConvOptions, Precision};
use deepfusion_nn::{
    DepthNet, DepthNetConfig, DispNetConfig, LiteMonoSize, PoseNet, PoseNetConfig, ResNetDepth,
};

use super::NeededBy;
use super::inputs::{Inputs, Outcome, gradient, outcome, values};
use crate::losses::{DepthTruth, affine_invariant, depth};
use crate::{
    Adam, BilinearResize, DepthLossConfig, Model, Motion, NamedGradients, Preset, Schedule,
    SnippetBatch, TrainConfig, ViewMotion,
};

/// One operation.
pub(super) struct Case {
    pub(super) operation: &'static str,
    pub(super) needed_by: NeededBy,
    pub(super) run: fn(&Inputs) -> Outcome,
}

/// Range of values around zero.
const SIGNED: (f32, f32) = (-1.0, 1.0);
/// Range of an image's values.
const IMAGE: (f32, f32) = (0.0, 1.0);

/// Batch norms with frozen statistics. Batch statistics of the dozen values that remain of a small image would carry a single rounding
/// error through the whole network. They are compared in a case of their own, and in the depth networks.
const STEADY: bool = true;

/// All cases, the simple ones first.
pub(super) fn all() -> Vec<Case> {
    let case = |operation, needed_by, run| Case {
        operation,
        needed_by,
        run,
    };
    vec![
        case("convolution 3x3", NeededBy::Network, |on| {
            conv(3, padded(1), on)
        }),
        case(
            "convolution 3x3, mirrored border",
            NeededBy::Network,
            |on| {
                conv(
                    3,
                    ConvOptions {
                        reflect: true,
                        ..padded(1)
                    },
                    on,
                )
            },
        ),
        case("convolution 3x3 at stride 2", NeededBy::Network, |on| {
            conv(
                3,
                ConvOptions {
                    stride: 2,
                    ..padded(1)
                },
                on,
            )
        }),
        case("convolution 3x3, dilated", NeededBy::Network, |on| {
            conv(
                3,
                ConvOptions {
                    dilation: 2,
                    ..padded(2)
                },
                on,
            )
        }),
        case("convolution 7x7 at stride 2", NeededBy::Network, |on| {
            conv(
                7,
                ConvOptions {
                    stride: 2,
                    ..padded(3)
                },
                on,
            )
        }),
        case("convolution 1x1", NeededBy::Network, |on| {
            conv(1, padded(0), on)
        }),
        case(
            "convolution 3x3 of a larger image",
            NeededBy::Network,
            larger_conv,
        ),
        case("batch normalisation", NeededBy::Network, batch_norm),
        case("ELU", NeededBy::Network, |on| pointwise(ops::elu, on)),
        case("sigmoid", NeededBy::Network, |on| {
            pointwise(ops::sigmoid, on)
        }),
        case("maximum 3x3 at stride 2", NeededBy::Network, |on| {
            pointwise(ops::max_pool_3x3_stride_2, on)
        }),
        case("end of a residual block", NeededBy::Network, |on| {
            pointwise(|x| ops::add_relu(x.clone().neg(), x.mul_scalar(3.0)), on)
        }),
        case(
            "enlarging, with a skip feature",
            NeededBy::Network,
            upsample_concat,
        ),
        case("depthwise convolution", NeededBy::LiteMono, depthwise),
        case("GELU", NeededBy::LiteMono, |on| pointwise(ops::gelu, on)),
        case("projection into another view", NeededBy::Views, project),
        case("warp", NeededBy::Views, warp),
        case("photometric error", NeededBy::Views, photometric),
        case("smoothness", NeededBy::Views, smoothness),
        case("bilinear resize", NeededBy::Views, resize),
        case("rigid motion", NeededBy::Views, motion),
        case("loss of known depth", NeededBy::Depth, known_depth),
        case("correlation", NeededBy::Flow, correlation),
        case("affine invariant loss", NeededBy::Affine, affine),
        case("depth network, ResNet-18", NeededBy::Network, |on| {
            let config = Preset::Tiny.config();
            depth_net(&config.depth_net, on)
        }),
        case("depth network, Lite-Mono", NeededBy::LiteMono, |on| {
            depth_net(&DepthNetConfig::lite_mono(LiteMonoSize::Tiny), on)
        }),
        case("depth network, R-MSFM3", NeededBy::RMsfm, |on| {
            depth_net(&DepthNetConfig::r_msfm(3), on)
        }),
        case("depth network, DispNet", NeededBy::DispNet, |on| {
            let mut config = DepthNetConfig::disp_net();
            config.disp_net = Some(DispNetConfig { base_width: 8 });
            depth_net(&config, on)
        }),
        case("pose network", NeededBy::Learning, pose_net),
        case(
            "convolution 3x3 in mixed precision",
            NeededBy::MixedPrecision,
            conv_in_bf16,
        ),
        case("optimiser", NeededBy::Learning, optimiser),
        case("losses of three steps", NeededBy::Views, |on| {
            steps(with_pose_net(Preset::Tiny.config()), on)
        }),
        case(
            "losses of three steps, optical flow",
            NeededBy::Flow,
            |on| {
                let mut config = Preset::Tiny.config();
                config.loss = config.loss.with_every_term();
                config.loss.affine = 0.0;
                steps(with_pose_net(config), on)
            },
        ),
    ]
}

/// The gradient of view synthesis passes through PoseNet, too.
fn with_pose_net(config: TrainConfig) -> TrainConfig {
    TrainConfig {
        view_motion: ViewMotion::Distance,
        ..config
    }
}

fn padded(padding: usize) -> ConvOptions {
    ConvOptions {
        padding,
        ..ConvOptions::default()
    }
}

fn conv(kernel: usize, options: ConvOptions, on: &Inputs) -> Outcome {
    let x = on.noise([2, 6, 12, 20], 1, SIGNED);
    let weight = on.noise([10, 6, kernel, kernel], 2, SIGNED);
    let bias = on.noise([10], 3, SIGNED);
    let result = ops::conv2d(x.clone(), weight.clone(), Some(bias.clone()), options);
    outcome(result, |raw| {
        vec![
            gradient(&x, raw),
            gradient(&weight, raw),
            gradient(&bias, raw),
        ]
    })
}

/// 40,960 pixels: above 32,768, Burn's gradient of the weights was wrong in WGSL on lavapipe.
fn larger_conv(on: &Inputs) -> Outcome {
    let x = on.noise([1, 4, 128, 320], 60, SIGNED);
    let weight = on.noise([8, 4, 3, 3], 61, SIGNED);
    let result = ops::conv2d(x.clone(), weight.clone(), None, padded(1));
    outcome(result, |raw| {
        vec![gradient(&x, raw), gradient(&weight, raw)]
    })
}

/// Numbers that bf16 represents exactly, so that only the computation after rounding can differ. Many channels, as tensor cores require.
fn conv_in_bf16(on: &Inputs) -> Outcome {
    let steps = |tensor: Tensor<4>| tensor.mul_scalar(128.0).round().div_scalar(128.0);
    let x = steps(on.fixed([1, 80, 24, 40], 62, SIGNED)).require_grad();
    let weight = steps(on.fixed([64, 80, 3, 3], 63, SIGNED)).require_grad();
    let result = ops::autocast(Precision::Bf16, || {
        ops::conv2d(x.clone(), weight.clone(), None, padded(1))
    });
    let weights = steps(on.fixed([1, 64, 24, 40], 64, SIGNED));
    let raw = (result.clone() * weights).sum().backward();
    Outcome {
        forward: vec![values(result)],
        backward: vec![gradient(&x, &raw), gradient(&weight, &raw)],
    }
}

fn batch_norm(on: &Inputs) -> Outcome {
    let x = on.noise([2, 6, 12, 20], 4, SIGNED);
    let (gamma, beta) = (on.noise([6], 5, (0.5, 1.5)), on.noise([6], 6, SIGNED));
    let result = ops::batch_norm(x.clone(), gamma.clone(), beta.clone(), 1e-5, true);
    outcome(result.output, |raw| {
        vec![
            gradient(&x, raw),
            gradient(&gamma, raw),
            gradient(&beta, raw),
        ]
    })
}

fn pointwise(operation: fn(Tensor<4>) -> Tensor<4>, on: &Inputs) -> Outcome {
    let x = on.noise([2, 6, 12, 20], 7, (-3.0, 3.0));
    outcome(operation(x.clone()), |raw| vec![gradient(&x, raw)])
}

fn upsample_concat(on: &Inputs) -> Outcome {
    let x = on.noise([2, 6, 6, 10], 8, SIGNED);
    let skip = on.noise([2, 4, 12, 20], 9, SIGNED);
    let result = ops::upsample_concat(x.clone(), Some(skip.clone()));
    outcome(result, |raw| vec![gradient(&x, raw), gradient(&skip, raw)])
}

fn depthwise(on: &Inputs) -> Outcome {
    let x = on.noise([2, 6, 12, 20], 10, SIGNED);
    let weight = on.noise([6, 1, 3, 3], 11, SIGNED);
    let result = ops::depthwise(x.clone(), weight.clone(), 2);
    outcome(result, |raw| {
        vec![gradient(&x, raw), gradient(&weight, raw)]
    })
}

/// Coordinates that stay inside and away from whole pixels, where the derivative jumps.
fn coordinates(on: &Inputs) -> Tensor<4> {
    let shift = on.fixed([2, 2, 12, 20], 12, (0.1, 0.9));
    let [xs, ys] = [0, 1].map(|axis| {
        let length = [20, 12][axis] as f32;
        let place = |x: usize, y: usize| ([x, y][axis] as f32).clamp(1.0, length - 3.0);
        let rows = (0..12).flat_map(|y| (0..20).map(move |x| place(x, y)));
        Tensor::<1>::from_data(rows.collect::<Vec<f32>>().as_slice(), &on.device)
            .reshape([1, 1, 12, 20])
    });
    let grid = Tensor::cat(vec![xs, ys], 1).expand([2, 2, 12, 20]);
    (grid + shift).detach().require_grad()
}

fn warp(on: &Inputs) -> Outcome {
    let (image, coords) = (on.noise([2, 3, 12, 20], 13, IMAGE), coordinates(on));
    let result = ops::warp(image.clone(), coords.clone());
    outcome(result, |raw| {
        vec![gradient(&image, raw), gradient(&coords, raw)]
    })
}

fn project(on: &Inputs) -> Outcome {
    let metric_disparity = on.noise([2, 1, 12, 20], 14, (0.02, 0.5));
    let near_identity = Tensor::<3>::from_data(
        [[[1.0, 0.01, 0.5], [-0.01, 1.0, -0.3], [0.0005, 0.0002, 1.0]]],
        &on.device,
    );
    let homography = near_identity.expand([2, 3, 3]).detach().require_grad();
    let shift = on.noise([2, 3], 15, (-0.5, 0.5));
    let result = ops::project(metric_disparity.clone(), homography.clone(), shift.clone());
    outcome(result, |raw| {
        vec![
            gradient(&metric_disparity, raw),
            gradient(&homography, raw),
            gradient(&shift, raw),
        ]
    })
}

fn photometric(on: &Inputs) -> Outcome {
    let image = on.noise([2, 3, 12, 20], 16, IMAGE);
    let target = on.fixed([2, 3, 12, 20], 17, IMAGE);
    let result = ops::photometric_error(image.clone(), target, 0.85);
    outcome(result, |raw| vec![gradient(&image, raw)])
}

fn smoothness(on: &Inputs) -> Outcome {
    let disparity = on.noise([2, 1, 12, 20], 18, (0.1, 0.9));
    let image = on.fixed([2, 3, 12, 20], 19, IMAGE);
    outcome(ops::smoothness(disparity.clone(), image), |raw| {
        vec![gradient(&disparity, raw)]
    })
}

fn resize(on: &Inputs) -> Outcome {
    let x = on.noise([2, 1, 6, 10], 20, SIGNED);
    let result = BilinearResize::new([6, 10], [24, 40], &on.device).apply(x.clone());
    outcome(result, |raw| vec![gradient(&x, raw)])
}

fn motion(on: &Inputs) -> Outcome {
    let axis_angle = on.noise([4, 3], 21, (-0.1, 0.1));
    let translation = on.noise([4, 3], 22, SIGNED);
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

fn known_depth(on: &Inputs) -> Outcome {
    let metric_disparities: Vec<_> = (0..4)
        .map(|scale| on.noise([2, 1, 24, 40], 23 + scale, (0.02, 0.5)))
        .collect();
    let far = on
        .fixed([2, 1, 24, 40], 30, IMAGE)
        .greater_elem(0.8)
        .float();
    let truth = DepthTruth {
        log_depth: on.fixed([2, 1, 24, 40], 31, (0.5, 4.0)),
        known: far.clone().neg().add_scalar(1.0),
        far,
    };
    let settings = DepthLossConfig {
        weight: 1.0,
        gradient: 0.5,
    };
    let found = depth(&metric_disparities, &truth, &settings);
    outcome(found.loss, |raw| {
        metric_disparities
            .iter()
            .map(|x| gradient(x, raw))
            .collect()
    })
}

fn correlation(on: &Inputs) -> Outcome {
    let first = on.noise([2, 6, 12, 20], 32, SIGNED);
    let second = on.noise([2, 6, 12, 20], 33, SIGNED);
    let result = ops::local_correlation(first.clone(), second.clone(), 3);
    outcome(result, |raw| {
        vec![gradient(&first, raw), gradient(&second, raw)]
    })
}

fn affine(on: &Inputs) -> Outcome {
    let x = on.noise([2, 1, 12, 20], 34, (2.0, 40.0));
    let y = on.fixed([2, 1, 12, 20], 35, (2.0, 40.0));
    let valid = on.fixed([2, 1, 12, 20], 36, IMAGE).greater_elem(0.2);
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

/// All of a network's outputs in one tensor.
fn concatenated<const D: usize>(outputs: Vec<Tensor<D>>) -> Tensor<1> {
    let outputs = outputs.into_iter().map(|output| {
        let count = output.shape().num_elements();
        output.reshape([count])
    });
    Tensor::cat(outputs.collect(), 0)
}

#[expect(clippy::expect_used, reason = "the presets' networks can be built")]
fn depth_net(config: &DepthNetConfig, on: &Inputs) -> Outcome {
    let net = DepthNet::new(config, &on.device).expect("a preset's network");
    let result = concatenated(net.forward(on.fixed([2, 3, 64, 96], 40, IMAGE)));
    let forward = vec![values(result.clone())];
    Outcome {
        forward,
        // A single part, since the gradient of a bias before a batch norm is nothing but rounding errors.
        backward: vec![parameters(&net, result.powi_scalar(2).mean().backward())],
    }
}

#[expect(clippy::expect_used, reason = "the presets' networks can be built")]
fn pose_net(on: &Inputs) -> Outcome {
    let mut config = PoseNetConfig::new(ResNetDepth::ResNet18);
    config.encoder.frozen_statistics = STEADY;
    let net = PoseNet::new(&config, &on.device);
    let net = net.expect("a preset's network");
    let motion = net.forward(on.fixed([2, 6, 64, 96], 41, IMAGE));
    let result = concatenated(vec![
        motion.axis_angle.mul_scalar(100.0),
        motion.translation,
    ]);
    let forward = vec![values(result.clone())];
    Outcome {
        forward,
        // A single part, since the gradient of a bias before a batch norm is nothing but rounding errors.
        backward: vec![parameters(&net, result.powi_scalar(2).mean().backward())],
    }
}

/// A parameter and its moments after three steps. Each gradient is independent of the step before: in a network, gradients near zero would
/// dominate, since Adam divides them by their own rounding errors. A fourth step among them has a loss that is not finite; the device
/// itself must decide that it changes nothing.
fn optimiser(on: &Inputs) -> Outcome {
    let mut parameter = Param::from_tensor(on.fixed::<2>([12, 20], 42, SIGNED));
    let mut adam = Adam::default();
    for (seed, of_loss) in [(43, 1.0_f32), (44, f32::NAN), (44, 1.0), (45, 1.0)] {
        let loss = (parameter.val() * on.fixed([12, 20], seed, SIGNED)).sum();
        let (mut raw, mut gradients) = (loss.backward(), NamedGradients::on_device());
        gradients.add("parameter", &parameter, &mut raw, 1.0);
        let loss = loss.detach().inner();
        let squares = gradients.squares().1;
        let squares = squares.unwrap_or_else(|| loss.zeros_like());
        let checked = (loss.mul_scalar(of_loss), squares);
        let (_, step) = adam.begin_on_device(checked, 1e-2, 1.0, 0.01);
        parameter = adam.apply(&step, "parameter", parameter, &gradients);
    }
    let moments = adam.state().tensors.into_values();
    let mut forward = vec![values(parameter.val())];
    forward.extend(moments.map(|moment| moment.values));
    Outcome {
        forward,
        backward: Vec::new(),
    }
}

/// Frames of a camera that drives 0.8 m ahead.
fn snippets(on: &Inputs) -> SnippetBatch {
    let (height, width) = (64, 96);
    let (fx, fy, cx, cy) = (58.0_f32, 60.0_f32, 47.5_f32, 31.5_f32);
    let matrix = |m: [[f32; 3]; 3]| Tensor::<3>::from_data([m], &on.device).expand([2, 3, 3]);
    let ahead = Tensor::<2>::from_data([[0.0, 0.0, -0.8]], &on.device).expand([2, 3]);
    // Smooth images, so that the error does not depend on which pixel the view synthesis samples.
    let frames = [50, 51].map(|seed| {
        let coarse = on.fixed([2, 3, 8, 12], seed, IMAGE);
        let resize = BilinearResize::new([8, 12], [height, width], &on.device);
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
        distance_m: vec![Tensor::full([2], 0.8, &on.device)],
        distance_weight: vec![None],
        measured: vec![Motion::new(Tensor::zeros([2, 3], &on.device), ahead)],
        turns_known: None,
        other_camera: None,
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
fn steps(mut config: TrainConfig, on: &Inputs) -> Outcome {
    config.pose_net.metres_per_unit = 0.8;
    config.depth_net.encoder.frozen_statistics = STEADY;
    config.pose_net.encoder.frozen_statistics = STEADY;
    (config.size.width, config.size.height) = (96, 64);
    let mut model = Model::new(&config, &on.device).expect("a preset's networks");
    let (batch, mut adam) = (snippets(on), Adam::default());
    let schedule = Schedule {
        speed_weight: config.loss.speed,
        masks_active: true,
    };
    // Each term over all steps is a part. Shares of pixels and terms over pixels below a threshold are left out: they jump by whole pixels.
    let mut losses: Vec<Vec<f32>> = Vec::new();
    for _ in 0..3 {
        let loss = model.loss(&model.forward(&batch), &batch, schedule);
        let terms = loss.terms.named().into_iter();
        let terms = terms.filter(|(name, _)| !name.ends_with("_share") && *name != "agreement");
        for (place, (_, value)) in terms.enumerate() {
            losses.resize(losses.len().max(place + 1), Vec::new());
            losses[place].push(value as f32);
        }
        let mut gradients = NamedGradients::default();
        model.add_gradients(&loss.total, 1.0, &mut gradients);
        let (_, step) = adam.begin(&gradients, 1e-4, 10.0, 0.0);
        model = model.updated(&mut adam, &step.expect("finite"), &gradients);
    }
    Outcome {
        forward: losses,
        backward: Vec::new(),
    }
}
