//! Lite-Mono against PyTorch, from files with the names and shapes of the published ones.
//!
//! The reference (tests/reference/lite_mono.py) is in double precision, so the difference is float32 rounding. Tolerances: 1e-5 for
//! disparities, 1e-4 of a gradient's root mean square. Measured: 6e-7 and 7e-6.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]

use std::collections::BTreeMap;
use std::path::Path;

use burn::tensor::{Device, Tensor};
use deepfusion_nn::weights::{
    self, Monodepth2Files, Weights, collect, load_lite_mono, load_monodepth2,
};
use deepfusion_nn::{DepthNet, DepthNetConfig, Error, LiteMonoSize};

use crate::networks::common::{
    BATCH, HEIGHT, Listing, WIDTH, check_gradients, gradients, images, largest_difference,
    pattern_loss, reference, unpack, values, write_listed,
};

const NAMES: [(&str, LiteMonoSize); 4] = [
    ("lite-mono", LiteMonoSize::Full),
    ("lite-mono-small", LiteMonoSize::Small),
    ("lite-mono-tiny", LiteMonoSize::Tiny),
    ("lite-mono-8m", LiteMonoSize::EightM),
];

fn listings() -> BTreeMap<String, Listing> {
    let text = std::fs::read_to_string(reference("lite_mono.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

fn expected() -> Weights {
    weights::read(&reference("lite_mono.safetensors")).unwrap()
}

/// Files with the formula's weights.
fn files(folder: &Path, model: &str) -> Monodepth2Files {
    for file in ["encoder", "depth"] {
        let listing = &listings()[&format!("{model}/{file}")];
        write_listed(&folder.join(format!("{file}.safetensors")), listing);
    }
    Monodepth2Files::in_folder(folder)
}

fn check(model: &str, disparities: Vec<Tensor<4>>) {
    assert_eq!(disparities.len(), 3);
    let expected = expected();
    for (scale, disparity) in disparities.into_iter().enumerate() {
        assert_eq!(
            disparity.dims(),
            [BATCH, 1, HEIGHT >> scale, WIDTH >> scale]
        );
        let step = if scale == 0 { 31 } else { 11 };
        let name = format!("{model}/disparity{scale}");
        let (off, _) = largest_difference(&expected, &name, &values(disparity), step);
        println!("{name}: {off:.2e}");
        assert!(off < 1e-5, "{name}: {off:e}");
    }
}

#[test]
fn the_four_published_networks() {
    let device = Device::flex();
    for (model, size) in NAMES {
        let folder = tempfile::tempdir().unwrap();
        let files = files(folder.path(), model);
        let imported = load_lite_mono(&files, &device).unwrap();
        assert_eq!(
            imported.depth_config.lite_mono,
            DepthNetConfig::lite_mono(size).lite_mono
        );
        assert_eq!((imported.input_size, imported.pose.is_none()), (None, true));
        let x = images("images", 3, &device);
        check(model, imported.depth_net.forward(x));
    }
}

/// Files from torch.save, with a profiler's counters and the size beside the tensors.
#[test]
fn the_files_of_torch() {
    let folder = tempfile::tempdir().unwrap();
    let device = Device::flex();
    let files = Monodepth2Files {
        encoder: unpack("lite_mono_encoder.pth", folder.path()),
        depth: unpack("lite_mono_depth.pth", folder.path()),
        pose: None,
    };
    let counted = weights::read(&files.encoder).unwrap();
    assert!(counted.tensors.contains_key("stages.total_ops"));
    let imported = load_lite_mono(&files, &device).unwrap();
    let size = imported.input_size.unwrap();
    assert_eq!((size.width, size.height), (640, 192));
    check(
        "pth",
        imported.depth_net.forward(images("images", 3, &device)),
    );
}

/// 3.1, 2.5, 2.2 and 8.7 million parameters are published; the networks have 3.07, 2.47, 2.15 and 8.77. In a published file, each dilated
/// block has two tensors (of a layer norm) that no computation reads; they are not counted.
#[test]
fn the_numbers_of_parameters_are_the_published_ones() {
    let device = Device::flex();
    let listings = listings();
    for ((model, size), published) in NAMES.into_iter().zip([3.1e6, 2.5e6, 2.2e6, 8.7e6]) {
        let config = DepthNetConfig::lite_mono(size);
        let net = DepthNet::new(&config, &device).unwrap();
        let tensors = collect(&net).tensors;
        let learned = tensors
            .iter()
            .filter(|(name, _)| !name.contains(".running_"));
        let count: usize = learned.map(|(_, tensor)| tensor.values.len()).sum();
        let filed = ["encoder", "depth"].map(|file| &listings[&format!("{model}/{file}")]);
        let theirs = filed.into_iter().flatten().filter(|(name, _, kind)| {
            let read = !name.contains(".running_") && kind == "f32";
            let block = name.rsplit_once(".norm.").map_or("", |(block, _)| block);
            let unread = filed[0]
                .iter()
                .any(|(other, ..)| *other == format!("{block}.ddwconv.conv.weight"));
            read && !unread
        });
        let theirs: usize = theirs
            .map(|(_, shape, _)| shape.iter().product::<usize>())
            .sum();
        assert_eq!(count, theirs, "{model}");
        assert!((count as f64 / published - 1.0).abs() < 0.025, "{count}");
    }
}

#[test]
fn other_files_are_refused_by_name() {
    let device = Device::flex();
    let folder = tempfile::tempdir().unwrap();
    let files = files(folder.path(), "lite-mono-small");
    let other = load_monodepth2(&files, &device).unwrap_err();
    assert!(
        matches!(other, Error::UnknownArchitecture { .. }),
        "{other}"
    );
    let mixed_up = Monodepth2Files {
        encoder: files.depth.clone(),
        ..files.clone()
    };
    let error = load_lite_mono(&mixed_up, &device).unwrap_err();
    assert!(error.to_string().contains("not Lite-Mono"), "{error}");
    // An encoder with one block less.
    let mut weights = weights::read(&files.encoder).unwrap();
    let block = "stages.2.5.";
    weights.tensors.retain(|name, _| !name.starts_with(block));
    weights::write_safetensors(&files.encoder, &weights).unwrap();
    let error = load_lite_mono(&files, &device).unwrap_err().to_string();
    assert!(error.contains("[3, 3, 5] dilated blocks"), "{error}");
}

/// The reference's name of a tensor of ours.
fn pytorch_name(name: &str) -> String {
    let parts: Vec<&str> = name.split('.').collect();
    let rest = |from: usize| parts[from..].join(".");
    let number = |at: usize| parts[at].parse::<usize>().unwrap();
    let inner = |part: String| {
        let part = part.replace("bottleneck.expand", "pwconv1");
        let part = part.replace("bottleneck.project", "pwconv2");
        let part = part.replace("attention_norm", "norm_xca");
        let part = part.replace("attention_scale", "gamma_xca");
        let part = part.replace("attention.project", "xca.proj");
        let part = part.replace("attention.", "xca.");
        let part = part.replace("position", "pos_embd.token_projection");
        let part = part.replace("depthwise", "ddwconv.conv");
        if part == "scale" {
            "gamma".into()
        } else if let Some(part) = part.strip_prefix("bn.") {
            format!("bn1.{part}")
        } else {
            part
        }
    };
    match (parts[1], parts[2]) {
        ("encoder", "stem") if parts[4] == "bn" => {
            format!(
                "encoder/downsample_layers.0.{}.bn_gelu.{}",
                parts[3],
                rest(4)
            )
        }
        ("encoder", "stem") => format!("encoder/downsample_layers.0.{}", rest(3)),
        ("encoder", "reduce") if parts[3] == "0" => "encoder/stem2.0.conv.weight".into(),
        ("encoder", "reduce") => format!("encoder/downsample_layers.{}.0.conv.weight", parts[3]),
        ("encoder", _) if parts[4] == "dilated" => {
            format!(
                "encoder/stages.{}.{}.{}",
                parts[3],
                parts[5],
                inner(rest(6))
            )
        }
        ("encoder", _) => {
            let last = [3, 3, 6][number(3)];
            format!("encoder/stages.{}.{last}.{}", parts[3], inner(rest(5)))
        }
        (_, "heads") => format!("depth/decoder.{}.conv.{}", 6 + number(3), parts[4]),
        _ => {
            let index = 2 * number(3) + usize::from(parts[4] == "fuse");
            format!("depth/decoder.{index}.conv.conv.{}", parts[5])
        }
    }
}

#[test]
fn gradients_and_running_statistics_are_pytorchs() {
    let device = Device::flex().autodiff();
    let folder = tempfile::tempdir().unwrap();
    let files = files(folder.path(), "lite-mono-tiny");
    let net = load_lite_mono(&files, &device).unwrap().depth_net;
    let disparities = net.forward(images("images", 3, &device)).into_iter();
    let loss = pattern_loss(disparities, &device);
    let expected = expected().under("training/");
    let off = values(loss.clone())[0] - expected.tensors["loss"].values[0];
    assert!(off.abs() < 1e-6, "loss off by {off:e}");

    check_gradients(&expected, gradients(&net, loss), pytorch_name);

    let mut compared = 0;
    for (name, tensor) in collect(&net).tensors {
        if name.contains(".running_") {
            let theirs = pytorch_name(&name);
            let (off, rms) = largest_difference(&expected, &theirs, &tensor.values, 17);
            assert!(off < 1e-5 * rms.max(1.0), "{name}: {off:e}");
            compared += 1;
        }
    }
    assert_eq!(compared, 2 * (3 + 3 + 3 + 6));
}

/// A new network starts at its initial depth, at every pixel.
#[test]
fn a_new_network_starts_at_ten_metres() {
    let device = Device::flex();
    let config = DepthNetConfig::lite_mono(LiteMonoSize::Tiny);
    let net = DepthNet::with_seed(&config, 7, &device).unwrap();
    for disparity in net.forward(images("images", 3, &device)) {
        for sigmoid in values(disparity) {
            let depth = config.range.depth_m(f64::from(sigmoid));
            assert!((5.0..20.0).contains(&depth), "{depth} m");
        }
    }
}
