//! One frame: depth, things, targets, and what is drawn of them.

use std::time::Instant;

use deepfusion_eval::IntervalFactors;
use deepfusion_jobs::evaluation::confidence::Confidence;
use deepfusion_jobs::scene::{Motion, ScaleWatch};
use deepfusion_jobs::{Input, intervals};
use deepfusion_perception::{
    ConfidenceModel, Perception, PerceptionConfig, VehicleShape, time_to_collision, working_depth,
};
use deepfusion_records::FrameRecord;
use deepfusion_runtime::ModelSource;
use deepfusion_runtime::{DepthEstimator, PreparedImage};

use super::instances::InstanceFinder;
use super::pictures::{self, Picture};
use crate::cli::{PerceiveArgs, PerceiveSave};
use crate::commands::predict::{Loaded, Seen, warn_of_drift};
use crate::error::CliError;
use crate::failure::Result;
use crate::model::ModelFacts;

/// A frame that is loaded, and when that began.
pub(super) struct StartedFrame {
    pub input: Input,
    pub loaded: Loaded,
    pub prepared: PreparedImage,
    pub start: Instant,
}

/// A frame with all that was found in it.
pub(super) struct PerceivedFrame {
    pub input: Input,
    pub loaded: Loaded,
    pub seen: Seen,
    pub record: FrameRecord,
    /// From opening the file, or from a live frame's arrival, to having the targets.
    pub latency_ms: f64,
    pub pictures: Vec<(PerceiveSave, Picture)>,
}

/// Processes frame after frame, and tracks what it finds.
pub(super) struct FrameProcessor<'a> {
    args: &'a PerceiveArgs,
    estimator: &'a mut DepthEstimator,
    perception: Perception,
    watch: ScaleWatch,
    instance_finder: InstanceFinder,
    /// What a pixel's depth is worth, where the run was calibrated.
    confidence: Option<ConfidenceModel>,
    /// How the intervals are stretched that the network says.
    intervals: IntervalFactors,
}

impl<'a> FrameProcessor<'a> {
    /// Open, nothing seen yet.
    pub(super) fn open(
        args: &'a PerceiveArgs,
        model: &ModelSource,
        estimator: &'a mut DepthEstimator,
        config: PerceptionConfig,
    ) -> Result<Self> {
        let prediction = &args.prediction;
        let confidence = match model.folder() {
            Some(run) => Confidence::read(run)?,
            None => None,
        };
        Ok(Self {
            args,
            estimator,
            perception: Perception::new(config),
            watch: ScaleWatch::new(prediction.scale_config(), prediction.correct_scale),
            instance_finder: InstanceFinder::of(&args.masks, prediction.engine.ort_lib.as_deref())?,
            confidence: confidence.map(|c| c.single),
            intervals: model.interval_factors()?,
        })
    }

    /// The next frame, and how the camera came there.
    pub(super) fn process(
        &mut self,
        started: StartedFrame,
        motion: Motion,
    ) -> Result<PerceivedFrame> {
        let StartedFrame {
            input,
            loaded,
            prepared,
            start,
        } = started;
        let mut prediction = self.estimator.infer(&prepared)?;
        if let Some(factor) = self.watch.correction() {
            prediction.scale_depth(factor);
        }
        let camera = loaded.camera.ok_or(CliError::NoCamera)?;
        if !motion.goes_on {
            self.perception.reset();
        }
        let whole = prediction.depth();
        let sigma = intervals::sigma(&prediction, &whole, &self.intervals);
        let (depth, k) = working_depth(&whole, &camera);
        let sigma = sigma.map(|sigma| working_depth(&sigma, &camera).0);
        let things = self.instance_finder.find(&loaded.image, &depth)?;
        let perception = &mut self.perception;
        let surroundings =
            perception.detect_with_sigma(&depth, sigma.as_ref(), &k, motion.stamp, &things)?;
        let collision = motion.speed_mps.and_then(|speed| {
            let vehicle = VehicleShape::default();
            time_to_collision(&surroundings.targets, speed, motion.yaw_rate, &vehicle)
        });
        let latency_ms = start.elapsed().as_secs_f64() * 1e3;
        // The targets need not wait for it.
        let (image, ground) = (&loaded.image, surroundings.ground.as_ref());
        let scale = self.watch.add(image, &camera, &motion, ground);
        if let Some(ratio) = self.watch.first_drift() {
            warn_of_drift(&input.name, ratio);
        }
        let record = FrameRecord {
            scale_monitor: scale,
            ..FrameRecord::new(
                &input.name,
                &surroundings,
                (motion.stamp, motion.speed_mps),
                collision,
                latency_ms,
            )
        };
        let pictures = pictures::draw(
            &self.args.save,
            image,
            &camera,
            (&depth, sigma.as_ref(), &k),
            &surroundings,
            &self.perception,
            self.confidence.as_ref().map(|model| (model, &prediction)),
        );
        Ok(PerceivedFrame {
            input,
            loaded,
            seen: Seen {
                prediction,
                layers: Vec::new(),
                scale,
            },
            record,
            latency_ms,
            pictures,
        })
    }
}
