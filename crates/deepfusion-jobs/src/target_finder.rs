//! Frame after frame to 3D targets: depth, ground, things, boxes, tracks, and whether the metres still hold.

use std::time::Instant;

use deepfusion_data::RgbImage;
use deepfusion_eval::IntervalFactors;
use deepfusion_geometry::DepthMap;
use deepfusion_instances::InstanceModel;
use deepfusion_motion::ScaleMonitorConfig;
use deepfusion_perception::{
    ConfidenceModel, Instance, Perception, PerceptionConfig, Run, VehicleShape, scale_bounds,
    time_to_collision, working_depth,
};
use deepfusion_records::FrameRecord;
use deepfusion_runtime::{DepthEstimator, ModelSource, PreparedImage};

use crate::bulk::LoadedImage;
use crate::evaluation::confidence::Confidence;
use crate::outputs::{Drawing, SeenDepth, TargetOutput, TargetScene, draw};
use crate::scene::{Motion, ScaleWatch};
use crate::{Error, Input, ModelFacts, Result, intervals};

/// How targets are found, beside the network.
#[derive(Debug)]
pub struct TargetSettings {
    /// The perception's own.
    pub perception: PerceptionConfig,
    /// A user's model of segmentation: what it knows becomes targets of a class.
    pub instances: Option<InstanceModel>,
    /// How the scale is watched, where a recording's motion is known.
    pub scale: ScaleMonitorConfig,
    /// Whether depth is brought back where its scale has drifted.
    pub correct_scale: bool,
    /// What is drawn of each frame.
    pub draw: Vec<TargetOutput>,
}

/// A frame that is loaded, and when that began.
pub struct StartedFrame {
    /// What it is.
    pub input: Input,
    /// As it was read.
    pub loaded: LoadedImage,
    /// As the network takes it.
    pub prepared: PreparedImage,
    /// When its file was opened, or when a live frame arrived.
    pub start: Instant,
}

/// A frame with all that was found in it.
pub struct PerceivedFrame {
    /// What it is.
    pub input: Input,
    /// As it was read.
    pub loaded: LoadedImage,
    /// Its depth.
    pub seen: SeenDepth,
    /// Its targets.
    pub record: FrameRecord,
    /// From [`StartedFrame::start`] to having the targets.
    pub latency_ms: f64,
    /// How many times their first size metres are now, where that is seen for the first time here.
    pub drift: Option<f64>,
    /// What was drawn.
    pub pictures: Vec<(TargetOutput, Drawing)>,
}

/// Finds the targets of frame after frame, and follows them.
pub struct TargetFinder<'a> {
    estimator: &'a mut DepthEstimator,
    perception: Perception,
    watch: ScaleWatch,
    instances: Option<InstanceModel>,
    /// What a pixel's depth is worth, where the run was calibrated.
    confidence: Option<ConfidenceModel>,
    /// How the intervals are stretched that the network says.
    intervals: IntervalFactors,
    draw: Vec<TargetOutput>,
}

impl<'a> TargetFinder<'a> {
    /// Of a network, nothing seen yet.
    ///
    /// # Errors
    /// What is kept beside the network cannot be read.
    pub fn open(
        model: &ModelSource,
        estimator: &'a mut DepthEstimator,
        settings: TargetSettings,
    ) -> Result<Self> {
        let confidence = match model.folder() {
            Some(run) => Confidence::read(run, estimator.step)?,
            None => None,
        };
        Ok(Self {
            estimator,
            perception: Perception::new(settings.perception),
            watch: ScaleWatch::new(settings.scale, settings.correct_scale),
            instances: settings.instances,
            confidence: confidence.map(|c| c.single),
            intervals: model.interval_factors()?,
            draw: settings.draw,
        })
    }

    /// The targets of the next frame; `motion`: how the camera came there.
    ///
    /// # Errors
    /// [`Error::NoCamera`]; what the network's engine, the perception or the user's model says.
    pub fn next(&mut self, started: StartedFrame, motion: Motion) -> Result<PerceivedFrame> {
        let StartedFrame {
            input,
            loaded,
            prepared,
            start,
        } = started;
        let mut prediction = self.estimator.infer(&prepared)?;
        let camera = loaded.camera.ok_or(Error::NoCamera)?;
        self.watch.see_through(&camera, &motion);
        if let Some(factor) = self.watch.correction() {
            prediction.scale_depth(factor);
        }
        if !motion.goes_on {
            self.perception.reset();
        }
        let whole = prediction.depth();
        let sigma = intervals::sigma(&prediction, &whole, &self.intervals);
        let (depth, k) = working_depth(&whole, &camera);
        let sigma = sigma.map(|sigma| working_depth(&sigma, &camera).0);
        let things = match &mut self.instances {
            Some(model) => things_of(model, &loaded.image, &depth)?,
            None => Vec::new(),
        };
        let surroundings =
            self.perception
                .detect_with_sigma(&depth, sigma.as_ref(), &k, motion.stamp, &things)?;
        let collision = motion.speed_mps.and_then(|speed| {
            let vehicle = VehicleShape {
                camera_yaw_rad: motion.camera_yaw()?,
                ..VehicleShape::default()
            };
            time_to_collision(&surroundings.targets, speed, motion.yaw_rate, &vehicle)
        });
        let latency_ms = start.elapsed().as_secs_f64() * 1e3;
        // The targets need not wait for it.
        let (image, ground) = (&loaded.image, surroundings.ground.as_ref());
        let scale = self.watch.add(image, &camera, &motion, ground);
        let drift = self.watch.first_drift();
        let mut record = FrameRecord {
            scale_monitor: scale,
            ..FrameRecord::new(
                &input.name,
                &surroundings,
                (motion.stamp, motion.speed_mps),
                collision,
                latency_ms,
            )
        };
        let size = [image.width(), image.height()];
        scale_bounds(&mut record.targets, [depth.width, depth.height], size);
        let scene = TargetScene {
            image: (image, &camera),
            depth: (&depth, &k),
            sigma: sigma.as_ref(),
            surroundings: &surroundings,
            perception: &self.perception,
            confidence: self.confidence.as_ref().map(|model| (model, &prediction)),
        };
        let pictures = draw(&self.draw, &scene);
        Ok(PerceivedFrame {
            input,
            loaded,
            seen: SeenDepth {
                prediction,
                layers: Vec::new(),
                scale,
            },
            record,
            latency_ms,
            drift,
            pictures,
        })
    }
}

/// The things in an image by a user's model, in the size of its depth.
fn things_of(
    model: &mut InstanceModel,
    image: &RgbImage,
    depth: &DepthMap,
) -> Result<Vec<Instance>> {
    let found = model.find(image, [depth.width, depth.height])?;
    let instance = |thing: deepfusion_instances::Instance| Instance {
        class: thing.class,
        score: thing.score,
        drawn: thing.drawn,
        runs: thing
            .mask
            .runs
            .into_iter()
            .map(|[v, from, to]| Run { v, from, to })
            .collect(),
    };
    Ok(found.into_iter().map(instance).collect())
}
