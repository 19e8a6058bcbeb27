//! The affine invariant loss within the whole loss: it neither depends on nor changes the scale of depth or motion.

use crate::support::{drive, small};
use burn::tensor::{Device, Tensor};
use deepfusion_train::{
    BatchLoader, ForwardPass, Model, Schedule, SnippetBatch, TrainConfig, ViewMotion,
};

/// A pair of frames at 96×64, and a configuration whose views are warped by PoseNet.
fn pair() -> (TrainConfig, SnippetBatch) {
    let folder = tempfile::tempdir().unwrap();
    let (mut config, samples, _) = small(&drive(folder.path(), 6), 1);
    config.batch = 1;
    config.view_motion = ViewMotion::PoseNet;
    config.pose_net.metres_per_unit = 0.8;
    let device = Device::flex().autodiff();
    let loader = BatchLoader::training(&config, samples, 0);
    (config, loader.next(&device).unwrap().unwrap())
}

/// What the gradient is taken with respect to.
struct Leaves {
    /// 1/depth of both frames, 2×1×64×96, in 1/m.
    inverse: Tensor<4>,
    /// A factor of all depths and one of all translations.
    scales: [Tensor<1>; 2],
}

/// Depths in waves of 8 to 16 m, different in the two frames. A block of the first frame at 1 m hides what is behind it.
fn leaves(device: &Device) -> Leaves {
    let depth = |frame: usize, y: usize, x: usize| {
        if frame == 0 && (20..40).contains(&y) && (30..50).contains(&x) {
            return 1.0;
        }
        let (x, y) = (x as f32, y as f32);
        12.0 + 4.0 * (0.11 * x + 0.07 * y + 0.6 * frame as f32).sin()
    };
    let inverse: Vec<f32> = (0..2 * 64 * 96)
        .map(|i| 1.0 / depth(i / (64 * 96), i / 96 % 64, i % 96))
        .collect();
    let inverse = Tensor::<1>::from_data(inverse.as_slice(), device);
    Leaves {
        inverse: inverse.reshape([2, 1, 64, 96]).require_grad(),
        scales: [0, 1].map(|_| Tensor::<1>::ones([1], device).require_grad()),
    }
}

/// The gradient of the whole loss at a given weight of the affine term, with respect to each pixel, the scale of depth and that of motion.
fn gradient(config: &TrainConfig, batch: &SnippetBatch, affine: f64) -> (Vec<f32>, [f32; 2]) {
    let device = Device::flex().autodiff();
    let mut config = config.clone();
    config.loss.affine = affine;
    let model = Model::new(&config, &device).unwrap();
    let leaves = leaves(&device);
    let pass = scaled(model.forward(batch), &leaves, &model);
    let schedule = Schedule {
        speed_weight: 0.0,
        masks_active: false,
    };
    let gradients = model.loss(&pass, batch, schedule).total.backward();
    let pixels = leaves.inverse.grad(&gradients).unwrap().into_data();
    let scales = leaves.scales.map(|scale| {
        let gradient = scale.grad(&gradients).unwrap();
        gradient.into_scalar::<f32>()
    });
    (pixels.iter().collect(), scales)
}

/// The pass with the leaves' finest disparity and scales; everything else is constant.
fn scaled(mut pass: ForwardPass, leaves: &Leaves, model: &Model) -> ForwardPass {
    let range = model.range();
    let (low, high) = (1.0 / range.max_m, 1.0 / range.min_m);
    let [depth, motion] = &leaves.scales;
    let inverse = leaves.inverse.clone() / depth.clone().reshape([1, 1, 1, 1]);
    pass.disparities = pass.disparities.into_iter().map(Tensor::detach).collect();
    pass.disparities[0] = inverse.sub_scalar(low).div_scalar(high - low);
    for view in &mut pass.motions {
        // Half a metre ahead, and back.
        let ahead =
            Tensor::<2>::from_data([[0.02, 0.0, -0.5], [-0.02, 0.0, 0.5]], &motion.device());
        view.translation = ahead * motion.clone().reshape([1, 1]);
        view.rotation = view.rotation.clone().detach();
    }
    pass
}

/// The term has no gradient for the scale of depth or of motion, nor for pixels that the other frame does not see.
#[test]
fn the_affine_term_has_no_gradient_for_scales_or_hidden_pixels() {
    let (config, batch) = pair();
    let (without, scales_without) = gradient(&config, &batch, 0.0);
    let (with, scales_with) = gradient(&config, &batch, 1.0);
    let own: Vec<f32> = with.iter().zip(&without).map(|(a, b)| a - b).collect();
    let largest = own.iter().fold(0.0_f32, |most, g| most.max(g.abs()));
    assert!(largest > 1e-4, "the term has a gradient: {largest}");
    let inverse: Vec<f32> = leaves(&Device::flex().autodiff())
        .inverse
        .into_data()
        .iter()
        .collect();
    // The pixels' gradient for the scale of depth, if it did not cancel out.
    let strength: f32 = own.iter().zip(&inverse).map(|(g, d)| (g * d).abs()).sum();
    for (i, name) in ["depth", "motion"].iter().enumerate() {
        let pull = scales_with[i] - scales_without[i];
        assert!(pull.abs() < 1e-3 * strength, "{name}: {pull} of {strength}");
    }
    // The second frame does not show the middle of the block.
    for (y, x) in [(28, 36), (30, 40), (32, 44)] {
        let hidden = own[y * 96 + x].abs();
        assert!(hidden < 1e-4 * largest, "{x} {y}: {hidden} of {largest}");
    }
}
