//! The paper's depth network and its parts against PyTorch: values, and the gradients of inputs and weights.
//!
//! The reference (tests/reference/depth_network.py) is in double precision, so the difference is float32 rounding. Tolerance: 1e-4 of each
//! tensor's root mean square; the largest measured error is 3.6e-5. No sum is so close to a ReLU's kink that rounding would carry it over
//! (the generator prints the distance).

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use deepfusion_nn::layers::freeze_statistics;
use deepfusion_nn::weights;
use deepfusion_nn::{
    Attention, AttentionConfig, AttentionForm, DecoderConfig, DepthNet, DepthNetConfig,
    GlobalAggregation, HceConfig, HierarchicalContext, ResNet, ResNetConfig, ResNetDepth,
    WeightRng,
};

use crate::networks::common::{
    filled, largest_difference, reference, take_gradients, uniform, values,
};

/// Relative to a tensor's root mean square.
const TOLERANCE: f32 = 1e-4;
/// Most values of a tensor that the reference keeps.
const AT_MOST: usize = 60;

fn step(len: usize) -> usize {
    if len <= AT_MOST {
        1
    } else {
        (len / AT_MOST) | 1
    }
}

/// Runs a case of the reference. `forward` applies the module to the input.
fn check<M: Module>(
    case: &str,
    module: M,
    shape: [usize; 4],
    forward: impl Fn(&M, Tensor<4>) -> Vec<Tensor<4>>,
) {
    let expected = weights::read(&reference("depth_network.safetensors")).unwrap();
    let expected = expected.under(&format!("{case}/"));
    let module = filled(module);
    let device = Device::flex().autodiff();
    let values_in = uniform(&format!("{case}/x"), shape.iter().product(), None);
    let values_in: Vec<f32> = values_in.iter().map(|v| v * 0.5 + 0.5).collect();
    let x = Tensor::<4>::from_data(TensorData::new(values_in, shape), &device).require_grad();
    let mut actual = Vec::new();
    let mut loss = Tensor::<1>::zeros([1], &device);
    for (i, output) in forward(&module, x.clone()).into_iter().enumerate() {
        let shape = output.dims();
        let pattern = uniform(&format!("{case}/pattern{i}"), shape.iter().product(), None);
        let pattern = Tensor::<4>::from_data(TensorData::new(pattern, shape), &device);
        actual.push((format!("output{i}"), values(output.clone())));
        loss = loss + output.mul(pattern).mean();
    }
    let mut gradients = loss.backward();
    let grad_x = x.grad_remove(&mut gradients).unwrap();
    actual.push(("grad/x".into(), values(grad_x)));
    let found = take_gradients(&module, &mut gradients).into_iter();
    actual.extend(found.map(|(name, gradient)| (format!("grad/{name}"), gradient)));

    let compared = actual.iter().map(|(name, values)| {
        let (difference, rms) = largest_difference(&expected, name, values, step(values.len()));
        (name, difference, rms)
    });
    let compared: Vec<_> = compared.collect();
    let gradients = compared
        .iter()
        .filter(|(name, ..)| name.starts_with("grad"));
    let largest = gradients.map(|(.., rms)| *rms).fold(0.0, f32::max);
    let mut worst = (0.0, String::new());
    for (name, difference, rms) in compared {
        // The gradient of a bias before a batch norm is nothing but rounding errors: it is compared with the other gradients.
        let error = difference / rms.max(1e-4 * largest);
        if error > worst.0 {
            worst = (error, name.clone());
        }
    }
    println!("{case}: {} tensors, worst {worst:?}", actual.len());
    assert!(worst.0 < TOLERANCE, "{case}: {worst:?}");
    // No gradient of PyTorch's is missing here.
    assert_eq!(actual.len(), expected.tensors.len(), "{case}");
}

#[test]
fn hierarchical_context() {
    let device = Device::flex().autodiff();
    let init = |config: &HceConfig, channels| {
        let mut rng = WeightRng::new(1);
        HierarchicalContext::new(config, channels, &mut rng, &device).unwrap()
    };
    let shape = [2, 24, 9, 17];
    let hce = init(&HceConfig::default(), 24);
    check("hce", hce.clone(), shape, |hce, x| vec![hce.forward(x)]);
    // With running statistics; a new module, since the batch above changed those of the first.
    let frozen = freeze_statistics(init(&HceConfig::default(), 24), true);
    check("hce_evaluated", frozen, shape, |hce, x| {
        vec![hce.forward(x)]
    });
    let plain = HceConfig {
        rates: vec![1, 2],
        global_pool: false,
        reduce_first: false,
        ..HceConfig::default()
    };
    let plain = init(&plain, 140);
    check("hce_plain", plain, [2, 140, 5, 8], |hce, x| {
        vec![hce.forward(x)]
    });
}

#[test]
fn attention_in_both_forms() {
    let device = Device::flex().autodiff();
    for (case, form) in [
        ("attention_product", AttentionForm::Product),
        ("attention_residual", AttentionForm::Residual),
    ] {
        let config = AttentionConfig {
            form,
            ..AttentionConfig::default()
        };
        let attention = Attention::new(&config, 40, &mut WeightRng::new(1), &device).unwrap();
        check(case, attention, [2, 40, 9, 11], |a, x| vec![a.forward(x)]);
    }
}

#[test]
fn global_aggregation() {
    let device = Device::flex().autodiff();
    let module = GlobalAggregation::new(20, &mut WeightRng::new(1), &device);
    check("aggregation", module, [2, 20, 5, 7], |a, x| {
        vec![a.forward(x)]
    });
}

#[test]
fn dilated_encoders() {
    let device = Device::flex().autodiff();
    for (case, depth) in [
        ("dilated_18", ResNetDepth::ResNet18),
        ("dilated_50", ResNetDepth::ResNet50),
    ] {
        let config = ResNetConfig::new(depth)
            .with_base_width(8)
            .with_output_stride(16);
        let encoder = ResNet::new(&config, &mut WeightRng::new(1), &device).unwrap();
        let encoder = freeze_statistics(encoder, true);
        check(case, encoder, [2, 3, 96, 128], |encoder, x| {
            let [_, _, _, f3, f4] = encoder.forward(x);
            assert_eq!(f3.dims()[2..], f4.dims()[2..]);
            vec![f3, f4]
        });
    }
}

fn small_paper(depth: ResNetDepth, base_width: usize, form: AttentionForm) -> DepthNetConfig {
    DepthNetConfig {
        encoder: ResNetConfig::new(depth)
            .with_base_width(base_width)
            .with_output_stride(16),
        attention: Some(AttentionConfig {
            form,
            ..AttentionConfig::default()
        }),
        decoder: DecoderConfig {
            widths: [24, 16, 16, 8, 8],
        },
        ..DepthNetConfig::paper()
    }
}

#[test]
fn the_whole_network() {
    let device = Device::flex().autodiff();
    let shape = [2, 3, 64, 96];
    let eighteen = small_paper(ResNetDepth::ResNet18, 16, AttentionForm::Product);
    let net = DepthNet::new(&eighteen, &device).unwrap();
    check("paper_18", net, shape, |net, x| net.forward(x));
    let fifty = small_paper(ResNetDepth::ResNet50, 8, AttentionForm::Residual);
    let net = freeze_statistics(DepthNet::new(&fifty, &device).unwrap(), true);
    // Through `encode` and `decode`, as for a second decoder on the same encoder.
    check("paper_50", net, shape, |net, x| net.decode(net.encode(x)));
}

#[test]
fn inspection_shows_what_forward_uses() {
    let device = Device::flex();
    let config = small_paper(ResNetDepth::ResNet18, 8, AttentionForm::Product);
    let net = filled(DepthNet::new(&config, &device).unwrap());
    let x = crate::networks::common::images("images", 3, &device);
    let seen = net.inspect(x.clone());
    assert_eq!(seen.masks.len(), 4);
    for (level, masks) in seen.masks.iter().enumerate() {
        let [n, c, h, w] = seen.refined[level + 1].dims();
        assert_eq!(masks.channel.dims(), [n, c, 1, 1]);
        assert_eq!(masks.spatial.dims(), [n, 1, h, w]);
    }
    let expected = net.forward(x.clone()).swap_remove(0);
    let refined = seen.refined.try_into().unwrap();
    let actual = net.decoder.unwrap().forward(refined).swap_remove(0);
    assert_eq!(values(actual), values(expected));
}
