//! A network as a graph, with folded batch normalisation, has the same output as the network itself.

use burn::tensor::{Device, Tensor, TensorData};
use deepfusion_infer::{Engine, Precision};
use deepfusion_model::{depth_graph, depth_graph_with_uncertainty};
use deepfusion_nn::weights::{self, Weights};
use deepfusion_nn::{
    AttentionConfig, AttentionForm, DepthNet, DepthNetConfig, DispNetConfig, Error, HceConfig,
    LiteMonoSize, ResNetDepth,
};

/// Weights as after some training: batch norms with different statistics and factors.
fn trained(config: &DepthNetConfig) -> Weights {
    let net = DepthNet::with_seed(config, 5, &Device::flex()).unwrap();
    let mut weights = weights::collect(&net);
    for (name, tensor) in &mut weights.tensors {
        let spread = |i: usize| ((i * 37 + name.len() * 11) % 17) as f32 / 17.0;
        for (i, value) in tensor.values.iter_mut().enumerate() {
            if name.ends_with("running_mean") {
                *value = spread(i) - 0.5;
            } else if name.ends_with("running_var") {
                *value = 0.5 + spread(i);
            } else if name.contains(".bn") || name.ends_with("norm.weight") {
                *value += 0.4 * (spread(i) - 0.5);
            } else if name.ends_with("norm.bias") || name.ends_with("scale") {
                *value = 0.5 * (spread(i) - 0.5);
            } else if name.ends_with("temperature") {
                *value = 4.0 * spread(i);
            } else if name.starts_with("lite_mono.decoder.") && name.ends_with("weight") {
                *value *= 3.0;
            } else if name.starts_with("r_msfm.weights.expand") {
                // A quarter of the output is the logarithm of a weight.
                *value *= 20.0;
            } else if name.starts_with("disp_net.heads") {
                *value *= 8.0;
            } else if name.starts_with("disp_net.encoder.0.halve.bias") {
                *value = spread(i) - 0.5;
            } else if name == "r_msfm.update.change_2.weight" {
                *value *= 20.0;
            } else if name == "decoder.heads.0.weight" {
                // With new weights the output would be nearly the same everywhere.
                *value *= 40.0;
            } else if name == "decoder.heads.0.bias" {
                *value = 0.0;
            }
        }
    }
    weights
}

fn image(width: usize, height: usize) -> Vec<f32> {
    let value = |i: usize| ((i * 7919 + i / width * 31) % 256) as f32 / 255.0;
    (0..3 * width * height).map(value).collect()
}

/// Weights with Lite-Mono's finest head set so that the output for an image is neither flat nor near the sigmoid's limits.
fn with_centred_head(
    config: &DepthNetConfig,
    mut weights: Weights,
    image: &[f32],
    width: usize,
) -> Weights {
    if config.lite_mono.is_none() {
        return weights;
    }
    let names = ["weight", "bias"].map(|part| format!("lite_mono.decoder.heads.0.{part}"));
    let mut head = |factor: f32, bias: f32| {
        for (name, part) in names.iter().zip([factor, 0.0]) {
            let tensor = weights.tensors.get_mut(name).unwrap();
            tensor
                .values
                .iter_mut()
                .for_each(|v| *v = *v * part + if part == 0.0 { bias } else { 0.0 });
        }
        weights.clone()
    };
    // So small that the sigmoid is linear.
    let small = 1e-3;
    let device = Device::flex();
    let net = weights::apply(DepthNet::new(config, &device).unwrap(), &head(small, 0.0)).unwrap();
    let input = TensorData::new(image.to_vec(), [1, 3, image.len() / 3 / width, width]);
    let seen = net
        .forward(Tensor::from_data(input, &device))
        .swap_remove(0);
    let logits: Vec<f32> = seen
        .into_data()
        .iter::<f32>()
        .map(|p| (p / (1.0 - p)).ln())
        .collect();
    let n = logits.len() as f32;
    let mean = logits.iter().sum::<f32>() / n;
    let sd = (logits.iter().map(|l| (l - mean).powi(2)).sum::<f32>() / n).sqrt();
    head(1.0 / sd, -mean / sd)
}

fn check(config: &DepthNetConfig, width: usize, height: usize) {
    let image = image(width, height);
    let weights = with_centred_head(config, trained(config), &image, width);
    let device = Device::flex();
    let net = weights::apply(DepthNet::new(config, &device).unwrap(), &weights).unwrap();
    let input = TensorData::new(image.clone(), [1, 3, height, width]);
    let expected = net
        .forward(Tensor::from_data(input, &device))
        .swap_remove(0);
    let expected: Vec<f32> = expected.into_data().iter::<f32>().collect();
    let off = |precision| {
        let graph = depth_graph(config, weights.clone()).unwrap();
        let mut engine = Engine::new(graph, width, height, precision).unwrap();
        engine.run(&image);
        let output = engine.output(0);
        assert_eq!(output.len(), expected.len());
        let off = output.iter().zip(&expected).map(|(a, b)| (a - b).abs());
        let square = off.clone().map(|off| off * off).sum::<f32>() / expected.len() as f32;
        (off.fold(0.0, f32::max), square.sqrt())
    };
    let span = expected
        .iter()
        .fold((1.0, 0.0), |(low, high): (f32, f32), v| {
            (low.min(*v), high.max(*v))
        });
    assert!(
        span.1 - span.0 > 0.05,
        "a flat output would prove nothing: {span:?}"
    );
    // Sums in a different order. The error is largest for the paper's product of masks: 1.0e-4 with AVX2.
    let (f32_off, _) = off(Precision::F32);
    assert!(f32_off < 2e-4, "f32 off by {f32_off}");
    if Engine::has_bf16() {
        // Rounding to eight bits in each of some sixty layers; dot products of different processors round differently. The error is largest
        // for the paper's product of masks: 0.009 root mean square, up to 0.0025 for the others (AMD's AVX-512 BF16).
        let (most, usual) = off(Precision::Bf16);
        assert!(usual < 0.02, "bf16 off by {usual} root mean square");
        assert!(most < 0.2, "bf16 off by {most}");
    }
}

#[test]
fn a_basic_block_network() {
    check(&DepthNetConfig::new(ResNetDepth::ResNet18), 192, 96);
}

/// The uncertainty head is a second output, and depth is the same as without the head.
#[test]
fn a_network_with_an_uncertainty_head() {
    let config = DepthNetConfig {
        uncertainty: true,
        ..DepthNetConfig::new(ResNetDepth::ResNet18)
    };
    check(&config, 96, 64);
    let (mut weights, image) = (trained(&config), image(96, 64));
    let head = weights.tensors.get_mut("uncertainty.weight").unwrap();
    for value in &mut head.values {
        *value *= 40.0;
    }
    let device = Device::flex();
    let (net, is_new) = DepthNet::new(&config, &device)
        .unwrap()
        .with_weights(&weights)
        .unwrap();
    assert!(!is_new);
    let input = TensorData::new(image.clone(), [1, 3, 64, 96]);
    let seen = net.forward_with_uncertainty(Tensor::from_data(input, &device));
    let expected: Vec<f32> = seen.log_scale.unwrap().into_data().iter().collect();
    let graph = depth_graph_with_uncertainty(&config, weights.clone()).unwrap();
    let mut engine = Engine::new(graph, 96, 64, Precision::F32).unwrap();
    engine.run(&image);
    let output = engine.output(1);
    assert_eq!(output.len(), expected.len());
    let off = output.iter().zip(&expected).map(|(a, b)| (a - b).abs());
    assert!(off.fold(0.0, f32::max) < 1e-3);
    let (low, high) = expected
        .iter()
        .fold((f32::MAX, f32::MIN), |(low, high), v| {
            (low.min(*v), high.max(*v))
        });
    assert!(
        high - low > 0.05,
        "a flat output would prove nothing: {low} {high}"
    );
    // `depth_graph` has one output, as exported models have.
    let alone = depth_graph(&config, weights).unwrap();
    assert_eq!(alone.outputs().len(), 1);
}

#[test]
fn a_bottleneck_network() {
    check(&DepthNetConfig::monodepth2(ResNetDepth::ResNet50), 128, 96);
}

#[test]
fn lite_mono() {
    for size in LiteMonoSize::ALL {
        check(&DepthNetConfig::lite_mono(size), 128, 64);
    }
    let mut large = DepthNetConfig::lite_mono(LiteMonoSize::Tiny);
    large.lite_mono = large.lite_mono.map(|c| c.for_large_images());
    check(&large, 192, 96);
}

#[test]
fn r_msfm() {
    for iterations in [3, 6] {
        // Starts in the middle of the disparity range, where the output is neither flat nor near the sigmoid's limits.
        let config = DepthNetConfig {
            initial_depth_m: None,
            ..DepthNetConfig::r_msfm(iterations)
        };
        check(&config, 128, 64);
    }
}

/// At sizes for which the sixth and seventh halvings round up.
#[test]
fn disp_net() {
    let small = |base_width: usize| DepthNetConfig {
        disp_net: Some(DispNetConfig { base_width }),
        initial_depth_m: None,
        ..DepthNetConfig::disp_net()
    };
    check(&small(32), 96, 64);
    check(&small(12), 416, 128);
    let sure = DepthNetConfig {
        uncertainty: true,
        ..small(6)
    };
    check(&sure, 96, 160);
    let weights = trained(&sure);
    let both = depth_graph_with_uncertainty(&sure, weights).unwrap();
    assert_eq!(both.outputs().len(), 2);
}

#[test]
fn lite_mono_with_an_uncertainty_head() {
    let config = DepthNetConfig {
        uncertainty: true,
        ..DepthNetConfig::lite_mono(LiteMonoSize::Tiny)
    };
    check(&config, 96, 64);
    let (weights, image) = (trained(&config), image(96, 64));
    let device = Device::flex();
    let (net, _) = DepthNet::new(&config, &device)
        .unwrap()
        .with_weights(&weights)
        .unwrap();
    let input = TensorData::new(image.clone(), [1, 3, 64, 96]);
    let seen = net.forward_with_uncertainty(Tensor::from_data(input, &device));
    let expected: Vec<f32> = seen.log_scale.unwrap().into_data().iter().collect();
    let graph = depth_graph_with_uncertainty(&config, weights).unwrap();
    let mut engine = Engine::new(graph, 96, 64, Precision::F32).unwrap();
    engine.run(&image);
    let output = engine.output(1);
    assert_eq!(output.len(), expected.len());
    let off = output.iter().zip(&expected).map(|(a, b)| (a - b).abs());
    assert!(off.fold(0.0, f32::max) < 1e-4);
}

#[test]
fn a_network_with_channels_that_do_not_fill_a_vector() {
    let mut config = DepthNetConfig::new(ResNetDepth::ResNet18);
    config.encoder.base_width = 12;
    config.decoder.widths = [40, 24, 20, 10, 6];
    check(&config, 96, 64);
}

/// The paper's network, narrower. Its rate of 12 exceeds the height of the coarsest features.
fn paper() -> DepthNetConfig {
    let mut config = DepthNetConfig::paper();
    config.encoder.base_width = 24;
    config.decoder.widths = [48, 32, 24, 16, 16];
    config
}

#[test]
fn the_papers_network() {
    check(&paper(), 256, 128);
}

#[test]
fn each_part_of_the_papers_network_alone() {
    let mut plain = DepthNetConfig::new(ResNetDepth::ResNet18);
    plain.encoder.base_width = 16;
    plain.decoder.widths = [24, 16, 16, 8, 8];
    let parts: [fn(&mut DepthNetConfig); 5] = [
        |c| c.hce = paper().hce,
        |c| {
            c.hce = Some(HceConfig {
                rates: vec![2],
                global_pool: false,
                reduce_first: false,
                ..HceConfig::default()
            });
        },
        |c| {
            c.attention = Some(AttentionConfig {
                form: AttentionForm::Residual,
                ..AttentionConfig::default()
            });
        },
        |c| c.aggregation = true,
        |c| c.encoder.output_stride = 16,
    ];
    for part in parts {
        let mut config = plain.clone();
        part(&mut config);
        check(&config, 96, 64);
    }
}

#[test]
fn weights_of_another_network_are_refused_by_name() {
    let config = DepthNetConfig::new(ResNetDepth::ResNet18);
    let mut weights = trained(&config);
    weights.tensors.remove("encoder.layer2.0.bn1.running_var");
    match depth_graph(&config, weights) {
        Err(Error::MissingTensor { name, .. }) => {
            assert_eq!(name, "encoder.layer2.0.bn1.running_var");
        }
        other => panic!("{other:?}"),
    }
    let mut broken = trained(&config);
    let first = broken.tensors.get_mut("encoder.conv1.weight").unwrap();
    first.values[7] = f32::NAN;
    let error = depth_graph(&config, broken);
    assert!(
        matches!(error, Err(Error::NotFinite { count: 1, .. })),
        "{error:?}"
    );
    // ResNet-34 has all of ResNet-18's tensors, and more.
    let deeper = trained(&DepthNetConfig::new(ResNetDepth::ResNet34));
    let error = depth_graph(&config, deeper);
    assert!(
        matches!(error, Err(Error::UnexpectedTensor { .. })),
        "{error:?}"
    );
    let mut wide = config.clone();
    wide.encoder.base_width = 96;
    let shape = depth_graph(&wide, trained(&config));
    assert!(matches!(shape, Err(Error::TensorShape { .. })), "{shape:?}");
}
