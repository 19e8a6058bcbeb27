//! One training step's statistics and gradients against PyTorch, and the modes of batch norms.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]

use crate::networks::common::{images, manifest, values, write_listed};
use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use deepfusion_nn::layers::freeze_statistics;
use deepfusion_nn::weights::{Monodepth2Files, collect, load_monodepth2};
use deepfusion_nn::{DepthNet, DepthNetConfig, HceConfig, ResNetDepth};

/// The ResNet-18 depth network with the formula's weights.
fn reference_network(device: &Device) -> DepthNet {
    let folder = tempfile::tempdir().unwrap();
    let manifest = manifest();
    for file in ["encoder", "depth"] {
        write_listed(
            &folder.path().join(format!("{file}.safetensors")),
            &manifest[&format!("monodepth2_18/{file}")],
        );
    }
    load_monodepth2(&Monodepth2Files::in_folder(folder.path()), device)
        .unwrap()
        .depth_net
}

fn pattern_loss(disparities: Vec<Tensor<4>>) -> Tensor<1> {
    disparities
        .into_iter()
        .enumerate()
        .map(|(scale, disparity)| {
            let shape = disparity.dims();
            let pattern = crate::networks::common::uniform(
                &format!("pattern{scale}"),
                shape.iter().product::<usize>(),
                None,
            );
            let pattern =
                Tensor::<4>::from_data(TensorData::new(pattern, shape), &disparity.device());
            disparity.mul(pattern).mean()
        })
        .reduce(Tensor::add)
        .unwrap()
}

/// The reference's name of a tensor of ours.
fn pytorch_name(name: &str) -> String {
    if let Some(rest) = name.strip_prefix("encoder.") {
        return format!("encoder/encoder.{rest}");
    }
    let parts: Vec<&str> = name.split('.').collect();
    let index: usize = parts[2].parse().unwrap();
    match parts[1] {
        "heads" => format!("depth/decoder.{}.conv.{}", 10 + index, parts[3]),
        _ => {
            let index = 2 * index + usize::from(parts[3] == "fuse");
            format!("depth/decoder.{index}.conv.conv.{}", parts[4])
        }
    }
}

/// Tolerance: 1e-4 of the gradient's root mean square. Twenty batch norms in a row, some over only 12 values, amplify float32's rounding
/// errors; the reference is in double precision. Measured: 1.3e-5, running statistics 3.5e-7.
#[test]
fn gradients_and_running_statistics_are_pytorchs() {
    let device = Device::flex().autodiff();
    let net = reference_network(&device);
    let loss = pattern_loss(net.forward(images("images", 3, &device)));
    let expected = crate::networks::common::expected();
    let loss_error = values(loss.clone())[0] - expected.tensors["training/loss"].values[0];
    println!("loss: {loss_error:.2e}");
    assert!(loss_error.abs() < 1e-6);

    let mut compared = 0;
    let mut worst = (0.0, String::new());
    let mut compare = |name: &str, gradient: Vec<f32>| {
        let reference = format!("training/{}", pytorch_name(name));
        let norm = expected.tensors[&format!("{reference}/norm")].values[0];
        let rms = norm / (gradient.len() as f32).sqrt();
        let actual = gradient
            .iter()
            .map(|g| f64::from(*g).powi(2))
            .sum::<f64>()
            .sqrt() as f32;
        assert!(
            (actual - norm).abs() < 1e-4 * norm,
            "{name}: norm {actual} for {norm}"
        );
        let step = (gradient.len() / 23).max(1) | 1;
        let values = &expected.tensors[&format!("{reference}/gradient")].values;
        assert_eq!(gradient.len().div_ceil(step), values.len(), "{name}");
        for (a, e) in gradient.iter().step_by(step).zip(values) {
            let error = (a - e).abs() / e.abs().max(rms);
            if error > worst.0 {
                worst = (error, name.to_owned());
            }
        }
        compared += 1;
    };
    for (name, gradient) in crate::networks::common::gradients(&net, loss) {
        compare(&name, gradient);
    }
    println!("{compared} gradients, worst {:.2e} in {}", worst.0, worst.1);
    assert!(worst.0 < 1e-4, "{worst:?}");
    let wanted = expected
        .tensors
        .keys()
        .filter(|name| name.ends_with("/norm"));
    assert_eq!(compared, wanted.count());

    let mut worst = 0.0_f32;
    let statistics = collect(&net);
    let mut compared = 0;
    for (name, tensor) in &statistics.tensors {
        if name.contains("running") {
            let reference = format!("training/{}", pytorch_name(name));
            worst = worst.max(crate::networks::common::largest_error(
                &expected,
                &reference,
                &tensor.values,
                7,
            ));
            compared += 1;
        }
    }
    println!("{compared} running statistics, worst {worst:.2e}");
    assert_eq!(compared, 40);
    assert!(worst < 1e-5, "{worst:e}");
}

fn tiny(device: &Device) -> DepthNet {
    let mut config = DepthNetConfig::new(ResNetDepth::ResNet18);
    config.encoder.base_width = 4;
    config.decoder.widths = [8, 8, 4, 4, 4];
    DepthNet::new(&config, device).unwrap()
}

fn statistics(net: &DepthNet) -> Vec<Vec<f32>> {
    let weights = collect(net);
    let running = weights
        .tensors
        .into_iter()
        .filter(|(name, _)| name.contains("running"));
    running.map(|(_, tensor)| tensor.values).collect()
}

#[test]
fn only_training_changes_the_statistics() {
    let device = Device::flex().autodiff();
    let net = tiny(&device);
    let x = images("images", 3, &device);
    let before = statistics(&net);

    let valid = net.valid();
    let first = values(valid.forward(x.clone().inner()).swap_remove(0));
    assert_eq!(
        statistics(&valid),
        before,
        "evaluation does not change the statistics"
    );

    let trained = values(net.forward(x.clone()).swap_remove(0));
    let after = statistics(&net);
    assert_ne!(after, before, "training changes them at once");
    assert_ne!(trained, first, "training normalises by the batch");
    assert_eq!(
        statistics(&valid),
        before,
        "the network for evaluation is a snapshot"
    );
    assert_eq!(values(valid.forward(x.inner()).swap_remove(0)), first);
}

#[test]
fn frozen_statistics_stay_while_everything_learns() {
    let device = Device::flex().autodiff();
    let net = freeze_statistics(tiny(&device), true);
    let x = images("images", 3, &device);
    let before = statistics(&net);
    let output = net.forward(x.clone()).swap_remove(0);
    let evaluated = net.valid().forward(x.inner()).swap_remove(0);
    assert_eq!(values(output.clone()), values(evaluated));
    assert_eq!(statistics(&net), before);

    let gradients = output.mean().backward();
    let bn = &net.encoder.as_ref().unwrap().layer4[1].bn2;
    assert!(bn.weight.val().grad(&gradients).is_some());
    assert!(bn.bias.val().grad(&gradients).is_some());

    // Statistics stay frozen after switching to evaluation and back, until they are unfrozen.
    let net = net.valid().train();
    net.forward(images("images", 3, &device));
    assert_eq!(statistics(&net), before);
    let net = freeze_statistics(net, false);
    net.forward(images("images", 3, &device));
    assert_ne!(statistics(&net), before);
}

/// With frozen statistics in its configuration a network keeps all of them, also those of the context encoding, which is not part of the
/// encoder.
#[test]
fn a_configuration_freezes_the_batch_norms_of_the_whole_network() {
    let device = Device::flex().autodiff();
    let mut config = DepthNetConfig::new(ResNetDepth::ResNet18);
    config.encoder.base_width = 4;
    config.decoder.widths = [8, 8, 4, 4, 4];
    config.hce = Some(HceConfig::default());
    let moved = |config: &DepthNetConfig| {
        let net = DepthNet::new(config, &device).unwrap();
        let before = collect(&net).tensors;
        net.forward(images("images", 3, &device));
        let mut moved = collect(&net).tensors;
        moved.retain(|name, tensor| *tensor != before[name]);
        moved.into_keys().collect::<Vec<_>>()
    };
    let thawed = moved(&config);
    for part in ["encoder.", "hce."] {
        assert!(thawed.iter().any(|name| name.starts_with(part)), "{part}");
    }
    config.encoder.frozen_statistics = true;
    assert_eq!(moved(&config), Vec::<String>::new());
}

#[test]
fn a_new_network_starts_at_ten_metres() {
    let device = Device::flex();
    let config = DepthNetConfig::new(ResNetDepth::ResNet18);
    let net = DepthNet::with_seed(&config, 7, &device).unwrap();
    for disparity in net.forward(images("images", 3, &device)) {
        let mut depths: Vec<f64> = values(disparity)
            .iter()
            .map(|&sigmoid| config.range.depth_m(f64::from(sigmoid)))
            .collect();
        depths.sort_by(f64::total_cmp);
        let median = depths[depths.len() / 2];
        assert!((5.0..20.0).contains(&median), "median {median} m");
    }
}

#[test]
fn a_seed_determines_every_weight() {
    let device = Device::flex();
    let config = DepthNetConfig::new(ResNetDepth::ResNet18);
    let weights = |seed| collect(&DepthNet::with_seed(&config, seed, &device).unwrap());
    assert!(weights(5) == weights(5));
    assert!(weights(5) != weights(6));
}
