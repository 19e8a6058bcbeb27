//! The objective: L = Σ_s w_s·(L_rp + λ_s·L_smooth) + λ_v·L_speed + λ_a·L_aff + λ_f·L_flow + λ_e·L_e + agreement.

use crate::level::{Level, levels, pyramid};
use crate::losses::{self, FlowView, LossTerms, ReprojectionOutput, RigidView, View, share};
use crate::model::swap_halves;
use crate::unread::{TermField, Unread};
use crate::{
    CompareAt, DepthBatch, ForwardPass, Model, Motion, SnippetBatch, Synthesised, synthesise,
};
use crate::{Reprojection, ViewMotion};
use burn::tensor::module::avg_pool2d;
use burn::tensor::ops::AvgPoolOptions;
use burn::tensor::{Bool, Tensor};
use deepfusion_nn::{DepthOutput, DepthScale, ops};

/// The parts of the loss that depend on training progress.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Schedule {
    /// λ_v.
    pub speed_weight: f64,
    /// Whether dynamic pixels are masked, and the agreement of optical and rigid flow is part of the loss.
    pub masks_active: bool,
}

/// The loss of a batch: the sum to differentiate, its terms, and the results of the finest scale.
#[derive(Debug, Clone)]
pub struct BatchLoss {
    /// What is minimised, one value.
    pub total: Tensor<1>,
    /// Its terms.
    pub terms: LossTerms,
    /// The reprojection at the finest scale.
    pub finest: ReprojectionOutput,
    /// The first view's source warped to the targets at the finest scale, T×3×H×W.
    pub warped: Tensor<4>,
    /// The dynamic pixels of the first view, T×1×H×W, if they were computed.
    pub moving: Option<Tensor<4, Bool>>,
}

/// The loss of a batch with known depth.
#[derive(Debug, Clone)]
pub struct DepthPass {
    /// What is minimised, one value.
    pub total: Tensor<1>,
    /// Its terms.
    pub terms: LossTerms,
    /// True over predicted depth, the geometric mean over the pixels: 1 when the scale is metric.
    pub scale_ratio: f64,
    /// Disparity at the finest scale, B×1×H×W in 1/m.
    pub metric_disparity: Tensor<4>,
}

/// The views of one scale.
struct ScaleViews {
    synthesised: Vec<Synthesised>,
    errors: Vec<Tensor<4>>,
}

impl Model {
    /// The loss of a forward pass.
    #[must_use]
    pub fn loss(&self, pass: &ForwardPass, batch: &SnippetBatch, schedule: Schedule) -> BatchLoss {
        let (loss, unread) = self.loss_on_device(pass, batch, schedule);
        BatchLoss {
            terms: unread.read().terms,
            ..loss
        }
    }

    /// As [`Self::loss`], with the terms still on the device: those of the [`BatchLoss`] are zero.
    pub(crate) fn loss_on_device(
        &self,
        pass: &ForwardPass,
        batch: &SnippetBatch,
        schedule: Schedule,
    ) -> (BatchLoss, Unread) {
        let settings = &self.config.loss;
        let motions = self.warp_poses(pass, batch);
        let targets = pyramid(pass.targets.clone());
        let levels = levels(pass, &targets, settings.compare_at, settings.ssim_weight);
        let mut sum = Sum::default();

        let finest = self.views((pass, batch), 0, &levels[0], &motions);
        let flow_views = self.flow_views(pass);
        let masks = (schedule.masks_active && settings.moving.enabled)
            .then(|| moving_masks(self, &finest, &flow_views, &motions, &levels[0]));
        if let Some(masks) = &masks {
            sum.note(mean_of(masks.iter(), share), |terms| {
                &mut terms.moving_share
            });
        }

        let warped = finest.synthesised[0].image.clone().detach();
        let (mut reprojection, mut smooth) = (Vec::new(), Vec::new());
        let mut finest_output = None;
        for (index, scale) in self.config.depth_net.scales().into_iter().enumerate() {
            let halvings = scale.halvings as usize;
            let level = &levels[halvings];
            let views = match index {
                0 => &finest,
                _ => &self.views((pass, batch), index, level, &motions),
            };
            let mut compared = compared(views, level, masks.as_deref());
            if let Some(there) = &batch.other_camera {
                // The other camera's view is the last one; only `minimum` supports it.
                let other = compared.pop().map(|view| view.only_where(there));
                compared.extend(other);
            }
            let output = if self.config.reprojection == Reprojection::Mean {
                let [_, _, _, width] = level.targets.dims();
                let logits = pass.explained.iter().map(|logit| block_means(logit, width));
                losses::mean_reprojection(compared, &logits.collect::<Vec<_>>())
            } else {
                losses::reprojection(compared, settings.automask)
            };
            reprojection.push(output.loss.clone().mul_scalar(scale.weight));
            finest_output.get_or_insert(output);
            if settings.smoothness > 0.0 {
                let disparity = pass.disparities[index].clone();
                let rough = losses::smoothness(disparity, targets[halvings].clone());
                smooth.push(rough.mul_scalar(scale.smoothness));
            }
        }
        #[expect(clippy::expect_used, reason = "one for each scale")]
        let output = finest_output.expect("a decoder has at least one scale");
        sum.note(share(&output.valid), |terms| &mut terms.valid_share);
        sum.note(share(&output.explained), |terms| &mut terms.explained_share);
        let added = |terms: Vec<Tensor<1>>| terms.into_iter().reduce(|a, b| a + b);
        sum.add(added(reprojection), 1.0, |terms| &mut terms.reprojection);
        sum.add(added(smooth), settings.smoothness, |terms| {
            &mut terms.smoothness
        });
        let speed = (settings.speed > 0.0 && self.pose_net.is_some())
            .then(|| self.motion_loss(pass, batch));
        sum.add(speed, schedule.speed_weight, |terms| &mut terms.speed);
        let explained =
            (settings.explainability > 0.0).then(|| losses::explainability(&pass.explained));
        sum.add(explained, settings.explainability, |terms| {
            &mut terms.explainability
        });
        let affine = (settings.affine > 0.0)
            .then(|| self.affine_loss((pass, batch), &finest, &motions, masks.as_deref()));
        sum.add(affine, settings.affine, |terms| &mut terms.affine);
        if !flow_views.is_empty() {
            let flow = self.flow_loss(pass, &flow_views);
            sum.add(Some(flow), settings.flow.weight, |terms| &mut terms.flow);
            if schedule.masks_active && settings.flow.agreement > 0.0 {
                let apart = agreement(&finest, &flow_views, &levels[0], masks.as_deref());
                let weight = settings.flow.agreement;
                sum.add(Some(apart), weight, |terms| &mut terms.agreement);
            }
        }
        let (total, unread) = sum.end();
        let loss = BatchLoss {
            total,
            terms: LossTerms::default(),
            finest: output,
            warped,
            moving: masks.and_then(|masks| masks.into_iter().next()),
        };
        (loss, unread)
    }

    /// The loss of images with known depth, and the network's prediction for them.
    #[must_use]
    pub fn learn_depth(&self, batch: &DepthBatch) -> DepthPass {
        let (pass, unread) = self.learn_depth_on_device(batch);
        let numbers = unread.read();
        DepthPass {
            terms: numbers.terms,
            scale_ratio: numbers.scale_ratio,
            ..pass
        }
    }

    /// As [`Self::learn_depth`], with the numbers still on the device: the terms of the [`DepthPass`] are zero, its ratio is NaN.
    pub(crate) fn learn_depth_on_device(&self, batch: &DepthBatch) -> (DepthPass, Unread) {
        // At weight 0 only the uncertainty head learns. The other weights have no gradient, so they do not decay either.
        let alone = self.config.loss.depth.weight == 0.0 && self.depth_net.uncertainty.is_some();
        let images = batch.network.clone();
        let DepthOutput {
            disparities,
            log_scale,
        } = if alone {
            self.depth_net.forward_for_uncertainty(images)
        } else {
            self.depth_net.forward_with_uncertainty(images)
        };
        let [_, _, height, width] = batch.clean.dims();
        let full_size = |(scale, disparity): (DepthScale, Tensor<4>)| {
            let disparity = match scale.halvings {
                0 => disparity,
                halvings => self.enlarged(halvings as usize, disparity, height, width),
            };
            batch.factors.metric_disparity(disparity)
        };
        let scales = self.config.depth_net.scales().into_iter();
        let inverse: Vec<_> = scales.zip(disparities).map(full_size).collect();
        let settings = &self.config.loss.depth;
        let found = losses::depth(&inverse, &batch.truth, settings);
        let mut sum = Sum::default();
        sum.add(Some(found.loss), settings.weight, |terms| &mut terms.depth);
        let likelihood =
            log_scale.map(|b| losses::uncertainty(inverse[0].clone(), b, &batch.truth));
        sum.add(likelihood, 1.0, |terms| &mut terms.uncertainty);
        let (total, mut unread) = sum.end();
        unread.note_bias(found.bias);
        let pass = DepthPass {
            total,
            terms: LossTerms::default(),
            scale_ratio: f64::NAN,
            metric_disparity: inverse[0].clone().detach(),
        };
        (pass, unread)
    }

    /// The sources warped by one of the disparities, and their errors.
    fn views(
        &self,
        (pass, batch): (&ForwardPass, &SnippetBatch),
        index: usize,
        level: &Level,
        motions: &[Motion],
    ) -> ScaleViews {
        let settings = &self.config.loss;
        let disparity = pass.disparities[index].clone();
        let disparity = match settings.compare_at {
            CompareAt::Full => {
                let [_, _, height, width] = level.targets.dims();
                let halvings = (width / disparity.dims()[3]).ilog2();
                self.enlarged(halvings as usize, disparity, height, width)
            }
            CompareAt::Own => disparity,
        };
        let metric_disparity = self.metric_disparity(disparity, batch);
        let synthesised: Vec<_> = level
            .sources
            .iter()
            .zip(motions)
            .map(|(source, motion)| {
                synthesise(
                    source.clone(),
                    metric_disparity.clone(),
                    motion,
                    &level.intrinsics,
                    &level.inverse_intrinsics,
                )
            })
            .collect();
        let error = |view: &Synthesised| {
            let (image, target) = (view.image.clone(), level.targets.clone());
            ops::photometric_error(image, target, settings.ssim_weight)
        };
        ScaleViews {
            errors: synthesised.iter().map(error).collect(),
            synthesised,
        }
    }

    /// 1/depth in 1/m, of a sigmoid disparity: d = 1/D_max + (1/D_min − 1/D_max)·σ, with the range of the run
    /// or of each sample's data set.
    fn metric_disparity(&self, disparity: Tensor<4>, batch: &SnippetBatch) -> Tensor<4> {
        if let Some(factors) = &batch.factors {
            return factors.metric_disparity(disparity);
        }
        let range = self.range();
        let (low, high) = (1.0 / range.max_m, 1.0 / range.min_m);
        disparity.mul_scalar(high - low).add_scalar(low)
    }

    /// The sources warped by the flow, by view; none without a flow.
    fn flow_views(&self, pass: &ForwardPass) -> Vec<FlowView> {
        let ssim_weight = self.config.loss.ssim_weight;
        let views = pass.flows.iter().zip(&pass.sources);
        views
            .map(|(f, source)| {
                losses::flow_view(&pass.targets, source, &f.flow, &f.back, ssim_weight)
            })
            .collect()
    }

    /// L_flow, mean over the views.
    fn flow_loss(&self, pass: &ForwardPass, flow_views: &[FlowView]) -> Tensor<1> {
        let settings = &self.config.loss;
        let views = pass.flows.iter().zip(&pass.sources).zip(flow_views);
        mean_of(views, |((f, source), view)| {
            let one_way = match self.config.reprojection {
                // The view's two halves are the two directions.
                Reprojection::Bidirectional => None,
                Reprojection::Minimum | Reprojection::Mean => Some(losses::flow_view(
                    source,
                    &pass.targets,
                    &f.back,
                    &f.flow,
                    settings.ssim_weight,
                )),
            };
            let mut sides = vec![view.clone()];
            let (mut flows, mut images) = (vec![f.flow.clone()], vec![pass.targets.clone()]);
            if let Some(back) = one_way {
                sides.push(back);
                flows.push(f.back.clone());
                images.push(source.clone());
            }
            losses::flow(&sides, &flows, &images, &settings.flow)
        })
    }

    /// The affine invariant loss between each frame's depth and the other's seen from it. Both frames are targets here: the other depth is
    /// in the batch's other half.
    ///
    /// Where a pixel lies in the other frame depends on depth and motion together, which would couple their scales. So both are detached
    /// here. The translation is left out of the depth seen from this frame: it shifts all depths by the same length, which b absorbs.
    fn affine_loss(
        &self,
        (pass, batch): (&ForwardPass, &SnippetBatch),
        finest: &ScaleViews,
        motions: &[Motion],
        moving: Option<&[Tensor<4, Bool>]>,
    ) -> Tensor<1> {
        let depth = self
            .metric_disparity(pass.disparities[0].clone(), batch)
            .recip();
        let views = finest.synthesised.iter().zip(motions).enumerate();
        mean_of(views, |(index, (view, motion))| {
            let coords = view.coords.clone().detach();
            let there = ops::warp(swap_halves(depth.clone().detach()), coords.clone());
            let target_from_source = Motion {
                rotation: motion.rotation.clone().detach(),
                translation: motion.translation.zeros_like(),
            }
            .inverse();
            let seen = losses::depth_seen_from_target(
                there,
                coords,
                &target_from_source,
                &pass.inverse_intrinsics.clone().detach(),
            );
            let moving = moving.map(|masks| &masks[index]);
            let pixels = losses::seen_in_both(&view.coords, &view.valid, moving);
            losses::affine_invariant(depth.clone(), seen, &pixels)
        })
    }

    /// The loss between PoseNet's motion and the vehicle's.
    fn motion_loss(&self, pass: &ForwardPass, batch: &SnippetBatch) -> Tensor<1> {
        let views = pass.motions.iter().zip(&pass.measured);
        // PoseNet does not predict the other camera's pose.
        let views = views.take(batch.offsets.len());
        match self.config.view_motion {
            ViewMotion::Vehicle | ViewMotion::Auto => {
                // `None` where the turns of all drives are known, which `Vehicle` requires.
                let known = batch.turns_known.clone().map(|known| self.both_ways(known));
                mean_of(views.enumerate(), |(view, (motion, measured))| {
                    let whole = losses::motion(motion, measured, known.clone());
                    let Some(known) = &known else {
                        return whole;
                    };
                    let unknown = known.clone().neg().add_scalar(1.0);
                    let sure = match batch.distance_weight[view].clone() {
                        Some(weight) => unknown.mul(self.both_ways(weight)),
                        None => unknown,
                    };
                    let distance = self.distance_m(batch, view);
                    whole + losses::speed(motion, distance, Some(sure), &measured.rotation, 0.0)
                })
            }
            ViewMotion::PoseNet | ViewMotion::Distance => {
                let weight = self.config.loss.rotation;
                mean_of(views.enumerate(), |(view, (motion, measured))| {
                    let distance = self.distance_m(batch, view);
                    let sure = batch.distance_weight[view].clone();
                    let sure = sure.map(|weight| self.both_ways(weight));
                    losses::speed(motion, distance, sure, &measured.rotation, weight)
                })
            }
        }
    }

    /// The measured distance of a view's targets, T.
    fn distance_m(&self, batch: &SnippetBatch, view: usize) -> Tensor<1> {
        self.both_ways(batch.distance_m[view].clone())
    }

    /// A value of each sample of the batch (B), for each of the targets (T).
    fn both_ways(&self, samples: Tensor<1>) -> Tensor<1> {
        match self.config.reprojection {
            // The second half of the targets looks back over the same distance.
            Reprojection::Bidirectional => Tensor::cat(vec![samples.clone(), samples], 0),
            Reprojection::Minimum | Reprojection::Mean => samples,
        }
    }

    /// The poses used for warping, by view.
    fn warp_poses(&self, pass: &ForwardPass, batch: &SnippetBatch) -> Vec<Motion> {
        match self.config.view_motion {
            ViewMotion::PoseNet => pass.motions.clone(),
            ViewMotion::Distance => self.at_measured_distance(pass, batch),
            ViewMotion::Vehicle | ViewMotion::Auto => {
                let Some(known) = &batch.turns_known else {
                    return pass.measured.clone();
                };
                let known = self.both_ways(known.clone());
                let guessed = self.at_measured_distance(pass, batch);
                let views = pass.measured.iter().zip(guessed);
                let chosen = views.map(|(measured, guessed)| measured.or(&guessed, known.clone()));
                chosen.collect()
            }
        }
    }

    /// PoseNet's motions with the vehicle's distances, by view; the other camera's pose as calibrated.
    fn at_measured_distance(&self, pass: &ForwardPass, batch: &SnippetBatch) -> Vec<Motion> {
        let views = pass.motions.iter().enumerate();
        let scaled = views.map(|(view, motion)| match batch.distance_m.get(view) {
            Some(_) => motion.with_distance(self.distance_m(batch, view)),
            None => motion.clone(),
        });
        scaled.collect()
    }
}

/// The dynamic pixels at the finest scale, by view, T×1×H×W.
fn moving_masks(
    model: &Model,
    finest: &ScaleViews,
    flow_views: &[FlowView],
    motions: &[Motion],
    level: &Level,
) -> Vec<Tensor<4, Bool>> {
    let views = finest.synthesised.iter().zip(&finest.errors);
    let views = views.zip(flow_views).zip(motions);
    views
        .map(|(((synthesised, error), flow), source_from_target)| {
            let rigid = RigidView {
                synthesised,
                error,
                source_from_target,
                intrinsics: &level.intrinsics,
                inverse_intrinsics: &level.inverse_intrinsics,
            };
            losses::moving_pixels(&rigid, flow, &model.config.loss.moving)
        })
        .collect()
}

/// A scale's views for the reprojection loss, with the masks resized to them.
fn compared(views: &ScaleViews, level: &Level, masks: Option<&[Tensor<4, Bool>]>) -> Vec<View> {
    let parts = views.synthesised.iter().zip(&views.errors);
    let parts = parts.zip(&level.unwarped).enumerate();
    parts
        .map(|(index, ((synthesised, error), unwarped_error))| View {
            error: error.clone(),
            valid: synthesised.valid.clone(),
            unwarped_error: unwarped_error.clone(),
            moving: masks.map(|masks| shrunk(&masks[index], error.dims()[3])),
        })
        .collect()
}

/// A mask at a smaller width, true where most of a block's pixels are true.
fn shrunk(mask: &Tensor<4, Bool>, width: usize) -> Tensor<4, Bool> {
    if mask.dims()[3] == width {
        return mask.clone();
    }
    block_means(&mask.clone().float(), width).greater_elem(0.5)
}

/// An image at a smaller width: the means of its blocks.
fn block_means(image: &Tensor<4>, width: usize) -> Tensor<4> {
    let factor = image.dims()[3] / width;
    if factor == 1 {
        return image.clone();
    }
    let options = AvgPoolOptions::new([factor, factor]).with_stride([factor, factor]);
    avg_pool2d(image.clone(), options)
}

/// Mean over the views of the distance between rigid flow and flow, where both explain the pixel and it is
/// static.
fn agreement(
    finest: &ScaleViews,
    flow_views: &[FlowView],
    level: &Level,
    masks: Option<&[Tensor<4, Bool>]>,
) -> Tensor<1> {
    let views = finest.synthesised.iter().zip(&finest.errors);
    let views = views.zip(flow_views).zip(&level.unwarped).enumerate();
    mean_of(views, |(index, (((rigid, error), flow), unwarped))| {
        let mut both = losses::both_explain(error, &rigid.valid, flow, unwarped);
        if let Some(masks) = masks {
            both = both.bool_and(masks[index].clone().bool_not());
        }
        losses::agreement(rigid.coords.clone(), flow.coords.clone(), &both)
    })
}

/// The sum that is differentiated, with its terms, which stay on the device until they are read.
#[derive(Default)]
struct Sum {
    total: Option<Tensor<1>>,
    terms: Unread,
}

impl Sum {
    /// Adds a weighted term if there is one, and keeps its unweighted value.
    fn add(&mut self, term: Option<Tensor<1>>, weight: f64, field: TermField) {
        let Some(term) = term else { return };
        self.note(term.clone(), field);
        let weighted = term.mul_scalar(weight);
        self.total = Some(match self.total.take() {
            Some(total) => total + weighted,
            None => weighted,
        });
    }

    /// Keeps a value that is not part of the sum.
    fn note(&mut self, value: Tensor<1>, field: TermField) {
        self.terms.note(field, value);
    }

    /// The sum, and its terms.
    #[expect(clippy::expect_used, reason = "every loss has a term")]
    fn end(mut self) -> (Tensor<1>, Unread) {
        let total = self.total.expect("a loss has at least one term");
        self.terms.note(|terms| &mut terms.total, total.clone());
        (total, self.terms)
    }
}

/// The mean of a loss over views.
#[expect(clippy::expect_used, reason = "as many as sources")]
fn mean_of<T>(views: impl ExactSizeIterator<Item = T>, loss: impl Fn(T) -> Tensor<1>) -> Tensor<1> {
    let count = views.len() as f64;
    views
        .map(loss)
        .reduce(|a, b| a + b)
        .expect("a target has at least one source: the configuration is validated")
        .mul_scalar(1.0 / count)
}
