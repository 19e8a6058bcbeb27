use super::*;
use crate::weights::{self, WeightTensor};
use burn::tensor::Distribution;

const CHANNELS: [usize; 5] = [4, 8, 16, 32, 64];

fn features(height: usize, width: usize, device: &Device) -> [Tensor<4>; 5] {
    std::array::from_fn(|k| {
        let size = [2, CHANNELS[k], height >> (k + 1), width >> (k + 1)];
        Tensor::random(size, Distribution::Normal(0.0, 1.0), device)
    })
}

fn decoder(config: &FlowDecoderConfig, channels: [usize; 5], device: &Device) -> FlowDecoder {
    let decoder = FlowDecoder::new(config, channels, &mut WeightRng::new(1), device);
    decoder.unwrap()
}

fn largest(t: Tensor<4>) -> f32 {
    t.abs().max().into_scalar()
}

/// Down to 64×64, where the coarsest level has 4×4 pixels and a radius of 4 always reaches beyond it.
#[test]
fn a_new_decoders_flow_is_zero_at_every_size_and_learns() {
    let device = Device::flex().autodiff();
    let decoder = decoder(&FlowDecoderConfig::default(), CHANNELS, &device);
    for (height, width) in [(64, 64), (96, 320), (160, 64)] {
        let (first, second) = (
            features(height, width, &device),
            features(height, width, &device),
        );
        let [there, back] = decoder.forward_both(&first, &second);
        for output in [there.clone(), back, decoder.forward(&first, &second)] {
            assert_eq!(output.flow.dims(), [2, 2, height, width]);
            for (level, stride) in output.levels.iter().zip([16, 8, 4]) {
                assert_eq!(level.dims(), [2, 2, height / stride, width / stride]);
            }
            assert_eq!(largest(output.flow), 0.0);
        }
        // The decoder must be able to learn from its start at zero: every level's last convolution has a gradient.
        let gradients = there.flow.sub_scalar(1.0).abs().mean().backward();
        for level in &decoder.levels {
            let gradient = level.output.weight.val().grad(&gradients).unwrap();
            let size: f32 = gradient.abs().max().into_scalar();
            assert!(size.is_finite() && size > 0.0);
        }
    }
}

#[test]
fn tensors_have_stable_names() {
    let config = FlowDecoderConfig {
        radius: 1,
        feature_width: 6,
        widths: vec![5, 7],
    };
    let names = weights::collect(&decoder(&config, CHANNELS, &Device::flex())).tensors;
    let shape = |name: &str| names[name].shape.clone();
    assert_eq!(shape("levels.0.project.weight"), [6, 32, 1, 1]);
    assert_eq!(shape("levels.1.project.weight"), [6, 16, 1, 1]);
    assert_eq!(shape("levels.2.project.bias"), [6]);
    assert_eq!(shape("levels.2.hidden.0.weight"), [5, 9 + 6 + 2, 3, 3]);
    assert_eq!(shape("levels.2.hidden.1.bias"), [7]);
    assert_eq!(shape("levels.2.output.weight"), [2, 7, 3, 3]);
    assert_eq!(names.len(), 3 * 8);
}

/// Sets the middle of a kernel.
fn set(weight: &mut WeightTensor, [out, channel]: [usize; 2], value: f32) {
    let area = weight.shape[2] * weight.shape[3];
    weight.values[(out * weight.shape[1] + channel) * area + area / 2] = value;
}

/// Weights set by hand so that the output is the displacement whose correlation is near 1.
fn matcher(config: &FlowDecoderConfig, channels: [usize; 5], device: &Device) -> FlowDecoder {
    let side = 2 * config.radius + 1;
    let decoder = decoder(config, channels, device);
    let mut by_hand = weights::collect(&decoder);
    for tensor in by_hand.tensors.values_mut() {
        tensor.values.fill(0.0);
    }
    for level in 0..FLOW_LEVELS {
        let mut edit = |name: &str, edit: &dyn Fn(&mut WeightTensor)| {
            let name = format!("levels.{level}.{name}");
            edit(by_hand.tensors.get_mut(&name).unwrap());
        };
        edit("project.weight", &|project| {
            (0..config.feature_width).for_each(|c| set(project, [c, c], 1.0));
        });
        // ELU(20·corr − 16): 4 at a match, nearly −1 elsewhere. The −1s cancel except for the match's own.
        edit("hidden.0.bias", &|bias| bias.values.fill(-16.0));
        edit("hidden.0.weight", &|hidden| {
            (0..side * side).for_each(|d| set(hidden, [d, d], 20.0));
        });
        edit("output.weight", &|output| {
            let by = |index: usize| (index as f32 - config.radius as f32) / 5.0;
            for d in 0..side * side {
                set(output, [0, d], by(d % side));
                set(output, [1, d], by(d / side));
            }
        });
    }
    weights::apply(decoder, &by_hand).unwrap()
}

/// `t` moved by (u, v) pixels, with zeros where no pixel moved to.
fn moved(t: &Tensor<4>, [u, v]: [i64; 2]) -> Tensor<4> {
    let [_, _, height, width] = t.dims();
    let margin = |by: i64| (by.max(0) as usize, (-by).max(0) as usize);
    let ((left, right), (top, bottom)) = (margin(u), margin(v));
    let padded = t.clone().pad(
        (left, right, top, bottom),
        burn::tensor::ops::PadMode::Constant(0.0),
    );
    padded.narrow(2, bottom, height).narrow(3, right, width)
}

/// Everything moves 16 pixels to the right and 32 up, which is (1, −2) at the coarsest level. That level must find it with the right signs,
/// and the finer ones must find nothing more after warping.
#[test]
fn the_flow_leads_from_the_first_frame_to_the_second() {
    let device = Device::flex();
    device.seed(3);
    let config = FlowDecoderConfig {
        radius: 2,
        feature_width: 64,
        widths: vec![25],
    };
    let channels = [1, 64, 64, 64, 1];
    let (height, width) = (160, 192);
    let first: [Tensor<4>; 5] = std::array::from_fn(|k| {
        let size = [1, channels[k], height >> (k + 1), width >> (k + 1)];
        Tensor::random(size, Distribution::Normal(0.0, 1.0), &device)
    });
    let second = std::array::from_fn(|k| {
        let by = |pixels: i64| pixels >> (k + 1);
        moved(&first[k], [by(16), by(-32)])
    });
    let decoder = matcher(&config, channels, &device);
    let output = decoder.forward(&first, &second);
    // Away from the border, where the match lies outside the image.
    let inside = |flow: Tensor<4>, axis: usize| -> f32 {
        let flow = flow.narrow(1, axis, 1).narrow(2, 64, 64).narrow(3, 32, 96);
        let deviation = flow.clone().sub_scalar([16.0, -32.0][axis]);
        deviation.abs().max().into_scalar()
    };
    for axis in [0, 1] {
        let error = inside(output.flow.clone(), axis);
        assert!(error < 0.5, "axis {axis}: {error} pixels off");
    }
}

#[test]
fn invalid_configs_are_refused_by_field() {
    let field = |change: fn(&mut FlowDecoderConfig)| {
        let mut config = FlowDecoderConfig::default();
        change(&mut config);
        match config.validate() {
            Err(Error::Config { field, .. }) => field,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(field(|c| c.radius = 0), "flow_decoder.radius");
    assert_eq!(field(|c| c.feature_width = 0), "flow_decoder.feature_width");
    assert_eq!(field(|c| c.widths.clear()), "flow_decoder.widths");
    assert_eq!(field(|c| c.widths[1] = 0), "flow_decoder.widths");
    let config: FlowDecoderConfig = serde_json::from_str(r#"{"radius": 3}"#).unwrap();
    assert_eq!((config.radius, config.widths.len()), (3, 3));
}
