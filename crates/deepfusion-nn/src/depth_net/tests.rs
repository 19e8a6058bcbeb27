use super::*;
use crate::{AttentionConfig, HceConfig, InputSize, ResNetDepth};
use deepfusion_hint::Hint;

#[test]
fn sizes_that_do_not_halve_five_times_are_refused_with_the_nearest_valid_one() {
    assert!(InputSize::new(640, 192).is_ok());
    let error = InputSize::new(1242, 375).unwrap_err();
    assert!(error.to_string().contains("1242x375"), "{error}");
    assert_eq!(
        error.hint().as_deref(),
        Some("the nearest valid size is 1248x384")
    );
    assert!(InputSize::new(64, 32).is_err());
}

#[test]
fn a_config_without_the_optional_fields_is_the_published_network() {
    let config: DepthNetConfig =
        serde_json::from_str(r#"{"encoder": {"depth": "resnet18"}, "initial_depth_m": 10.0}"#)
            .unwrap();
    assert_eq!(config, DepthNetConfig::new(ResNetDepth::ResNet18));
}

/// A network with the uncertainty head can start from one without, and the other way round; depth is the same either way.
#[test]
fn the_uncertainty_head_can_be_added_and_left_out() {
    let device = Device::flex();
    let mut plain = DepthNetConfig::new(ResNetDepth::ResNet18);
    plain.encoder.base_width = 8;
    plain.decoder.widths = [8; 5];
    let sure = DepthNetConfig {
        uncertainty: true,
        ..plain.clone()
    };
    let build = |config: &DepthNetConfig, seed| DepthNet::with_seed(config, seed, &device).unwrap();
    let image = Tensor::<4>::ones([1, 3, 64, 96], &device).mul_scalar(0.5);
    let depth = |net: &DepthNet| {
        let seen = net.forward_with_uncertainty(image.clone());
        let values: Vec<f32> = seen.disparities[0].clone().into_data().iter().collect();
        (values, seen.log_scale.map(|b| b.dims()))
    };
    let old = build(&plain, 3);
    let expected = depth(&old);
    assert_eq!(expected.1, None);
    let old = crate::weights::collect(&old);
    let (grown, is_new) = build(&sure, 4).with_weights(&old).unwrap();
    assert!(is_new);
    assert_eq!(depth(&grown), (expected.0.clone(), Some([1, 1, 64, 96])));
    let (cut, is_new) = build(&plain, 5)
        .with_weights(&crate::weights::collect(&grown))
        .unwrap();
    assert!(!is_new);
    assert_eq!(depth(&cut), expected);
    // The same seed draws the same network with or without the head.
    let drawn = build(&sure, 3).with_weights(&old).unwrap().0;
    assert_eq!(depth(&drawn).0, depth(&build(&sure, 3)).0);
    // Weights that lack anything else are still refused.
    let mut lacking = old;
    lacking.tensors.remove("decoder.heads.0.bias");
    assert!(build(&sure, 4).with_weights(&lacking).is_err());
}

/// Every part has a switch of its own, and a part that is off has no tensors.
#[test]
fn each_part_has_its_own_switch() {
    let device = Device::flex();
    let image = Tensor::<4>::ones([1, 3, 64, 96], &device).mul_scalar(0.5);
    let names = |config: &DepthNetConfig| {
        let net = DepthNet::new(config, &device).unwrap();
        let disparities = net.forward(image.clone());
        for (s, disparity) in disparities.iter().enumerate() {
            assert_eq!(disparity.dims(), [1, 1, 64 >> s, 96 >> s]);
        }
        crate::weights::collect(&net).tensors
    };
    let mut plain = DepthNetConfig::new(ResNetDepth::ResNet18);
    plain.encoder.base_width = 8;
    plain.decoder.widths = [8; 5];
    let without = names(&plain);
    let prefixes = ["hce.", "attention.", "aggregation."];
    let parts: [fn(&mut DepthNetConfig); 4] = [
        |c| c.hce = Some(HceConfig::default()),
        |c| c.attention = Some(AttentionConfig::default()),
        |c| c.aggregation = true,
        |c| c.encoder.output_stride = 16,
    ];
    for (i, part) in parts.iter().enumerate() {
        let mut config = plain.clone();
        part(&mut config);
        let with = names(&config);
        for (k, prefix) in prefixes.iter().enumerate() {
            let there = with.keys().any(|name| name.starts_with(prefix));
            assert_eq!(there, k == i, "{prefix} in part {i}");
        }
        // The encoder's weights are the same, whether dilated or not.
        for (name, tensor) in without.iter().filter(|(n, _)| n.starts_with("encoder.")) {
            assert!(with[name] == *tensor, "{name}");
        }
    }
    for prefix in prefixes {
        assert!(!without.keys().any(|name| name.starts_with(prefix)));
    }
}

#[test]
fn the_papers_config_survives_its_file() {
    let config = DepthNetConfig::paper();
    config.validate().unwrap();
    assert_eq!(config.decoder_channels(), [64, 64, 128, 256, 512]);
    let text = serde_json::to_string(&config).unwrap();
    assert_eq!(
        serde_json::from_str::<DepthNetConfig>(&text).unwrap(),
        config
    );
}

#[test]
fn invalid_configs_are_refused_by_field() {
    let good = DepthNetConfig::new(ResNetDepth::ResNet18);
    let field = |change: fn(&mut DepthNetConfig)| {
        let mut config = good.clone();
        change(&mut config);
        match config.validate() {
            Err(Error::Config { field, .. }) => field,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(field(|c| c.encoder.base_width = 0), "encoder.base_width");
    assert_eq!(field(|c| c.encoder.frames = 2), "encoder.frames");
    assert_eq!(
        field(|c| c.encoder.output_stride = 8),
        "encoder.output_stride"
    );
    assert_eq!(field(|c| c.encoder.multi_grid[1] = 0), "encoder.multi_grid");
    let hce = |change: fn(&mut HceConfig)| {
        let mut config = HceConfig::default();
        change(&mut config);
        config
    };
    let mut config = good.clone();
    config.hce = Some(hce(|c| c.rates = vec![3, 0]));
    assert!(
        config
            .validate()
            .unwrap_err()
            .to_string()
            .contains("hce.rates")
    );
    config.hce = Some(hce(|c| c.width_divisor = 0));
    let error = config.validate().unwrap_err().to_string();
    assert!(error.contains("hce.width_divisor"), "{error}");
    config.hce = Some(hce(|c| c.min_width = 0));
    assert!(
        config
            .validate()
            .unwrap_err()
            .to_string()
            .contains("hce.min_width")
    );
    config.hce = None;
    config.attention = Some(AttentionConfig {
        kernel: 6,
        ..AttentionConfig::default()
    });
    let error = config.validate().unwrap_err().to_string();
    assert!(error.contains("attention.kernel"), "{error}");
    assert_eq!(field(|c| c.decoder.widths[4] = 0), "decoder.widths");
    assert_eq!(field(|c| c.range.min_m = f64::NAN), "range");
    assert_eq!(field(|c| c.initial_depth_m = Some(95.0)), "initial_depth_m");
    assert!(good.validate().is_ok());
}
