//! Weights written to files and read back, and files that do not fit.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]

use std::fs;

use crate::networks::common::{images, manifest, unpack, values};
use burn::module::Module;
use burn::tensor::Device;
use deepfusion_hint::Hint;
use deepfusion_nn::weights::{
    self, Monodepth2Files, WeightTensor, Weights, load_monodepth2, load_torchvision_resnet,
};
use deepfusion_nn::{
    DepthNet, DepthNetConfig, Error, PoseNet, PoseNetConfig, ResNet, ResNetConfig, ResNetDepth,
    WeightRng,
};

fn tiny_config() -> DepthNetConfig {
    let mut config = DepthNetConfig::new(ResNetDepth::ResNet18);
    config.encoder.base_width = 4;
    config.decoder.widths = [8, 8, 4, 4, 4];
    config
}

fn tiny(seed: u64) -> DepthNet {
    let device = Device::flex().autodiff();
    DepthNet::with_seed(&tiny_config(), seed, &device).unwrap()
}

#[test]
fn a_network_is_written_and_read_bit_for_bit() {
    let device = Device::flex().autodiff();
    let net = tiny(1);
    net.forward(images("images", 3, &device)); // Changes the running statistics from 0 and 1.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("weights.safetensors");
    let mut saved = weights::collect(&net);
    saved.metadata.insert("format".into(), "1".into());
    weights::write_safetensors(&path, &saved).unwrap();
    assert_eq!(
        fs::read_dir(folder.path()).unwrap().count(),
        1,
        "no other file is left"
    );

    let read = weights::read(&path).unwrap();
    assert!(read.tensors == saved.tensors);
    assert_eq!(read.metadata["format"], "1");
    let bytes = fs::read(&path).unwrap();
    let in_memory = weights::read_bytes("in memory", &bytes).unwrap();
    assert!(in_memory.tensors == saved.tensors);
    assert_eq!(in_memory.origin, "in memory");
    for length in [0, 7, 8, 100, bytes.len() - 1] {
        let error = weights::read_bytes("in memory", &bytes[..length]).unwrap_err();
        assert!(error.to_string().contains("in memory"), "{error}");
    }
    assert_eq!(read.value_count(), net.num_params());

    let loaded = weights::apply(tiny(2), &read).unwrap();
    assert!(weights::collect(&loaded).tensors == saved.tensors);
    let x = images("images", 3, &device);
    // In training mode, with gradients: the loaded parameters can still learn.
    let output = loaded.forward(x.clone()).swap_remove(0);
    assert_eq!(
        values(output.clone()),
        values(net.forward(x).swap_remove(0))
    );
    let gradients = output.mean().backward();
    assert!(
        loaded
            .encoder
            .unwrap()
            .conv1
            .weight
            .val()
            .grad(&gradients)
            .is_some()
    );
}

#[test]
fn names_are_torchvisions() {
    let device = Device::flex();
    let listings = manifest();
    for (depth, file) in [
        (ResNetDepth::ResNet18, "resnet18"),
        (ResNetDepth::ResNet50, "resnet50"),
    ] {
        let config = ResNetConfig::new(depth);
        let encoder = ResNet::new(&config, &mut WeightRng::new(0), &device).unwrap();
        let mut ours: Vec<_> = weights::collect(&encoder)
            .tensors
            .into_iter()
            .map(|(name, tensor)| (name, tensor.shape))
            .collect();
        let mut theirs: Vec<_> = listings[file]
            .iter()
            .filter(|(name, _, kind)| kind == "f32" && !name.starts_with("fc."))
            .map(|(name, shape, _)| (name.clone(), shape.clone()))
            .collect();
        ours.sort();
        theirs.sort();
        assert_eq!(ours, theirs);
    }
}

fn full_of(change: impl FnOnce(&mut Weights)) -> Error {
    let mut saved = weights::collect(&tiny(1));
    saved.origin = "some.safetensors".into();
    change(&mut saved);
    weights::apply(tiny(1), &saved).unwrap_err()
}

#[test]
fn a_missing_tensor_is_named() {
    let error = full_of(|w| {
        w.tensors.remove("encoder.layer1.0.bn1.running_mean");
        w.tensors.remove("decoder.heads.2.bias");
    });
    assert_eq!(
        error.to_string(),
        "some.safetensors: tensor `encoder.layer1.0.bn1.running_mean` [4] is missing (and 1 more)"
    );
    assert!(error.hint().is_some());
}

#[test]
fn an_unexpected_tensor_is_named() {
    let extra = WeightTensor {
        shape: vec![2],
        values: vec![0.0; 2],
    };
    let error = full_of(|w| {
        w.tensors.insert("decoder.extra".into(), extra);
    });
    assert_eq!(
        error.to_string(),
        "some.safetensors: tensor `decoder.extra` [2] is not part of this network"
    );
}

#[test]
fn a_wrong_shape_is_named_with_the_expected_one() {
    let error = full_of(|w| {
        w.tensors.get_mut("encoder.conv1.weight").unwrap().shape = vec![4, 3, 49];
    });
    assert_eq!(
        error.to_string(),
        "some.safetensors: tensor `encoder.conv1.weight` has shape [4, 3, 49], expected [4, 3, 7, 7]"
    );
}

#[test]
fn values_that_are_not_finite_are_refused() {
    let error = full_of(|w| {
        w.tensors.get_mut("encoder.bn1.weight").unwrap().values[2] = f32::NAN;
    });
    assert_eq!(
        error.to_string(),
        "some.safetensors: tensor `encoder.bn1.weight` has 1 value that is not finite"
    );
}

#[test]
fn files_that_are_not_weights_are_refused_with_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("weights.safetensors");
    let reason = |bytes: &[u8]| {
        fs::write(&path, bytes).unwrap();
        let error = weights::read(&path).unwrap_err();
        assert!(matches!(error, Error::Format { .. }), "{error}");
        assert!(error.to_string().contains("weights.safetensors"), "{error}");
        error.to_string()
    };
    assert!(reason(b"").contains("empty"));
    assert!(reason(b"<!DOCTYPE html>").contains("it starts with the bytes [3c, 21"));
    reason(b"PK\x03\x04 but no archive");
    reason(b"\x80\x02 but no pickle");
    reason(b"\x40\x00\x00\x00\x00\x00\x00\x00{\"a\":");
    let missing = weights::read(&folder.path().join("nowhere.pth")).unwrap_err();
    assert!(matches!(missing, Error::NoSuchFile { .. }));
}

#[test]
fn files_cut_short_are_refused_wherever_the_cut_is() {
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole.safetensors");
    weights::write_safetensors(&whole, &weights::collect(&tiny(1))).unwrap();
    let pth = unpack("pose.pth", folder.path());
    for path in [whole, pth] {
        let bytes = fs::read(&path).unwrap();
        for share in [0.0001, 0.01, 0.3, 0.7, 0.9999] {
            let cut = folder.path().join("cut");
            fs::write(&cut, &bytes[..(bytes.len() as f64 * share) as usize]).unwrap();
            let error = weights::read(&cut).unwrap_err();
            assert!(matches!(error, Error::Format { .. }), "{share}: {error}");
        }
    }
}

#[test]
fn a_failed_write_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    // There is a folder of that name: everything is written, but the renaming at the end fails.
    let path = folder.path().join("taken");
    fs::create_dir(&path).unwrap();
    fs::write(path.join("inside"), "x").unwrap();
    let error = weights::write_safetensors(&path, &weights::collect(&tiny(1))).unwrap_err();
    assert!(error.to_string().contains("taken"), "{error}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);

    let nowhere = folder.path().join("no/such/folder/weights.safetensors");
    let error = weights::write_safetensors(&nowhere, &weights::collect(&tiny(1))).unwrap_err();
    assert!(matches!(error, Error::Io { .. }), "{error}");
}

#[test]
fn weights_of_another_architecture_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let device = Device::flex();
    let resnet18 = unpack("resnet18.pth", folder.path());
    let config = ResNetConfig::new(ResNetDepth::ResNet34);
    let encoder = ResNet::new(&config, &mut WeightRng::new(0), &device).unwrap();
    let error = load_torchvision_resnet(encoder, &resnet18).unwrap_err();
    assert!(matches!(error, Error::MissingTensor { .. }), "{error}");
    assert!(error.hint().unwrap().contains("same architecture"));

    let pose = unpack("pose.pth", folder.path());
    let config = ResNetConfig::new(ResNetDepth::ResNet18);
    let encoder = ResNet::new(&config, &mut WeightRng::new(0), &device).unwrap();
    let error = load_torchvision_resnet(encoder, &pose).unwrap_err();
    assert!(
        matches!(error, Error::UnknownArchitecture { .. }),
        "{error}"
    );

    // Monodepth2's files mixed up: the pose decoder in place of the depth decoder.
    let files = Monodepth2Files {
        encoder: unpack("encoder.pth", folder.path()),
        depth: pose,
        pose: None,
    };
    let error = load_monodepth2(&files, &device).unwrap_err();
    assert!(matches!(error, Error::UnexpectedTensor { .. }), "{error}");
    assert!(error.to_string().contains("`net.0.bias`"), "{error}");
}

#[test]
fn a_pose_encoder_of_one_frame_is_an_error_not_a_panic() {
    let folder = tempfile::tempdir().unwrap();
    let files = Monodepth2Files {
        encoder: unpack("encoder.pth", folder.path()),
        depth: unpack("depth.pth", folder.path()),
        pose: Some((
            folder.path().join("encoder.pth"),
            unpack("pose.pth", folder.path()),
        )),
    };
    let error = load_monodepth2(&files, &Device::flex()).unwrap_err();
    assert!(matches!(error, Error::Config { .. }), "{error}");
}

#[test]
fn the_pose_factor_is_metres_per_unit() {
    let device = Device::flex();
    let mut config = PoseNetConfig::new(ResNetDepth::ResNet18);
    config.encoder.base_width = 4;
    let x = images("pair", 6, &device);
    let one = PoseNet::new(&config, &device).unwrap().forward(x.clone());
    config.metres_per_unit = 0.5;
    let half = PoseNet::new(&config, &device).unwrap().forward(x);
    assert_eq!(values(one.axis_angle), values(half.axis_angle));
    assert_eq!(
        values(one.translation.mul_scalar(0.5)),
        values(half.translation)
    );
}

#[test]
fn a_listed_file_of_other_precision_is_read_as_f32() {
    use safetensors::tensor::{Dtype, TensorView};
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mixed.safetensors");
    let double: Vec<u8> = [0.5_f64, -2.0]
        .iter()
        .flat_map(|v| v.to_le_bytes())
        .collect();
    let half: Vec<u8> = [0x3C00_u16, 0xC000]
        .iter()
        .flat_map(|v| v.to_le_bytes())
        .collect(); // 1, −2
    let brain: Vec<u8> = [0x3F80_u16, 0xC040]
        .iter()
        .flat_map(|v| v.to_le_bytes())
        .collect(); // 1, −3
    let views = [
        (
            "double",
            TensorView::new(Dtype::F64, vec![2], &double).unwrap(),
        ),
        ("half", TensorView::new(Dtype::F16, vec![2], &half).unwrap()),
        (
            "brain",
            TensorView::new(Dtype::BF16, vec![2], &brain).unwrap(),
        ),
    ];
    safetensors::serialize_to_file(views, None, &path).unwrap();
    let read = weights::read(&path).unwrap();
    assert_eq!(read.tensors["double"].values, [0.5, -2.0]);
    assert_eq!(read.tensors["half"].values, [1.0, -2.0]);
    assert_eq!(read.tensors["brain"].values, [1.0, -3.0]);
}

proptest::proptest! {
    /// Whatever bytes a file has, reading it returns weights or an error that names the file.
    #[test]
    fn damaged_files_never_panic(
        hits in proptest::collection::vec((proptest::prelude::any::<u16>(), proptest::prelude::any::<u8>()), 1..8),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("damaged.safetensors");
        let mut weights = Weights::new("small");
        for name in ["a.weight", "a.bias"] {
            let tensor = WeightTensor { shape: vec![2, 2], values: vec![1.0; 4] };
            weights.tensors.insert(name.into(), tensor);
        }
        weights::write_safetensors(&path, &weights).unwrap();
        let mut bytes = fs::read(&path).unwrap();
        for (place, value) in hits {
            let place = usize::from(place) % bytes.len();
            bytes[place] = value;
        }
        fs::write(&path, bytes).unwrap();
        if let Err(error) = weights::read(&path) {
            proptest::prop_assert!(error.to_string().contains("damaged.safetensors"), "{}", error);
        }
    }
}
