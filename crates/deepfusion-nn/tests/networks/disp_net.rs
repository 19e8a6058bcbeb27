//! SfMLearner's DispNet against PyTorch, from a file with the names and shapes of the usual one.
//!
//! The reference (tests/reference/sfmlearner.py) is in double precision, so the difference is float32 rounding. Tolerances: 1e-5 for
//! disparities, 1e-4 of a gradient's root mean square. The sixth and seventh halvings of its images round up.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use burn::tensor::Device;
use deepfusion_nn::weights::{self, WeightTensor, Weights, collect, load_disp_net};
use deepfusion_nn::{DepthNet, DepthNetConfig, InputNormalisation};

use crate::networks::common::{
    BATCH, HEIGHT, Listing, WIDTH, check_gradients, gradients, images, largest_difference,
    pattern_loss, reference, values, write_listed,
};

fn listing() -> Listing {
    let text = std::fs::read_to_string(reference("sfmlearner.json")).unwrap();
    let mut all: BTreeMap<String, Listing> = serde_json::from_str(&text).unwrap();
    all.remove("dispnet").unwrap()
}

fn expected() -> Weights {
    weights::read(&reference("sfmlearner.safetensors")).unwrap()
}

/// A file with the formula's weights.
fn file(folder: &Path) -> PathBuf {
    let path = folder.join("dispnet_model_best.safetensors");
    write_listed(&path, &listing());
    path
}

#[test]
fn the_published_network() {
    let device = Device::flex();
    let folder = tempfile::tempdir().unwrap();
    let imported = load_disp_net(&file(folder.path()), &device).unwrap();
    assert_eq!((imported.input_size, imported.pose.is_none()), (None, true));
    let config = &imported.depth_config;
    assert_eq!(config.encoder.normalisation, InputNormalisation::Centred);
    // 10·σ + 0.01.
    for (sigmoid, disparity) in [(0.0, 0.01), (0.25, 2.51), (1.0, 10.01)] {
        assert!((config.range.disparity(sigmoid) - disparity).abs() < 1e-6);
    }
    let disparities = imported.depth_net.forward(images("images", 3, &device));
    assert_eq!(disparities.len(), 4);
    let expected = expected();
    for (scale, disparity) in disparities.into_iter().enumerate() {
        let size = [BATCH, 1, HEIGHT >> scale, WIDTH >> scale];
        assert_eq!(disparity.dims(), size);
        let name = format!("disparity{scale}");
        let (off, _) = largest_difference(&expected, &name, &values(disparity), 31);
        println!("{name}: {off:.2e}");
        assert!(off < 1e-5, "{name}: {off:e}");
    }
}

/// PyTorch counts the same number.
#[test]
fn the_number_of_parameters_is_the_published_one() {
    let device = Device::flex();
    let config = DepthNetConfig::disp_net();
    let net = DepthNet::new(&config, &device).unwrap();
    assert_eq!(collect(&net).value_count(), 31_596_900);
}

fn write(folder: &Path, names: &[(&str, &[usize])]) -> PathBuf {
    let mut weights = Weights::new("a test");
    for (name, shape) in names {
        let values = vec![0.0; shape.iter().product()];
        let shape = shape.to_vec();
        let tensor = WeightTensor { shape, values };
        weights.tensors.insert((*name).to_owned(), tensor);
    }
    let path = folder.join("other.safetensors");
    weights::write_safetensors(&path, &weights).unwrap();
    path
}

#[test]
fn other_files_are_refused_by_name() {
    let device = Device::flex();
    let folder = tempfile::tempdir().unwrap();
    let refused = |names: &[(&str, &[usize])]| {
        let path = write(folder.path(), names);
        load_disp_net(&path, &device).unwrap_err().to_string()
    };
    let head = ("predict_disp1.0.weight", [1, 16, 3, 3].as_slice());
    let pose = refused(&[("conv1.0.weight", &[16, 9, 7, 7])]);
    assert!(pose.contains("not DispNet"), "{pose}");
    let short = refused(&[head]);
    assert!(short.contains("encoder.0.halve.weight"), "{short}");
    let strange = refused(&[head, ("upconv8.0.bias", &[512])]);
    assert!(strange.contains("upconv8.0.bias"), "{strange}");
    let wide = refused(&[("predict_disp1.0.weight", &[1, 32, 3, 3])]);
    assert!(wide.contains("heads.0.weight"), "{wide}");
}

/// Training programs save weights beside an epoch and an optimiser's state, which has tensors, too.
#[test]
fn weights_are_found_beside_an_optimisers_state() {
    for name in ["state_dict.pth", "state_dict_legacy.pth"] {
        let weights = weights::read(&reference(name)).unwrap();
        let names: Vec<_> = weights.tensors.keys().collect();
        assert_eq!(names, ["conv1.0.weight"], "{name}");
        let tensor = &weights.tensors["conv1.0.weight"];
        assert_eq!(tensor.shape, [2, 3]);
        assert_eq!(tensor.values, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    }
}

/// The reference's name of a tensor of ours.
fn pytorch_name(name: &str) -> String {
    let parts: Vec<&str> = name.split('.').collect();
    let level = |text: &str| text.parse::<usize>().unwrap();
    match parts[..] {
        ["disp_net", "encoder", k, part, kind] => {
            let place = if part == "halve" { 0 } else { 2 };
            format!("conv{}.{place}.{kind}", level(k) + 1)
        }
        ["disp_net", "decoder", s, "enlarge", kind] => format!("upconv{}.0.{kind}", 7 - level(s)),
        ["disp_net", "decoder", s, "join", kind] => format!("iconv{}.0.{kind}", 7 - level(s)),
        ["disp_net", "heads", k, kind] => format!("predict_disp{}.0.{kind}", level(k) + 1),
        _ => panic!("{name}"),
    }
}

#[test]
fn gradients_are_pytorchs() {
    let device = Device::flex().autodiff();
    let folder = tempfile::tempdir().unwrap();
    let net = load_disp_net(&file(folder.path()), &device)
        .unwrap()
        .depth_net;
    let expected = expected().under("training/");
    // The images at which no ReLU is so close to its kink that rounding decides.
    let clear = format!("images{}", expected.tensors["images"].values[0]);
    let loss = pattern_loss(net.forward(images(&clear, 3, &device)), &device);
    let off = values(loss.clone())[0] - expected.tensors["loss"].values[0];
    assert!(off.abs() < 1e-6, "loss off by {off:e}");
    check_gradients(&expected, gradients(&net, loss), pytorch_name);
}

/// A new network starts at its initial depth: the heads' biases outweigh the random weights.
#[test]
fn a_new_network_starts_at_ten_metres() {
    let device = Device::flex();
    let config = DepthNetConfig::disp_net();
    let net = DepthNet::with_seed(&config, 7, &device).unwrap();
    for disparity in net.forward(images("images", 3, &device)) {
        for value in values(disparity) {
            let depth = config.range.depth_m(f64::from(value));
            assert!((5.0..20.0).contains(&depth), "{depth} m");
        }
    }
}
