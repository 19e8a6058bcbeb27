use crate::learned_focal::{LearnedFocal, refocused};
use crate::{BilinearResize, Error, Motion, Reprojection, ReversedPose, SnippetBatch, TrainConfig};
use burn::module::Module;
use burn::tensor::{Device, Tensor};
use deepfusion_geometry::DepthRange;
use deepfusion_nn::{DepthNet, FlowDecoder, PoseNet, SCALES, WeightRng};

/// The networks of a run, with what a training step needs.
#[derive(Debug, Clone)]
pub struct Model {
    /// The depth network: disparity from an image.
    pub depth_net: DepthNet,
    /// PoseNet: the motion between two images; `None` in a run that [leaves it out](TrainConfig::leaves_pose_net_out).
    pub pose_net: Option<PoseNet>,
    /// Optical flow from the depth network's features of two images; only while training with a flow loss.
    pub flow_decoder: Option<FlowDecoder>,
    /// The focal length of an unknown camera, in a run that learns it.
    pub focal: Option<LearnedFocal>,
    pub(crate) config: TrainConfig,
    /// Resizes from scale s to full resolution, by scale.
    pub(crate) enlarge: Vec<BilinearResize>,
}

/// The optical flow between targets and sources, T×2×H×W each, in pixels.
#[derive(Debug, Clone)]
pub struct ViewFlow {
    /// From the targets to the sources: what is at p in the target is at p + f(p) in the source.
    pub flow: Tensor<4>,
    /// From the sources to the targets.
    pub back: Tensor<4>,
}

/// The networks' outputs for a batch: T targets, which are frame 0 alone, or frames 0 and 1.
#[derive(Debug, Clone)]
pub struct ForwardPass {
    /// Sigmoid disparities of the targets, T×1×H/2ˢ×W/2ˢ, as from [`DepthNet::forward`].
    pub disparities: Vec<Tensor<4>>,
    /// PoseNet's `source_from_target` by view, T each; without PoseNet the measured one. For the other camera's view, the calibrated one.
    pub motions: Vec<Motion>,
    /// The same, measured by the vehicle's sensors.
    pub measured: Vec<Motion>,
    /// Logits of the targets' explainability masks by view, T×1×H×W; empty without them.
    pub explained: Vec<Tensor<4>>,
    /// The optical flow by view; empty without a flow decoder.
    pub flows: Vec<ViewFlow>,
    /// Clean images of the targets, T×3×H×W.
    pub targets: Tensor<4>,
    /// Clean images of the sources by view, T×3×H×W.
    pub sources: Vec<Tensor<4>>,
    /// K of the targets, T×3×3.
    pub intrinsics: Tensor<3>,
    /// K⁻¹ of the targets, T×3×3.
    pub inverse_intrinsics: Tensor<3>,
}

/// The sums of the batch's measured and predicted displacements, one value each, in metres, for the scale ratio.
pub(crate) fn displacements(pass: &ForwardPass, batch: &SnippetBatch) -> [Tensor<1>; 2] {
    // The other camera's baseline is not a displacement in time.
    let in_time = pass.motions.iter().take(batch.distance_m.len());
    let predicted = in_time.map(|m| m.distance().narrow(0, 0, batch.len()));
    [batch.distance_m.clone(), predicted.collect()]
        .map(|distances: Vec<Tensor<1>>| Tensor::cat(distances, 0).sum())
}

impl Model {
    /// New networks with the weights of the configuration's seed.
    ///
    /// # Errors
    /// [`Error::Model`] for a configuration that cannot be built.
    pub fn new(config: &TrainConfig, device: &Device) -> Result<Self, Error> {
        let depth_net = DepthNet::with_seed(&config.depth_net, config.seed, device)?;
        let pose_net = if config.leaves_pose_net_out() {
            None
        } else {
            let seed = config.seed.wrapping_add(1);
            let new = PoseNet::with_seed(&config.pose_net, seed, device)?;
            let moving = config.start_moving && config.reversed_pose == ReversedPose::Inverted;
            Some(if moving { start_moving(new) } else { new })
        };
        let mut model = Self::with_networks(config, depth_net, pose_net, device);
        if config.loss.flow.weight > 0.0 {
            let mut rng = WeightRng::new(config.seed.wrapping_add(2));
            let channels = config.depth_net.encoder.channels();
            let decoder = FlowDecoder::new(&config.flow_decoder, channels, &mut rng, device)?;
            model.flow_decoder = Some(decoder);
        }
        Ok(model)
    }

    /// The given networks, without a flow decoder.
    #[must_use]
    pub fn with_networks(
        config: &TrainConfig,
        depth_net: DepthNet,
        pose_net: impl Into<Option<PoseNet>>,
        device: &Device,
    ) -> Self {
        let (height, width) = (config.size.height, config.size.width);
        let enlarge = (0..SCALES)
            .map(|s| BilinearResize::new([height >> s, width >> s], [height, width], device))
            .collect();
        Self {
            depth_net,
            pose_net: pose_net.into(),
            flow_decoder: None,
            focal: config.learned_camera().map(|_| LearnedFocal::new(device)),
            config: config.clone(),
            enlarge,
        }
    }

    /// The depth and pose networks for inference, on the device without autodiff.
    #[must_use]
    pub fn valid(&self, device: &Device) -> Self {
        let mut model = Self::with_networks(
            &self.config,
            self.depth_net.valid(),
            self.pose_net.as_ref().map(Module::valid),
            &device.clone().inner(),
        );
        model.focal = self.focal.as_ref().map(Module::valid);
        model
    }

    /// The batch with the learned camera's intrinsics; unchanged if the run learns no camera.
    #[must_use]
    pub fn with_learned_camera(&self, batch: SnippetBatch) -> SnippetBatch {
        match &self.focal {
            Some(focal) => self.refocused(&batch, focal.log_ratio.val()),
            None => batch,
        }
    }

    /// The batch with the focal length of the assumed camera changed by ln(f/f₀) = `log_ratio`.
    pub(crate) fn refocused(&self, batch: &SnippetBatch, log_ratio: Tensor<1>) -> SnippetBatch {
        refocused(batch, log_ratio, self.config.canonical_focal_px.is_some())
    }

    /// A scale's disparity at full resolution: the run's size, or the batch's own size.
    pub(crate) fn enlarged(
        &self,
        scale: usize,
        disparity: Tensor<4>,
        height: usize,
        width: usize,
    ) -> Tensor<4> {
        let size = self.config.size;
        if (size.height, size.width) == (height, width) {
            return self.enlarge[scale].apply(disparity);
        }
        if scale == 0 {
            return disparity;
        }
        let from = [height >> scale, width >> scale];
        BilinearResize::new(from, [height, width], &disparity.device()).apply(disparity)
    }

    /// The run's configuration, completed with values taken from the data.
    #[must_use]
    pub fn config(&self) -> &TrainConfig {
        &self.config
    }

    /// The depth range of the disparities.
    #[must_use]
    pub fn range(&self) -> DepthRange {
        self.config.depth_net.range
    }

    /// Runs the networks on a batch.
    #[must_use]
    pub fn forward(&self, batch: &SnippetBatch) -> ForwardPass {
        let mut pass = match self.config.reprojection {
            Reprojection::Bidirectional => self.forward_bidirectional(batch),
            Reprojection::Minimum | Reprojection::Mean => self.forward_target(batch),
        };
        // Without PoseNet the motions are measured, and already in metres.
        if let (Some(factors), Some(_)) = (&batch.factors, &self.pose_net) {
            pass.motions = pass.motions.iter().map(|m| factors.scale(m)).collect();
        }
        // The other camera's pose is calibrated, in metres.
        pass.motions
            .extend(batch.measured.iter().skip(batch.offsets.len()).cloned());
        pass
    }

    /// Frames 0 and 1 are each other's target: T = 2B, one view.
    fn forward_bidirectional(&self, batch: &SnippetBatch) -> ForwardPass {
        let pair =
            |a: &Tensor<4>, b: &Tensor<4>, axis| Tensor::cat(vec![a.clone(), b.clone()], axis);
        let (first, second) = (&batch.network[0], &batch.network[1]);
        let both_ways = |forward: Motion| {
            let backward = forward.inverse();
            Motion::cat(vec![forward, backward])
        };
        let measured = both_ways(batch.measured[0].clone());
        let motion = match (&self.pose_net, self.config.reversed_pose) {
            (None, _) => measured.clone(),
            (Some(pose_net), ReversedPose::Predicted) => {
                let in_order = pair(first, second, 1);
                let reversed = pair(second, first, 1);
                motion(pose_net, pair(&in_order, &reversed, 0))
            }
            (Some(pose_net), ReversedPose::Inverted) => {
                both_ways(motion(pose_net, pair(first, second, 1)))
            }
        };
        let twice = |k: &Tensor<3>| Tensor::cat(vec![k.clone(), k.clone()], 0);
        let images = pair(first, second, 0);
        let (disparities, flows) = match &self.flow_decoder {
            None => (self.depth_net.forward(images), Vec::new()),
            Some(decoder) => {
                let features = self.depth_net.encode(images);
                let n = batch.len();
                let [one, other] = [0, n].map(|at| features.clone().map(|f| f.narrow(0, at, n)));
                let [flow, back] = decoder.forward_both(&one, &other).map(|f| f.flow);
                let view = ViewFlow {
                    flow: pair(&flow, &back, 0),
                    back: pair(&back, &flow, 0),
                };
                (self.depth_net.decode(features), vec![view])
            }
        };
        ForwardPass {
            disparities,
            explained: Vec::new(),
            flows,
            motions: vec![motion],
            measured: vec![measured],
            targets: pair(&batch.clean[0], &batch.clean[1], 0),
            sources: vec![pair(&batch.clean[1], &batch.clean[0], 0)],
            intrinsics: twice(&batch.intrinsics),
            inverse_intrinsics: twice(&batch.inverse_intrinsics),
        }
    }

    /// Frame 0 is the target of every source: T = B, one view for each source.
    fn forward_target(&self, batch: &SnippetBatch) -> ForwardPass {
        let (motions, explained) = match &self.pose_net {
            Some(pose_net) => motions_from_target(pose_net, batch),
            None => {
                let in_time = batch.measured.iter().take(batch.offsets.len());
                (in_time.cloned().collect(), Vec::new())
            }
        };
        let (disparities, flows) = self.depth_and_flows(batch);
        ForwardPass {
            disparities,
            explained,
            flows,
            motions,
            measured: batch.measured.clone(),
            targets: batch.clean[0].clone(),
            sources: batch.clean[1..].to_vec(),
            intrinsics: batch.intrinsics.clone(),
            inverse_intrinsics: batch.inverse_intrinsics.clone(),
        }
    }

    /// Disparities of the targets, and, with a flow decoder, the flow between them and every source: the
    /// encoder then runs on the sources too.
    fn depth_and_flows(&self, batch: &SnippetBatch) -> (Vec<Tensor<4>>, Vec<ViewFlow>) {
        let Some(decoder) = &self.flow_decoder else {
            return (self.depth_net.forward(batch.network[0].clone()), Vec::new());
        };
        let n = batch.len();
        let all = self.depth_net.encode(Tensor::cat(batch.network.clone(), 0));
        let frame = |index: usize| all.clone().map(|f| f.narrow(0, index * n, n));
        let targets = frame(0);
        let flows = (1..batch.network.len()).map(|source| {
            let both = decoder.forward_both(&targets, &frame(source));
            let [flow, back] = both.map(|f| f.flow);
            ViewFlow { flow, back }
        });
        let flows = flows.collect();
        (self.depth_net.decode(targets), flows)
    }
}

/// PoseNet's motions of frame 0 to every source, and the logits of the masks.
fn motions_from_target(pose_net: &PoseNet, batch: &SnippetBatch) -> (Vec<Motion>, Vec<Tensor<4>>) {
    let target = &batch.network[0];
    // The pose network gets the frames in time order. For a source before the target its output is `target_from_source`.
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
    let (pose, logits) = pose_net.forward_explained(Tensor::cat(stacked.collect(), 0));
    let all = Motion::new(pose.axis_angle, pose.translation);
    let n = batch.len();
    let explained = logits.into_iter().flat_map(|logits| {
        let views = batch.offsets.iter().enumerate();
        views.map(move |(i, offset)| {
            // If the source comes before the target, the target is the second frame.
            let target = usize::from(*offset < 0);
            logits.clone().narrow(0, i * n, n).narrow(1, target, 1)
        })
    });
    let motions = batch.offsets.iter().enumerate().map(|(i, offset)| {
        let motion = all.narrow(i * n, n);
        if *offset < 0 {
            motion.inverse()
        } else {
            motion
        }
    });
    (motions.collect(), explained.collect())
}

fn motion(pose_net: &PoseNet, stacked: Tensor<4>) -> Motion {
    let pose = pose_net.forward(stacked);
    Motion::new(pose.axis_angle, pose.translation)
}

/// The second half of the batch, then the first.
pub(crate) fn swap_halves(x: Tensor<4>) -> Tensor<4> {
    let half = x.dims()[0] / 2;
    Tensor::cat(
        vec![x.clone().narrow(0, half, half), x.narrow(0, 0, half)],
        0,
    )
}

/// The pose network with a bias of one unit of translation ahead: a point of frame 0 has a smaller z in frame 1.
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
