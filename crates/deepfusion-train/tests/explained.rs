//! Explainability masks: which frame they belong to, what they weight, and what keeps them from vanishing.

use crate::support::{drive, small_without_data};
use burn::module::Param;
use burn::tensor::{Device, Tensor, TensorData};
use deepfusion_data::{Dataset, OpenOptions};
use deepfusion_model::{Error, LossConfig, PoseNetConfig};
use deepfusion_train::{
    BatchLoader, BatchLoss, ForwardPass, Model, Preset, Reprojection, SampleSet, Schedule,
    SnippetBatch, TrainConfig, ViewMotion,
};

/// A small network with explainability masks, for three frames at 96×64.
fn settings() -> TrainConfig {
    let mut config = small_without_data(1);
    (config.batch, config.frames) = (1, vec![-1, 1]);
    config.reprojection = Reprojection::Mean;
    (config.loss.ssim_weight, config.loss.automask) = (0.0, false);
    config.view_motion = ViewMotion::PoseNet;
    config.pose_net.metres_per_unit = 0.8;
    (config.pose_net.explainability, config.loss.explainability) = (true, 0.2);
    config.validate().unwrap();
    config
}

fn snippet(config: &TrainConfig) -> SnippetBatch {
    let folder = tempfile::tempdir().unwrap();
    let drive = drive(folder.path(), 6);
    let datasets = Dataset::open(&drive, &OpenOptions::default()).unwrap();
    let (samples, _, _) = SampleSet::split(config, datasets, None).unwrap();
    let loader = BatchLoader::training(config, samples, 0);
    loader.next(&Device::flex().autodiff()).unwrap().unwrap()
}

fn loss(model: &Model, pass: &ForwardPass, batch: &SnippetBatch) -> BatchLoss {
    let schedule = Schedule {
        speed_weight: 0.0,
        masks_active: false,
    };
    model.loss(pass, batch, schedule)
}

/// A model whose masks have these constant logits, for the first and the second frame of a pair.
fn with_logits(config: &TrainConfig, logits: [f32; 2]) -> Model {
    let device = Device::flex().autodiff();
    let mut model = Model::new(config, &device).unwrap();
    let pose_net = model.pose_net.as_mut().unwrap();
    let head = &mut pose_net.explainability.as_mut().unwrap().head;
    let none = TensorData::new(vec![0.0_f32; 2 * 16 * 9], [2, 16, 3, 3]);
    head.weight = Param::from_data(none, &device);
    head.bias = Some(Param::from_data(logits, &device));
    model
}

/// Pairs are in time order: the target is the second frame of the pair with the frame before it, and the first of the other pair.
#[test]
fn masks_belong_to_the_target() {
    let config = settings();
    let batch = snippet(&config);
    let model = with_logits(&config, [3.0, -2.0]);
    let pass = model.forward(&batch);
    assert_eq!(
        (batch.offsets.as_slice(), pass.explained.len()),
        ([-1, 1].as_slice(), 2)
    );
    for (logits, expected) in pass.explained.iter().zip([-2.0, 3.0]) {
        assert_eq!(logits.dims(), [1, 1, 64, 96]);
        let off = logits.clone().sub_scalar(expected).abs().max();
        assert!(off.into_scalar::<f32>() < 1e-6);
    }
}

/// Masks of ½ halve the error, and their own loss is ln 2; both terms have a gradient for them.
#[test]
fn masks_weight_the_error_and_have_their_own_loss() {
    let config = settings();
    let batch = snippet(&config);
    let plain = TrainConfig {
        pose_net: PoseNetConfig {
            explainability: false,
            ..config.pose_net.clone()
        },
        loss: LossConfig {
            explainability: 0.0,
            ..config.loss.clone()
        },
        ..config.clone()
    };
    plain.validate().unwrap();
    let without = Model::new(&plain, &Device::flex().autodiff()).unwrap();
    let pass = without.forward(&batch);
    assert!(pass.explained.is_empty());
    let without = loss(&without, &pass, &batch).terms;
    let model = with_logits(&config, [0.0; 2]);
    let pass = model.forward(&batch);
    let with = loss(&model, &pass, &batch);
    let half = without.reprojection / 2.0;
    assert!((with.terms.reprojection - half).abs() < 1e-6 * half.max(1.0));
    assert!((with.terms.explainability - 2.0_f64.ln()).abs() < 1e-6);
    let smooth = config.loss.smoothness * with.terms.smoothness;
    let total = half + smooth + 0.2 * 2.0_f64.ln();
    assert!((with.terms.total - total).abs() < 1e-5, "{:?}", with.terms);
    let gradients = with.total.backward();
    let pose_net = model.pose_net.as_ref().unwrap();
    let masks = pose_net.explainability.as_ref().unwrap();
    let size = |gradient: Tensor<1>| gradient.abs().max().into_scalar::<f32>();
    let bias = masks.head.bias.as_ref().unwrap().val();
    // ½·(½·error − 0.2·½) for each frame's pixels: here the masks' own loss dominates.
    assert!(size(bias.grad(&gradients).unwrap()) > 1e-3);
}

#[test]
fn masks_without_their_own_loss_are_refused() {
    let field = |change: fn(&mut TrainConfig)| {
        let mut config = settings();
        change(&mut config);
        match config.validate() {
            Err(Error::Config { field, .. }) => field,
            other => panic!("{other:?}"),
        }
    };
    let price = "loss.explainability";
    assert_eq!(field(|c| c.loss.explainability = 0.0), price);
    assert_eq!(field(|c| c.pose_net.explainability = false), price);
    assert_eq!(
        field(|c| c.reprojection = Reprojection::Minimum),
        "reprojection"
    );
    assert_eq!(field(|c| c.loss.automask = true), "loss.automask");
    let preset = Preset::Sfmlearner.config();
    assert!(preset.pose_net.explainability && preset.reprojection == Reprojection::Mean);
}
