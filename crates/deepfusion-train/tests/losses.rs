//! The loss terms against PyTorch (`reference/losses.py`, `reference/depth.py`) and finite differences.

use burn::tensor::{Bool, Device, Tensor, TensorData};
use deepfusion_nn::weights::{self, Weights};
use deepfusion_train::losses::{
    DepthTruth, RigidView, View, affine_invariant, agreement, depth_seen_from_target,
    epipolar_distance, explainability, flow, flow_view, mean_reprojection, moving_pixels,
};
use deepfusion_train::{DepthLossConfig, FlowLossConfig, Motion, MovingConfig, Synthesised};
use std::path::Path;

const SSIM_WEIGHT: f64 = 0.85;

/// The fixture's tensors, on an autodiff device.
struct Reference {
    tensors: Weights,
    device: Device,
}

impl Reference {
    fn read() -> Self {
        Self::of("losses.safetensors")
    }

    fn of(file: &str) -> Self {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference");
        Self {
            tensors: weights::read(&folder.join(file)).unwrap(),
            device: Device::flex().autodiff(),
        }
    }

    fn values(&self, name: &str) -> &[f32] {
        &self.tensors.tensors[name].values
    }

    fn tensor<const D: usize>(&self, name: &str) -> Tensor<D> {
        let tensor = &self.tensors.tensors[name];
        let shape: [usize; D] = tensor.shape.clone().try_into().unwrap();
        Tensor::from_data(TensorData::new(tensor.values.clone(), shape), &self.device)
    }

    fn mask(&self, name: &str) -> Tensor<4, Bool> {
        self.tensor::<4>(name).greater_elem(0.5)
    }

    /// The value and every input's gradient equal PyTorch's.
    fn check(&self, term: &str, loss: Tensor<1>, inputs: &[(&str, Tensor<4>)]) {
        let value = loss.clone().into_scalar::<f32>();
        let expected = self.values(&format!("{term}/loss"))[0];
        assert!(
            (value - expected).abs() <= 1e-5 * expected.abs(),
            "{term}: {value} instead of {expected}"
        );
        let gradients = loss.backward();
        for (name, input) in inputs {
            let ours = input.grad(&gradients).unwrap();
            close(
                &format!("{term}/{name}.grad"),
                &read(ours),
                self.values(&format!("{term}/{name}.grad")),
            );
        }
    }
}

fn read<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().try_into_vec().unwrap()
}

fn truth(mask: Tensor<4, Bool>) -> Vec<f32> {
    read(mask.float())
}

/// Equal to 1e-4 of the expected values' root mean square: f32 against doubles, sums of a few hundred
/// values, and SSIM's quotients, in which a hundredth of 1e-4 is lost.
fn close(what: &str, ours: &[f32], expected: &[f32]) {
    assert_eq!(ours.len(), expected.len(), "{what}");
    let rms = expected.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>() / expected.len() as f64;
    let worst = ours.iter().zip(expected).map(|(a, b)| (a - b).abs());
    let worst = f64::from(worst.fold(0.0, f32::max));
    assert!(
        worst <= 1e-4 * rms.sqrt(),
        "{what}: {worst} of {}",
        rms.sqrt()
    );
}

fn settings() -> FlowLossConfig {
    FlowLossConfig {
        weight: 0.1,
        consistency: 0.1,
        smoothness: 0.05,
        agreement: 0.0,
    }
}

#[test]
fn the_flow_loss_equals_pytorch_in_both_arrangements() {
    let reference = Reference::read();
    let (first, second) = (
        reference.tensor("flow/first"),
        reference.tensor("flow/second"),
    );
    let forward = reference.tensor::<4>("flow/forward").require_grad();
    let backward = reference.tensor::<4>("flow/backward").require_grad();
    let view = |a: &Tensor<4>, b: &Tensor<4>, f: &Tensor<4>, g: &Tensor<4>| {
        flow_view(a, b, f, g, SSIM_WEIGHT)
    };
    let there = view(&first, &second, &forward, &backward);
    close("error", &read(there.error), reference.values("flow/error"));
    assert_eq!(truth(there.visible), reference.values("flow/visible"));

    let cat = |a: &Tensor<4>, b: &Tensor<4>| Tensor::cat(vec![a.clone(), b.clone()], 0);
    let (targets, sources) = (cat(&first, &second), cat(&second, &first));
    let (flows, backs) = (cat(&forward, &backward), cat(&backward, &forward));
    let pooled = view(&targets, &sources, &flows, &backs);
    let loss = flow(&[pooled], &[flows], &[targets], &settings());
    let inputs = [("forward", forward), ("backward", backward)];
    reference.check("flow", loss, &inputs);
}

#[test]
fn the_affine_invariant_loss_equals_pytorch() {
    let reference = Reference::read();
    let x = reference.tensor::<4>("affine/x").require_grad();
    let y = reference.tensor::<4>("affine/y").require_grad();
    let mask = reference.mask("affine/valid");
    let loss = || affine_invariant(x.clone(), y.clone(), &mask);
    reference.check("affine", loss(), &[("x", x.clone())]);
    // y is the reference of x and has no gradient.
    let pulled = y.grad(&loss().backward()).map(read);
    assert!(pulled.is_none_or(|g| g.iter().all(|g| *g == 0.0)));
}

#[test]
fn the_other_depth_seen_from_the_target_equals_pytorch() {
    let reference = Reference::read();
    let depth = reference.tensor::<4>("seen/depth").require_grad();
    let coords = reference.tensor::<4>("seen/coords").require_grad();
    let turn = reference.tensor::<2>("seen/axis_angle").require_grad();
    let step = reference.tensor::<2>("seen/translation").require_grad();
    let motion = Motion::new(turn.clone(), step.clone());
    let inverse = reference.tensor::<3>("seen/inverse_intrinsics");
    let seen = depth_seen_from_target(depth.clone(), coords.clone(), &motion, &inverse);
    close("seen", &read(seen.clone()), reference.values("seen/seen"));
    let count = seen.dims().iter().product::<usize>();
    let pattern: Vec<f32> = (0..count).map(|i| (i as f64).cos() as f32).collect();
    let pattern = Tensor::<1>::from_data(pattern.as_slice(), &reference.device);
    let loss = seen.clone().mul(pattern.reshape(seen.dims())).sum();
    let gradients = loss.backward();
    let motion_gradients = [("axis_angle", turn), ("translation", step)];
    for (name, input) in motion_gradients {
        let expected = reference.values(&format!("seen/{name}.grad"));
        close(name, &read(input.grad(&gradients).unwrap()), expected);
    }
    for (name, input) in [("depth", depth), ("coords", coords)] {
        let expected = reference.values(&format!("seen/{name}.grad"));
        close(name, &read(input.grad(&gradients).unwrap()), expected);
    }
}

#[test]
fn agreement_equals_pytorch() {
    let reference = Reference::read();
    let rigid = reference.tensor::<4>("agreement/rigid").require_grad();
    let flow = reference.tensor::<4>("agreement/flow").require_grad();
    let both = reference.mask("affine/valid");
    let loss = agreement(rigid.clone(), flow.clone(), &both);
    reference.check("agreement", loss, &[("rigid", rigid), ("flow", flow)]);
}

#[test]
fn dynamic_pixels_equal_pytorch() {
    let reference = Reference::read();
    let ends = reference.tensor::<4>("seen/coords");
    let motion = Motion::new(
        reference.tensor("seen/axis_angle"),
        reference.tensor("seen/translation"),
    );
    let inverse = reference.tensor::<3>("seen/inverse_intrinsics");
    let intrinsics = reference.tensor::<3>("seen/intrinsics");
    let distance = epipolar_distance(&ends, &motion, &inverse);
    close(
        "distance",
        &read(distance),
        reference.values("moving/distance"),
    );

    let everywhere = reference
        .tensor::<4>("moving/flow_error")
        .greater_elem(-1.0);
    let synthesised = Synthesised {
        image: reference.tensor("moving/flow_error"),
        coords: reference.tensor("moving/rigid_coords"),
        valid: everywhere.clone(),
    };
    let error = reference.tensor("moving/rigid_error");
    let rigid = RigidView {
        synthesised: &synthesised,
        error: &error,
        source_from_target: &motion,
        intrinsics: &intrinsics,
        inverse_intrinsics: &inverse,
    };
    let seen = deepfusion_train::losses::FlowView {
        error: reference.tensor("moving/flow_error"),
        round_trip: Tensor::zeros(ends.dims(), &reference.device),
        coords: ends,
        visible: everywhere,
    };
    // The dynamic pixels with each of the two limits on what cannot be static, with both, and with none.
    for (min_epipolar_px, min_parallax_ratio, name) in [
        (0.5, 0.0, "moving"),
        (0.0, 2.0, "along"),
        (0.5, 2.0, "either"),
        (0.0, 0.0, "neither"),
    ] {
        let limits = MovingConfig {
            enabled: true,
            margin: 0.02,
            min_flow_px: 1.0,
            min_flow_share: 0.4,
            min_epipolar_px,
            min_parallax_ratio,
            warmup_share: 0.0,
        };
        let moving = truth(moving_pixels(&rigid, &seen, &limits));
        let expected = reference.values(&format!("moving/{name}"));
        assert_eq!(moving, expected, "{name}");
        assert!(moving.contains(&1.0) && moving.contains(&0.0), "{name}");
    }
}

/// Neither the scale of depth nor an offset changes the loss, and its gradient changes neither.
#[test]
fn the_affine_invariant_loss_does_not_depend_on_the_scale() {
    let reference = Reference::read();
    let (x, y) = (
        reference.tensor::<4>("affine/x"),
        reference.tensor::<4>("affine/y"),
    );
    let valid = reference.mask("affine/valid");
    let at = |scale_x: f32, scale_y: f32| {
        let s = Tensor::<1>::from_data([scale_x, scale_y], &reference.device).require_grad();
        let part = |i| s.clone().narrow(0, i, 1).reshape([1, 1, 1, 1]);
        let loss = affine_invariant(x.clone() * part(0), y.clone() * part(1), &valid);
        let gradient = s.grad(&loss.clone().backward()).unwrap();
        (loss.into_scalar::<f32>(), read(gradient))
    };
    let (one, gradient) = at(1.0, 1.0);
    assert!(one > 0.1, "{one}");
    assert!(
        gradient.iter().all(|g| g.abs() < 1e-4 * one),
        "{gradient:?}"
    );
    for (a, b) in [(3.0, 1.0), (1.0, 0.2), (0.05, 7.0)] {
        let (other, _) = at(a, b);
        assert!((other - one).abs() < 2e-5 * one, "{other} {one}");
    }
    // Flat depths have no spread to divide by. The gradient must stay finite.
    let flat = Tensor::<4>::full([1, 1, 4, 6], 10.0, &reference.device).require_grad();
    let everywhere = flat.clone().greater_elem(0.0);
    let loss = affine_invariant(flat.clone(), flat.clone(), &everywhere);
    let gradient = read(flat.grad(&loss.backward()).unwrap());
    assert!(gradient.iter().all(|g| g.is_finite()));
}

/// Moving one depth or both towards the mean never lowers the loss, which ends at 1: a flat depth is no advantage.
#[test]
fn the_affine_invariant_loss_does_not_reward_a_flat_depth() {
    let reference = Reference::read();
    let (x, y) = (
        reference.tensor::<4>("affine/x"),
        reference.tensor::<4>("affine/y"),
    );
    let valid = reference.mask("affine/valid");
    let drawn = |t: &Tensor<4>, share: Tensor<4>| {
        let mean = t.clone().mean_dim(3).mean_dim(2);
        (t.clone() - mean.clone()) * share + mean
    };
    let at = |share_x: f32, share_y: f32| {
        let s = Tensor::<1>::from_data([share_x, share_y], &reference.device).require_grad();
        let part = |i| s.clone().narrow(0, i, 1).reshape([1, 1, 1, 1]);
        let loss = affine_invariant(drawn(&x, part(0)), drawn(&y, part(1)), &valid);
        let slope = read(s.grad(&loss.clone().backward()).unwrap());
        (loss.into_scalar::<f32>(), slope)
    };
    for (x_too, y_too) in [(true, false), (false, true), (true, true)] {
        let mut last = 0.0;
        for share in [1.0, 0.3, 0.1, 0.03, 0.01, 1e-3, 0.0] {
            let of = |too| if too { share } else { 1.0 };
            let (loss, slope) = at(of(x_too), of(y_too));
            assert!(loss > last - 1e-5, "{share}: {loss} after {last}");
            // Nor does its gradient move either of them there. The rest arises because a and b minimise squares and the loss is an absolute
            // difference.
            assert!(slope.iter().all(|s| *s < 1e-3), "{share}: {slope:?}");
            last = loss;
        }
        assert!(last > 0.95, "{x_too} {y_too}: {last}");
    }
}

/// For two flows that contradict each other everywhere, all pixels in view still count, so that they can learn from the error.
#[test]
fn contradictory_flows_keep_learning() {
    let reference = Reference::read();
    let (first, second) = (
        reference.tensor("flow/first"),
        reference.tensor("flow/second"),
    );
    let [n, _, h, w] = Tensor::<4>::dims(&first);
    let same = Tensor::<4>::full([n, 2, h, w], 3.0, &reference.device).require_grad();
    let view = flow_view(&first, &second, &same, &same, SSIM_WEIGHT);
    let seen = truth(view.visible.clone()).iter().sum::<f32>();
    assert_eq!(seen as usize, n * (h - 3) * (w - 3), "all that is in view");
    let loss = flow(&[view], std::slice::from_ref(&same), &[first], &settings());
    let gradient = read(same.grad(&loss.backward()).unwrap());
    assert!(gradient.iter().filter(|g| **g != 0.0).count() > gradient.len() / 2);
}

/// Without a visible pixel the loss is the smoothness, and not NaN.
#[test]
fn a_flow_out_of_view_costs_its_smoothness_alone() {
    let device = Device::flex().autodiff();
    let image = Tensor::<4>::ones([1, 3, 6, 8], &device);
    let away = Tensor::<4>::full([1, 2, 6, 8], 100.0, &device).require_grad();
    let view = flow_view(&image, &image, &away, &away, SSIM_WEIGHT);
    let loss = flow(&[view], std::slice::from_ref(&away), &[image], &settings());
    assert_eq!(loss.clone().into_scalar::<f32>(), 0.0);
    let gradient = read(away.grad(&loss.backward()).unwrap());
    assert!(gradient.iter().all(|g| g.is_finite()));
}

/// Central differences along random directions, so that a kink of one pixel's |·| or of a bilinear cell is one among hundreds of values. In
/// f32 the steps leave an error of 1e-3 of the derivative. `seen` is quadratic and allows a long step.
#[test]
fn gradients_equal_finite_differences() {
    let reference = Reference::read();
    let check = |what: &str, point: &str, loss: &dyn Fn(Tensor<4>) -> Tensor<1>, step: f64| {
        let x = reference.tensor::<4>(point).require_grad();
        let gradient = x.grad(&loss(x.clone()).backward()).unwrap();
        for seed in 1..=3 {
            let count: usize = x.dims().iter().product();
            let direction = (0..count).map(|i| ((i * i * seed + i) as f64).sin() as f32);
            let direction: Vec<f32> = direction.collect();
            let direction = Tensor::<1>::from_data(direction.as_slice(), &reference.device);
            let direction = direction.reshape(x.dims());
            let expected = gradient
                .clone()
                .mul(direction.clone())
                .sum()
                .into_scalar::<f32>();
            let at = |step: f64| {
                let moved = x.clone().detach() + direction.clone().mul_scalar(step);
                f64::from(loss(moved).into_scalar::<f32>())
            };
            let numeric = (at(step) - at(-step)) / (2.0 * step);
            let tolerance = 2e-2 * f64::from(expected.abs()) + 1e-3;
            assert!(
                (numeric - f64::from(expected)).abs() < tolerance,
                "{what}, direction {seed}: {expected} instead of {numeric}"
            );
        }
    };
    let (first, second) = (
        reference.tensor("flow/first"),
        reference.tensor("flow/second"),
    );
    let back = reference.tensor("flow/backward");
    let flow_loss = |f: Tensor<4>| {
        let view = flow_view(&first, &second, &f, &back, SSIM_WEIGHT);
        flow(&[view], &[f], std::slice::from_ref(&first), &settings())
    };
    check("flow", "flow/forward", &flow_loss, 1e-3);
    let y = reference.tensor::<4>("affine/y");
    let valid = reference.mask("affine/valid");
    let affine = |x: Tensor<4>| affine_invariant(x, y.clone(), &valid);
    check("affine x", "affine/x", &affine, 1e-2);
    let other = reference.tensor::<4>("agreement/flow");
    let apart = |rigid: Tensor<4>| agreement(rigid, other.clone(), &valid);
    check("agreement", "agreement/rigid", &apart, 1e-3);
    let motion = Motion::new(
        reference.tensor("seen/axis_angle"),
        reference.tensor("seen/translation"),
    );
    let inverse = reference.tensor::<3>("seen/inverse_intrinsics");
    let coords = reference.tensor::<4>("seen/coords");
    let seen = |depth: Tensor<4>| {
        let seen = depth_seen_from_target(depth, coords.clone(), &motion, &inverse);
        seen.powi_scalar(2).mean()
    };
    check("seen", "seen/depth", &seen, 1e-1);
}

/// Known depth, pixels that are only known to be far, and unknown ones; four scales.
#[test]
fn the_loss_on_known_depth_equals_pytorch() {
    let reference = Reference::of("depth.safetensors");
    let names: Vec<String> = (0..4).map(|s| format!("inverse{s}")).collect();
    let inverse: Vec<Tensor<4>> = names
        .iter()
        .map(|name| {
            reference
                .tensor::<4>(&format!("depth/{name}"))
                .require_grad()
        })
        .collect();
    let truth = DepthTruth {
        log_depth: reference.tensor("depth/log_depth"),
        known: reference.tensor("depth/known"),
        far: reference.tensor("depth/far"),
    };
    let config = DepthLossConfig {
        weight: 1.0,
        gradient: 0.5,
    };
    let found = deepfusion_train::losses::depth(&inverse, &truth, &config);
    for (part, value) in [
        ("error", &found.error),
        ("gradient", &found.gradient),
        ("bias", &found.bias),
    ] {
        let value = value.clone().into_scalar::<f32>();
        let expected = reference.values(&format!("depth/{part}"))[0];
        // Sums of 480 terms of order 1, of either sign in the bias.
        assert!(
            (value - expected).abs() < 2e-6,
            "{part}: {value} {expected}"
        );
    }
    let inputs: Vec<(&str, Tensor<4>)> = names.iter().map(String::as_str).zip(inverse).collect();
    reference.check("depth", found.loss, &inputs);
}

/// The uncertainty loss against PyTorch's Laplace distribution, with scales beyond the limits, too. The sky and unknown pixels have no
/// effect.
#[test]
fn the_uncertainty_loss_equals_pytorch() {
    let reference = Reference::of("depth.safetensors");
    let log_scale = reference
        .tensor::<4>("uncertainty/log_scale")
        .require_grad();
    let inverse = reference.tensor::<4>("depth/inverse0").require_grad();
    let truth = DepthTruth {
        log_depth: reference.tensor("depth/log_depth"),
        known: reference.tensor("depth/known"),
        far: reference.tensor("depth/far"),
    };
    let loss = || deepfusion_train::losses::uncertainty(inverse.clone(), log_scale.clone(), &truth);
    assert!(inverse.grad(&loss().backward()).is_none());
    let inputs = [("log_scale", log_scale.clone())];
    reference.check("uncertainty", loss(), &inputs);
}

/// A batch's loss is the mean of its images' losses, though they have different numbers of valid pixels. So workers can divide a batch.
#[test]
fn a_batchs_loss_is_the_mean_of_its_images() {
    type Cut<'a> = &'a dyn Fn(Tensor<4>) -> Tensor<4>;
    let check = |what: &str, loss: &dyn Fn(Cut<'_>) -> Tensor<1>| {
        let whole = loss(&|batch| batch).into_scalar::<f32>();
        let image = |index: usize| loss(&|batch| batch.narrow(0, index, 1)).into_scalar::<f32>();
        let mean = (image(0) + image(1)) / 2.0;
        assert!(
            (whole - mean).abs() <= 1e-5 * whole.abs(),
            "{what}: {whole} and {mean}"
        );
    };
    let reference = Reference::read();
    check("flow", &|cut| {
        let names = ["first", "second", "forward", "backward"];
        let [first, second, forward, backward] =
            names.map(|name| cut(reference.tensor(&format!("flow/{name}"))));
        let view = flow_view(&first, &second, &forward, &backward, SSIM_WEIGHT);
        flow(&[view], &[forward], &[first], &settings())
    });
    let valid = |cut: Cut<'_>| cut(reference.tensor("affine/valid")).greater_elem(0.5);
    check("agreement", &|cut| {
        let [rigid, seen] =
            ["rigid", "flow"].map(|name| cut(reference.tensor(&format!("agreement/{name}"))));
        agreement(rigid, seen, &valid(cut))
    });
    check("affine", &|cut| {
        let [x, y] = ["x", "y"].map(|name| cut(reference.tensor(&format!("affine/{name}"))));
        affine_invariant(x, y, &valid(cut))
    });
    let reference = Reference::of("depth.safetensors");
    let depth = |cut: Cut<'_>, name: &str| cut(reference.tensor(&format!("depth/{name}")));
    let truth = |cut: Cut<'_>| DepthTruth {
        log_depth: depth(cut, "log_depth"),
        known: depth(cut, "known"),
        far: depth(cut, "far"),
    };
    check("depth", &|cut| {
        let scales = ["inverse0", "inverse1", "inverse2", "inverse3"];
        let config = DepthLossConfig {
            weight: 1.0,
            gradient: 0.5,
        };
        let inverse = scales.map(|name| depth(cut, name));
        deepfusion_train::losses::depth(&inverse, &truth(cut), &config).loss
    });
    check("uncertainty", &|cut| {
        let log_scale = cut(reference.tensor("uncertainty/log_scale"));
        deepfusion_train::losses::uncertainty(depth(cut, "inverse0"), log_scale, &truth(cut))
    });
}

#[test]
fn sources_are_weighted_by_their_masks() {
    let reference = Reference::of("explainability.safetensors");
    let leaf = |name: String| {
        let tensor = reference.tensor::<4>(&format!("explainability/{name}"));
        tensor.require_grad()
    };
    let errors = [0, 1].map(|k| leaf(format!("error{k}")));
    let logits = [0, 1].map(|k| leaf(format!("logit{k}")));
    let views = [0, 1].map(|k: usize| View {
        error: errors[k].clone(),
        valid: reference.mask(&format!("explainability/seen{k}")),
        unwarped_error: reference.tensor(&format!("explainability/unwarped{k}")),
        moving: None,
    });
    let seen = mean_reprojection(views.to_vec(), &logits).loss;
    let loss = seen + explainability(&logits).mul_scalar(0.2);
    let [first, second] = errors;
    let [own, other] = logits;
    let inputs = [
        ("error0", first),
        ("error1", second),
        ("logit0", own),
        ("logit1", other),
    ];
    reference.check("explainability", loss, &inputs);
}
