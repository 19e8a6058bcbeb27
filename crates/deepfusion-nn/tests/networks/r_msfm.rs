//! R-MSFM against PyTorch, from files with the names and shapes of the published ones.
//!
//! The reference (tests/reference/r_msfm.py) is in double precision, so the difference is float32 rounding. Tolerances: 1e-5 for
//! disparities, 1e-4 of a gradient's root mean square.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]

use std::collections::BTreeMap;
use std::path::Path;

use burn::tensor::Device;
use deepfusion_nn::weights::{self, Monodepth2Files, Weights, collect, load_r_msfm};
use deepfusion_nn::{DepthNet, DepthNetConfig};

use crate::networks::common::{
    BATCH, HEIGHT, Listing, WIDTH, check_gradients, gradients, images, largest_difference,
    pattern_loss, reference, values, write_listed,
};

fn listings() -> BTreeMap<String, Listing> {
    let text = std::fs::read_to_string(reference("r_msfm.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

fn expected() -> Weights {
    weights::read(&reference("r_msfm.safetensors")).unwrap()
}

/// Files with the formula's weights.
fn files(folder: &Path, iterations: usize) -> Monodepth2Files {
    for file in ["encoder", "depth"] {
        let listing = &listings()[&format!("r-msfm{iterations}/{file}")];
        write_listed(&folder.join(format!("{file}.safetensors")), listing);
    }
    Monodepth2Files::in_folder(folder)
}

#[test]
fn both_published_networks() {
    let device = Device::flex();
    let expected = expected();
    for iterations in [3, 6] {
        let folder = tempfile::tempdir().unwrap();
        let imported = load_r_msfm(&files(folder.path(), iterations), &device).unwrap();
        let found = imported.depth_config.r_msfm.as_ref().unwrap();
        assert_eq!(found.iterations, iterations);
        assert_eq!((imported.input_size, imported.pose.is_none()), (None, true));
        let disparities = imported.depth_net.forward(images("images", 3, &device));
        assert_eq!(disparities.len(), iterations);
        assert_eq!(imported.depth_config.scales().len(), iterations);
        for (age, disparity) in disparities.into_iter().enumerate() {
            assert_eq!(disparity.dims(), [BATCH, 1, HEIGHT, WIDTH]);
            let name = format!("r-msfm{iterations}/disparity{age}");
            let (off, _) = largest_difference(&expected, &name, &values(disparity), 31);
            println!("{name}: {off:.2e}");
            assert!(off < 1e-5, "{name}: {off:e}");
        }
    }
}

/// 3.5 and 3.8 million parameters are published.
#[test]
fn the_numbers_of_parameters_are_the_published_ones() {
    let device = Device::flex();
    for (iterations, exact) in [(3, 3_519_364), (6, 3_815_044)] {
        let config = DepthNetConfig::r_msfm(iterations);
        let tensors = collect(&DepthNet::new(&config, &device).unwrap()).tensors;
        let learned = tensors
            .iter()
            .filter(|(name, _)| !name.contains(".running_"));
        let count: usize = learned.map(|(_, tensor)| tensor.values.len()).sum();
        assert_eq!(count, exact);
    }
}

#[test]
fn other_files_are_refused_by_name() {
    let device = Device::flex();
    let folder = tempfile::tempdir().unwrap();
    let files = files(folder.path(), 3);
    let mixed_up = Monodepth2Files {
        depth: files.encoder.clone(),
        ..files.clone()
    };
    let error = load_r_msfm(&mixed_up, &device).unwrap_err().to_string();
    assert!(error.contains("not R-MSFM"), "{error}");
    let change = |change: &dyn Fn(&mut Weights)| {
        let mut weights = weights::read(&files.depth).unwrap();
        change(&mut weights);
        let other = folder.path().join("other.safetensors");
        weights::write_safetensors(&other, &weights).unwrap();
        let files = Monodepth2Files {
            depth: other,
            ..files.clone()
        };
        load_r_msfm(&files, &device).unwrap_err().to_string()
    };
    // R-MSFMX reads a ResNet-50's features.
    let wide = change(&|weights| {
        let tensor = weights.tensors.get_mut("convX21.1.weight").unwrap();
        tensor.shape[1] = 256;
        tensor.values = vec![0.0; tensor.shape.iter().product()];
    });
    assert!(wide.contains("256: R-MSFMX is not known"), "{wide}");
    let short = change(&|weights| {
        weights.tensors.remove("gruc.convq2.bias");
    });
    assert!(short.contains("gru.down.candidate.bias"), "{short}");
}

/// The reference's name of a tensor of ours.
fn pytorch_name(name: &str) -> String {
    let name = name.strip_prefix("r_msfm.").unwrap();
    if name.starts_with("encoder.") {
        return format!("encoder/{name}");
    }
    let parts: Vec<&str> = name.split('.').collect();
    let last = parts[parts.len() - 1];
    let theirs = match parts[..parts.len() - 1] {
        ["features", "coarse"] => "convX31.1".into(),
        ["features", "middle"] => "convX21.1".into(),
        ["features", "fine_reduce"] => "convX11.1".into(),
        ["features", "fine"] => "convX11.4".into(),
        ["features", "context", level, strip] => {
            let level = 3 - level.parse::<usize>().unwrap();
            format!("convX{level}2.{}", if strip == "down" { 2 } else { 0 })
        }
        ["gru", strip, gate] => {
            let gate = match gate {
                "update" => "z",
                "reset" => "r",
                _ => "q",
            };
            format!("gruc.conv{gate}{}", if strip == "down" { 2 } else { 1 })
        }
        ["weights", "reduce"] => "update_block.mask.1".into(),
        ["weights", "expand"] => "update_block.mask.3".into(),
        ["update", layer] => match layer {
            "state_1" => "update_block.encoder.convc1.conv.conv".into(),
            "state_2" => "update_block.encoder.convc2.conv.conv".into(),
            "disparity_1" => "update_block.encoder.convf1.1".into(),
            "disparity_2" => "update_block.encoder.convf2.1".into(),
            "join" => "update_block.encoder.conv.conv.conv".into(),
            "change_1" => "update_block.flow_head.covd1.1".into(),
            _ => "update_block.flow_head.covd2.1".to_owned(),
        },
        _ => panic!("{name}"),
    };
    format!("depth/{theirs}.{last}")
}

#[test]
fn gradients_are_pytorchs() {
    let device = Device::flex().autodiff();
    let folder = tempfile::tempdir().unwrap();
    let net = load_r_msfm(&files(folder.path(), 6), &device)
        .unwrap()
        .depth_net;
    let loss = pattern_loss(net.forward(images("images", 3, &device)), &device);
    let expected = expected().under("training/");
    let off = values(loss.clone())[0] - expected.tensors["loss"].values[0];
    assert!(off.abs() < 1e-6, "loss off by {off:e}");
    check_gradients(&expected, gradients(&net, loss), pytorch_name);
}

/// A new network starts at its initial depth: refinements with random weights change it little. Beyond the edge the upsampling reads zeros,
/// which are far away. They affect a third of this small disparity's pixels.
#[test]
fn a_new_network_starts_at_ten_metres() {
    let device = Device::flex();
    let config = DepthNetConfig::r_msfm(6);
    let net = DepthNet::with_seed(&config, 7, &device).unwrap();
    for disparity in net.forward(images("images", 3, &device)) {
        let values = values(disparity);
        let mean = values.iter().sum::<f32>() / values.len() as f32;
        let depth = config.range.depth_m(f64::from(mean));
        assert!((5.0..30.0).contains(&depth), "{depth} m");
    }
}
