//! The networks' outputs against PyTorch, from files with the names and shapes of published ones.
//!
//! Tolerance: 1e-5 for outputs, and for features relative to their root mean square. The reference is in double precision, so the
//! difference is float32 rounding through 20 to 55 convolutions. Measured: disparities 2.3e-6 (ResNet-18; PyTorch's own float32: 3.5e-6)
//! and 4.2e-7 (ResNet-50), poses 5e-7. With the repeating weights of the `.pth` files more cancels, so rounding errors are larger.

use crate::networks::common::{images, largest_error, manifest, unpack, values, write_listed};
use burn::tensor::Device;
use deepfusion_nn::weights::{
    self, Monodepth2Files, Weights, load_monodepth2, load_torchvision_resnet,
};
use deepfusion_nn::{InputSize, ResNet, ResNetConfig, ResNetDepth, WeightRng};

const TOLERANCE: f32 = 1e-5;

fn check(expected: &Weights, name: &str, actual: &[f32], step: usize) {
    let error = largest_error(expected, name, actual, step);
    println!("{name}: {error:.2e}");
    assert!(error < TOLERANCE, "{name}: {error:e}");
}

fn check_disparities(expected: &Weights, model: &str, disparities: Vec<burn::tensor::Tensor<4>>) {
    assert_eq!(disparities.len(), 4);
    for (scale, disparity) in disparities.into_iter().enumerate() {
        let (height, width) = (
            crate::networks::common::HEIGHT >> scale,
            crate::networks::common::WIDTH >> scale,
        );
        assert_eq!(
            disparity.dims(),
            [crate::networks::common::BATCH, 1, height, width]
        );
        let step = if scale == 0 { 31 } else { 11 };
        check(
            expected,
            &format!("{model}/disparity{scale}"),
            &values(disparity),
            step,
        );
    }
}

#[test]
fn monodepth2_resnet18_from_its_four_pth_files() {
    let folder = tempfile::tempdir().unwrap();
    for file in ["encoder", "depth", "pose_encoder", "pose"] {
        unpack(&format!("{file}.pth"), folder.path());
    }
    let device = Device::flex();
    let files = Monodepth2Files::in_folder(folder.path());
    let model = load_monodepth2(&files, &device).unwrap();
    assert_eq!(model.depth_config.encoder.depth, ResNetDepth::ResNet18);
    let published = InputSize {
        width: 640,
        height: 192,
    };
    assert_eq!(model.input_size, Some(published));

    let expected = crate::networks::common::expected();
    let disparities = model.depth_net.forward(images("images", 3, &device));
    check_disparities(&expected, "monodepth2_18", disparities);

    let (config, pose_net) = model.pose.unwrap();
    assert_eq!((config.poses, config.encoder.frames), (2, 2));
    let pose = pose_net.forward(images("pair", 6, &device));
    let (axis_angle, translation) = (values(pose.axis_angle), values(pose.translation));
    // The first of two poses, both parts × 0.01.
    let raw = &expected.tensors["pose_18/raw"].values;
    for (sample, raw) in raw.chunks_exact(12).enumerate() {
        for axis in 0..3 {
            let rotation = axis_angle[3 * sample + axis] - 0.01 * raw[axis];
            let shift = translation[3 * sample + axis] - 0.01 * raw[3 + axis];
            println!("pose {sample} {axis}: {rotation:.2e} {shift:.2e}");
            assert!(rotation.abs() < TOLERANCE && shift.abs() < TOLERANCE);
        }
    }
}

#[test]
fn monodepth2_resnet50_from_safetensors() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = manifest();
    for file in ["encoder", "depth"] {
        write_listed(
            &folder.path().join(format!("{file}.safetensors")),
            &manifest[&format!("monodepth2_50/{file}")],
        );
    }
    let device = Device::flex();
    let files = Monodepth2Files::in_folder(folder.path());
    assert_eq!(files.pose, None);
    let model = load_monodepth2(&files, &device).unwrap();
    assert_eq!(model.depth_config.encoder.depth, ResNetDepth::ResNet50);
    let disparities = model.depth_net.forward(images("images", 3, &device));
    check_disparities(
        &crate::networks::common::expected(),
        "monodepth2_50",
        disparities,
    );
}

fn check_features(model: &str, features: [burn::tensor::Tensor<4>; 5]) {
    let expected = crate::networks::common::expected();
    for (level, (feature, step)) in features
        .into_iter()
        .zip([997, 499, 251, 127, 61])
        .enumerate()
    {
        check(
            &expected,
            &format!("{model}/feature{level}"),
            &values(feature),
            step,
        );
    }
}

#[test]
fn torchvision_resnet18_from_a_legacy_pth() {
    let folder = tempfile::tempdir().unwrap();
    let path = unpack("resnet18.pth", folder.path());
    let device = Device::flex();
    let config = ResNetConfig::new(ResNetDepth::ResNet18);
    let encoder = ResNet::new(&config, &mut WeightRng::new(1), &device).unwrap();
    let encoder = load_torchvision_resnet(encoder, &path).unwrap();
    check_features("resnet18", encoder.forward(images("images", 3, &device)));
}

#[test]
fn torchvision_resnet50_on_two_frames() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("resnet50.safetensors");
    write_listed(&path, &manifest()["resnet50"]);
    let device = Device::flex();
    let config = ResNetConfig::new(ResNetDepth::ResNet50).with_frames(2);
    let encoder = ResNet::new(&config, &mut WeightRng::new(1), &device).unwrap();
    let encoder = load_torchvision_resnet(encoder, &path).unwrap();
    check_features("resnet50", encoder.forward(images("pair", 6, &device)));
}

#[test]
fn the_pth_files_have_the_formulas_weights_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let listings = manifest();
    for (file, listing) in [
        ("encoder", "monodepth2_18/encoder"),
        ("depth", "monodepth2_18/depth"),
        ("pose_encoder", "pose_18/encoder"),
        ("pose", "pose_18/pose"),
        ("resnet18", "resnet18"),
    ] {
        let read = weights::read(&unpack(&format!("{file}.pth"), folder.path())).unwrap();
        let floats: Vec<_> = listings[listing]
            .iter()
            .filter(|(.., kind)| kind == "f32")
            .collect();
        assert_eq!(read.tensors.len(), floats.len(), "{file}");
        for (name, shape, _) in floats {
            let tensor = &read.tensors[name];
            assert_eq!(&tensor.shape, shape, "{file}: {name}");
            let formula = crate::networks::common::formula(
                name,
                shape,
                Some(crate::networks::common::PERIOD),
            );
            assert!(tensor.values == formula, "{file}: {name}");
        }
    }
}
