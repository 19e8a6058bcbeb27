use crate::config::{CompareAt, Reprojection, ReversedPose, ViewMotion};
use crate::level::{levels, pyramid};
use crate::losses::{self, LossTerms, ReprojectionOutput, View};
use crate::{BilinearResize, Error, Motion, SnippetBatch, TrainConfig, synthesise};
use burn::module::Module;
use burn::tensor::{Device, Tensor};
use deepfusion_geometry::DepthRange;
use deepfusion_nn::{DepthNet, PoseNet, SCALES};

/// The networks of a run, and what their training step needs.
#[derive(Debug, Clone)]
pub struct Model {
    /// Disparity of an image.
    pub depth_net: DepthNet,
    /// Motion between two.
    pub pose_net: PoseNet,
    config: TrainConfig,
    /// From scale s to full resolution.
    enlarge: Vec<BilinearResize>,
}

/// What the networks say about a batch: T targets, which are frame 0 alone, or frames 0 and 1.
#[derive(Debug, Clone)]
pub struct ForwardPass {
    /// Sigmoid disparities of the targets by scale, T×1×H/2ˢ×W/2ˢ.
    pub disparities: Vec<Tensor<4>>,
    /// `source_from_target` by PoseNet, by view, T each.
    pub motions: Vec<Motion>,
    /// The same by the vehicle's sensors.
    pub measured: Vec<Motion>,
    /// Clean images of the targets, T×3×H×W.
    pub targets: Tensor<4>,
    /// Clean images of the sources by view, T×3×H×W.
    pub sources: Vec<Tensor<4>>,
    /// K of the targets, T×3×3.
    pub intrinsics: Tensor<3>,
    /// K⁻¹ of the targets, T×3×3.
    pub inverse_intrinsics: Tensor<3>,
}

/// The loss of a batch: the sum to differentiate, its terms, and what the finest scale saw.
#[derive(Debug, Clone)]
pub struct BatchLoss {
    /// What is minimised, one value.
    pub total: Tensor<1>,
    /// Its terms.
    pub terms: LossTerms,
    /// The reprojection at the finest scale.
    pub finest: ReprojectionOutput,
    /// The first view's source seen from the targets' place at that scale, T×3×H×W.
    pub warped: Tensor<4>,
}

/// Share of the predicted displacement that the loss saw: for the scale ratio.
pub(crate) fn displacement_ratio(pass: &ForwardPass, batch: &SnippetBatch) -> f64 {
    let predicted: f32 = pass
        .motions
        .iter()
        .map(|m| {
            m.distance()
                .narrow(0, 0, batch.len())
                .sum()
                .into_scalar::<f32>()
        })
        .sum();
    let measured: f32 = batch
        .distance_m
        .iter()
        .map(|d| d.clone().sum().into_scalar::<f32>())
        .sum();
    f64::from(measured) / f64::from(predicted).max(1e-9)
}

impl Model {
    /// New networks with the weights of the configuration's seed.
    ///
    /// # Errors
    /// [`Error::Network`] for a configuration that cannot be built.
    pub fn new(config: &TrainConfig, device: &Device) -> Result<Self, Error> {
        let depth_net = config.depth_net.init_with_seed(config.seed, device)?;
        let mut pose_net = config
            .pose_net
            .init_with_seed(config.seed.wrapping_add(1), device)?;
        if config.start_moving && config.reversed_pose == ReversedPose::Inverted {
            pose_net = start_moving(pose_net);
        }
        Ok(Self::with_networks(config, depth_net, pose_net, device))
    }

    /// The given networks.
    #[must_use]
    pub fn with_networks(
        config: &TrainConfig,
        depth_net: DepthNet,
        pose_net: PoseNet,
        device: &Device,
    ) -> Self {
        let (height, width) = (config.size.height, config.size.width);
        let enlarge = (0..SCALES)
            .map(|s| BilinearResize::new([height >> s, width >> s], [height, width], device))
            .collect();
        Self {
            depth_net,
            pose_net,
            config: config.clone(),
            enlarge,
        }
    }

    /// The same networks for inference, on the device below autodiff.
    #[must_use]
    pub fn valid(&self, device: &Device) -> Self {
        Self::with_networks(
            &self.config,
            self.depth_net.valid(),
            self.pose_net.valid(),
            &device.clone().inner(),
        )
    }

    /// The depths that the disparities mean.
    #[must_use]
    pub fn range(&self) -> DepthRange {
        self.config.depth_net.range
    }

    /// Runs the networks on a batch.
    #[must_use]
    pub fn forward(&self, batch: &SnippetBatch) -> ForwardPass {
        let mut pass = match self.config.reprojection {
            Reprojection::Bidirectional => self.forward_bidirectional(batch),
            Reprojection::Minimum => self.forward_minimum(batch),
        };
        if let Some(factors) = &batch.factors {
            pass.motions = pass.motions.iter().map(|m| factors.scale(m)).collect();
        }
        pass
    }

    /// Frames 0 and 1 are each other's target: T = 2B, one view.
    fn forward_bidirectional(&self, batch: &SnippetBatch) -> ForwardPass {
        let pair =
            |a: &Tensor<4>, b: &Tensor<4>, axis| Tensor::cat(vec![a.clone(), b.clone()], axis);
        let (first, second) = (&batch.network[0], &batch.network[1]);
        let in_order = pair(first, second, 1);
        let motion = match self.config.reversed_pose {
            ReversedPose::Predicted => {
                let reversed = pair(second, first, 1);
                self.motion(pair(&in_order, &reversed, 0))
            }
            ReversedPose::Inverted => {
                let forward = self.motion(in_order);
                let backward = forward.inverse();
                Motion::cat(vec![forward, backward])
            }
        };
        let twice = |k: &Tensor<3>| Tensor::cat(vec![k.clone(), k.clone()], 0);
        ForwardPass {
            disparities: self.depth_net.forward(pair(first, second, 0)),
            motions: vec![motion],
            measured: vec![Motion::cat(vec![
                batch.measured[0].clone(),
                batch.measured[0].inverse(),
            ])],
            targets: pair(&batch.clean[0], &batch.clean[1], 0),
            sources: vec![pair(&batch.clean[1], &batch.clean[0], 0)],
            intrinsics: twice(&batch.intrinsics),
            inverse_intrinsics: twice(&batch.inverse_intrinsics),
        }
    }

    /// Frame 0 is the target of every source: T = B, a view each.
    fn forward_minimum(&self, batch: &SnippetBatch) -> ForwardPass {
        let target = &batch.network[0];
        // The pose network is given the frames in time order; for a source before the target it
        // then says `target_from_source`.
        let stacked = batch
            .offsets
            .iter()
            .zip(&batch.network[1..])
            .map(|(o, source)| {
                let (a, b) = if *o < 0 {
                    (source, target)
                } else {
                    (target, source)
                };
                Tensor::cat(vec![a.clone(), b.clone()], 1)
            });
        let all = self.motion(Tensor::cat(stacked.collect(), 0));
        let n = batch.len();
        let motions = batch.offsets.iter().enumerate().map(|(i, offset)| {
            let motion = all.narrow(i * n, n);
            if *offset < 0 {
                motion.inverse()
            } else {
                motion
            }
        });
        ForwardPass {
            disparities: self.depth_net.forward(target.clone()),
            motions: motions.collect(),
            measured: batch.measured.clone(),
            targets: batch.clean[0].clone(),
            sources: batch.clean[1..].to_vec(),
            intrinsics: batch.intrinsics.clone(),
            inverse_intrinsics: batch.inverse_intrinsics.clone(),
        }
    }

    fn motion(&self, stacked: Tensor<4>) -> Motion {
        let pose = self.pose_net.forward(stacked);
        Motion::new(pose.axis_angle, pose.translation)
    }

    /// The loss of a forward pass, with λ_v as given: L = Σ_s ¼(L_rp + λ_s·L_smooth) + λ_v·L_speed.
    #[must_use]
    pub fn loss(&self, pass: &ForwardPass, batch: &SnippetBatch, speed_weight: f64) -> BatchLoss {
        let settings = &self.config.loss;
        let range = self.range();
        let (low, high) = (1.0 / range.max_m, 1.0 / range.min_m);
        let motions = self.view_motions(pass, batch);
        let targets = pyramid(pass.targets.clone());
        let levels = levels(pass, &targets, settings.compare_at, settings.ssim_weight);
        let (mut reprojection, mut smooth) = (Vec::new(), Vec::new());
        let mut finest = None;
        for (scale, (disparity, level)) in pass.disparities.iter().zip(&levels).enumerate() {
            let disparity_there = match settings.compare_at {
                CompareAt::Full => self.enlarge[scale].apply(disparity.clone()),
                CompareAt::Own => disparity.clone(),
            };
            let inverse_depth = match &batch.factors {
                Some(factors) => factors.inverse_depth(disparity_there),
                None => disparity_there.mul_scalar(high - low).add_scalar(low),
            };
            let mut first_warp = None;
            let views = level.sources.iter().zip(&motions).zip(&level.unwarped).map(
                |((source, motion), unwarped_error)| {
                    let synthesised = synthesise(
                        source.clone(),
                        inverse_depth.clone(),
                        motion,
                        &level.intrinsics,
                        &level.inverse_intrinsics,
                    );
                    first_warp.get_or_insert_with(|| synthesised.image.clone().detach());
                    View {
                        synthesised,
                        unwarped_error: unwarped_error.clone(),
                    }
                },
            );
            let views = views.collect();
            let output = losses::reprojection(
                &level.targets,
                views,
                settings.ssim_weight,
                settings.automask,
            );
            reprojection.push(output.loss.clone());
            if settings.smoothness > 0.0 {
                let image = targets[scale].clone();
                let weight = 1.0 / f64::from(1_u32 << scale);
                smooth.push(losses::smoothness(disparity.clone(), image).mul_scalar(weight));
            }
            if let (None, Some(warped)) = (&finest, first_warp) {
                finest = Some((output, warped));
            }
        }
        let (finest, warped) =
            finest.expect("the decoder has four scales and a target at least one source");
        let mean = |terms: Vec<Tensor<1>>| {
            let sum = terms.into_iter().reduce(|a, b| a + b);
            sum.map(|sum| sum.mul_scalar(1.0 / SCALES as f64))
        };
        let number = |t: &Tensor<1>| f64::from(t.clone().into_scalar::<f32>());
        let reprojection = mean(reprojection).expect("the decoder has four scales");
        let mut terms = LossTerms {
            reprojection: number(&reprojection),
            valid_share: share(&finest.valid),
            explained_share: share(&finest.explained),
            ..LossTerms::default()
        };
        let mut total = reprojection;
        if let Some(smooth) = mean(smooth) {
            terms.smoothness = number(&smooth);
            total = total + smooth.mul_scalar(settings.smoothness);
        }
        if settings.speed > 0.0 {
            let speed = match self.config.view_motion {
                ViewMotion::PoseNet | ViewMotion::Distance => self.speed_loss(pass, batch),
                ViewMotion::Vehicle => mean_of(pass.motions.iter().zip(&pass.measured), |pair| {
                    losses::motion(pair.0, pair.1)
                }),
            };
            terms.speed = number(&speed);
            total = total + speed.mul_scalar(speed_weight);
        }
        terms.total = number(&total);
        BatchLoss {
            total,
            terms,
            finest,
            warped,
        }
    }

    fn speed_loss(&self, pass: &ForwardPass, batch: &SnippetBatch) -> Tensor<1> {
        let weight = self.config.loss.rotation;
        let views = pass.motions.iter().zip(&pass.measured);
        mean_of(views.enumerate(), |(view, (motion, measured))| {
            let distance = self.distance_m(batch, view);
            losses::speed(motion, distance, &measured.rotation, weight)
        })
    }

    /// The measured distance of a view's targets, T.
    fn distance_m(&self, batch: &SnippetBatch, view: usize) -> Tensor<1> {
        let distance = batch.distance_m[view].clone();
        match self.config.reprojection {
            // The second half of the targets looks back, as far.
            Reprojection::Bidirectional => Tensor::cat(vec![distance.clone(), distance], 0),
            Reprojection::Minimum => distance,
        }
    }

    /// The motions that the views are synthesised with.
    fn view_motions(&self, pass: &ForwardPass, batch: &SnippetBatch) -> Vec<Motion> {
        match self.config.view_motion {
            ViewMotion::PoseNet => pass.motions.clone(),
            ViewMotion::Vehicle => pass.measured.clone(),
            ViewMotion::Distance => {
                let views = pass.motions.iter().enumerate();
                let scaled = views.map(|(view, m)| m.with_distance(self.distance_m(batch, view)));
                scaled.collect()
            }
        }
    }
}

/// The mean of a loss over views.
fn mean_of<T>(views: impl ExactSizeIterator<Item = T>, loss: impl Fn(T) -> Tensor<1>) -> Tensor<1> {
    let count = views.len() as f64;
    views
        .map(loss)
        .reduce(|a, b| a + b)
        .expect("a target has at least one source: the configuration is validated")
        .mul_scalar(1.0 / count)
}

/// The share of true pixels.
fn share(mask: &Tensor<4, burn::tensor::Bool>) -> f64 {
    f64::from(mask.clone().float().mean().into_scalar::<f32>())
}

/// The pose network with a bias that means one unit of translation ahead: a point of frame 0 has a
/// smaller z in frame 1.
fn start_moving(mut pose_net: PoseNet) -> PoseNet {
    let output = &mut pose_net.decoder.output;
    output.bias = output.bias.take().map(|bias| {
        bias.map(|b| {
            let device = b.device();
            let mut values: Vec<f32> = b.into_data().iter::<f32>().collect();
            values[..6].copy_from_slice(&[0.0, 0.0, 0.0, 0.0, 0.0, -1.0]);
            let moving = Tensor::<1>::from_data(values.as_slice(), &device);
            if moving.is_autodiff() {
                moving.require_grad()
            } else {
                moving
            }
        })
    });
    pose_net
}
