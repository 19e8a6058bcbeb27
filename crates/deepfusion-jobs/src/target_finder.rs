//! Finds 3D targets in one frame after another: depth, ground, objects, boxes, tracks; also monitors the scale.

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

/// Settings for finding targets, besides the network.
#[derive(Debug)]
pub struct TargetSettings {
    /// Settings of the perception.
    pub perception: PerceptionConfig,
    /// The user's segmentation model: the objects it finds become targets with a class.
    pub instances: Option<InstanceModel>,
    /// How the scale is monitored if a recording's motion is known.
    pub scale: ScaleMonitorConfig,
    /// Whether depth is corrected if its scale has drifted.
    pub correct_scale: bool,
    /// What is drawn for each frame.
    pub draw: Vec<TargetOutput>,
}

/// A loaded frame, and when loading began.
pub struct StartedFrame {
    /// The input.
    pub input: Input,
    /// The image as read.
    pub loaded: LoadedImage,
    /// The network's input.
    pub prepared: PreparedImage,
    /// When its file was opened, or when a live frame arrived.
    pub start: Instant,
}

/// A frame with everything that was found in it.
pub struct PerceivedFrame {
    /// The input.
    pub input: Input,
    /// The image as read.
    pub loaded: LoadedImage,
    /// Its depth.
    pub seen: SeenDepth,
    /// Its targets.
    pub record: FrameRecord,
    /// Time from [`StartedFrame::start`] to its targets, in milliseconds.
    pub latency_ms: f64,
    /// The current scale divided by its first value, if a drift is first found in this frame.
    pub drift: Option<f64>,
    /// What was drawn.
    pub pictures: Vec<(TargetOutput, Drawing)>,
}

/// Finds the targets in one frame after another, and tracks them.
pub struct TargetFinder<'a> {
    estimator: &'a mut DepthEstimator,
    perception: Perception,
    watch: ScaleWatch,
    instances: Option<InstanceModel>,
    /// The confidence of each pixel, if it was learned for the run.
    confidence: Option<ConfidenceModel>,
    /// The factors of the network's intervals.
    intervals: IntervalFactors,
    draw: Vec<TargetOutput>,
}

impl<'a> TargetFinder<'a> {
    /// A finder for a network, without frames yet.
    ///
    /// # Errors
    /// Files beside the network that cannot be read.
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

    /// The targets in the next frame; `motion` is the camera's motion up to it.
    ///
    /// # Errors
    /// [`Error::NoCamera`]; an error of the network's engine, of the perception or of the user's model.
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
        if !motion.continues {
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
        // Results are not delayed by this.
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

/// The objects that the user's model finds in an image, at the size of its depth.
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
