use crate::{AssumedCamera, DataSetConfig, Error, ExpectedSetting, Learn, LossConfig, Preset};
use crate::{
    AttentionConfig, AttentionForm, DepthNetConfig, FlowDecoderConfig, HceConfig, InputSize,
    PoseNetConfig,
};
use deepfusion_fs::absolute;
use deepfusion_kernels::Precision;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// How warped views are compared with their target.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Reprojection {
    /// Two frames, each warped onto the other: the paper's double-frame coupled reprojection.
    Bidirectional,
    /// At each pixel the smallest error of all sources, as in Monodepth2.
    Minimum,
    /// At each pixel the mean error of all sources, each times its explainability mask if there are such masks, as in SfMLearner.
    Mean,
}

/// How the motion of the reversed pair is obtained in bidirectional reprojection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ReversedPose {
    /// PoseNet runs again with the frames swapped.
    Predicted,
    /// The forward motion is inverted, which halves the pose network's work.
    Inverted,
}

/// The pose used for warping. At first, depth has to wait for PoseNet; what the vehicle already knows does not have to be learned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ViewMotion {
    /// PoseNet's, whose length the speed loss pulls towards the vehicle's, as in the paper.
    #[default]
    PoseNet,
    /// PoseNet's rotation and direction, with the length given by the vehicle's speed.
    Distance,
    /// The vehicle's own, from its speed and its turns: yaw, roll and pitch as measured, else as the images show them. PoseNet learns this
    /// motion alongside.
    Vehicle,
    /// As much as is known of each drive's motion: `vehicle` if its turns are known, measured or from the images, else `distance`.
    Auto,
}

impl ViewMotion {
    /// Its name, on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::PoseNet => "posenet",
            Self::Distance => "distance",
            Self::Vehicle => "vehicle",
            Self::Auto => "auto",
        }
    }
}

/// How images are changed before the networks see them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Augmentation {
    /// Mirror every other sample left to right, together with its camera and motion.
    pub flip: bool,
    /// Probability of a colour jitter; the losses always see the original images.
    pub jitter: f64,
    /// Largest change of brightness, contrast and saturation, as a factor around 1.
    pub brightness: f32,
    /// Largest change of hue, in turns.
    pub hue: f32,
    /// Largest zoom into images with known depth: the window cut out of an image is up to this many times smaller; 1: the whole image.
    #[serde(default = "no_zoom")]
    pub zoom: f32,
    /// Additional sizes of images with known depth, for a network that has to handle other aspect ratios. Half of the batches have the
    /// run's own size, the others take turns among these.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sizes: Vec<InputSize>,
    /// Additional sizes of video images, for a network that predicts each image at several scales. Half of the batches have the run's own
    /// size, the others take turns among these. Only with `canonical_focal_px`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub video_sizes: Vec<InputSize>,
}

/// How the learning rate falls over a run, after its warm-up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum LearningRateSchedule {
    /// To a tenth, at `learning_rate_drop`.
    #[default]
    Drop,
    /// Along half a cosine, from `learning_rate` to a hundredth of it.
    Cosine,
}

/// Where a run's images come from; a resumed run finds them by this.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DataConfig {
    /// Drive folders, date folders or KITTI roots.
    pub paths: Vec<PathBuf>,
    /// Recordings to validate on; empty: the held-out end of each drive.
    pub validation: Vec<PathBuf>,
    /// A split file that selects the frames to train on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub split: Option<PathBuf>,
    /// A split file that selects the frames to validate on, from `validation` or, if that is empty, from `paths`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub validation_split: Option<PathBuf>,
    /// How far the cameras' clock is ahead of the vehicles', in seconds; overrides the recordings' own files.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera_ahead_s: Option<f64>,
    /// Which topic of a bag to use for a role, such as `image=/camera/front/image_raw`, if message types do not decide it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub topics: Vec<String>,
    /// Which cameras to use: `2`, `3` or `both`; empty: 2.
    pub camera: String,
    /// Whether to use only turns that a sensor measured. Others are then unknown: roll and pitch are 0, and drives without a yaw rate have
    /// no turns. If false, they are estimated from the images, all of which are read for this before training.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub measured_turns_only: bool,
    /// What to learn from.
    #[serde(skip_serializing_if = "Learn::is_own_motion")]
    pub learn: Learn,
    /// Threads that decode, resize and render ahead of the training; absent: one per processor, at most 4.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub loader_threads: Option<usize>,
    /// Memory for decoded images, in MiB; absent: 2048. It keeps images at the run's size (and at each of `augmentation.video_sizes`), so
    /// that they are decoded once and not in every epoch. Workers and trials on one machine have a cache each.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cache_mib: Option<usize>,
    /// Several data sets with their own cameras, ranges and displacements, instead of `paths`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sets: Vec<DataSetConfig>,
}

/// Everything that decides a training run. One struct serves the command line, a configuration file
/// and the checkpoint; it is stored beside the run as `config.toml`, with what the run found out ([`crate::TrainFindings`]).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TrainConfig {
    /// The preset that this started from.
    pub preset: Preset,
    /// Width and height of the network's input images.
    pub size: InputSize,
    /// Offsets of the source frames, such as `[1]` or `[-1, 1]`.
    pub frames: Vec<i32>,
    /// Length of one step of an offset, in metres: one frame, or as many as the camera takes to move this far; 0: always one frame. At
    /// walking pace, a frame differs from the next by less than a pixel, which says nothing about depth.
    #[serde(default)]
    pub frame_distance_m: f64,
    /// How warped views are compared with their target.
    pub reprojection: Reprojection,
    /// How the motion of the reversed pair is obtained.
    pub reversed_pose: ReversedPose,
    /// Whether the other camera's image of the same moment is also a source. It is warped by the calibrated baseline, which gives metres
    /// whatever the speeds say. Needs `reprojection = "minimum"` and both cameras of a drive; drives with one camera learn from their own
    /// frames.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub stereo: bool,
    /// Samples per step.
    pub batch: usize,
    /// Samples with known depth per step, in addition to those of video if there are both; 0: as many as `batch`.
    #[serde(default)]
    pub depth_batch: usize,
    /// Batches whose gradients are averaged for one step of the optimiser.
    pub accumulate: usize,
    /// Passes over the data; `steps` overrides it.
    pub epochs: usize,
    /// Steps of the optimiser, instead of `epochs`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub steps: Option<usize>,
    /// Minimum number of optimiser steps if `steps` is not given: on a short drive, the epochs alone are too few to learn from.
    #[serde(default)]
    pub min_steps: usize,
    /// Adam's learning rate.
    pub learning_rate: f64,
    /// Steps over which the learning rate rises from 0. Large first steps can flatten the depth for good.
    pub learning_rate_warmup_steps: usize,
    /// How the learning rate falls.
    #[serde(default)]
    pub learning_rate_schedule: LearningRateSchedule,
    /// Steps over which the learning rate falls, if not those of the run. A run that ends earlier has then followed part of a longer run's
    /// schedule.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub learning_rate_steps: Option<usize>,
    /// Share of the run after which the learning rate is divided by ten, with the schedule `drop`.
    pub learning_rate_drop: f64,
    /// Decoupled weight decay (AdamW): the share of each weight that a step at a learning rate of 1 removes in addition to Adam's update.
    /// Biases and norms do not decay.
    #[serde(default)]
    pub weight_decay: f64,
    /// Largest norm of the gradient; longer ones are scaled down to it; 0: no limit.
    pub clip_norm: f64,
    /// Random seed, which decides everything random.
    pub seed: u64,
    /// How the networks' convolutions multiply in training. A trained network then predicts in f32, or as its runner says.
    #[serde(default)]
    pub precision: Precision,
    /// Weights to start from: a path, or with `init_sha256` the name of an embedded network.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub init: Option<PathBuf>,
    /// SHA-256 of the embedded network's weights, so that a repeated run notices if it would start from others.
    #[schemars(skip)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub init_sha256: Option<String>,
    /// Pairs slower than this are left out, in m/s.
    pub min_speed_mps: f64,
    /// Share of each drive, at its end, that is held out for validation.
    pub validation_share: f64,
    /// Steps between validations, checkpoints and panels; 0: once per epoch.
    pub validate_every: usize,
    /// Minutes after which a checkpoint is also written in between; 0: never. It does not affect what a run learns.
    #[serde(default = "checkpoint_minutes")]
    pub checkpoint_minutes: f64,
    /// Whether PoseNet starts out driving ahead by the data's mean displacement, instead of standing still. Needs the frames in time order,
    /// so it has no effect if the reversed pose is predicted.
    pub start_moving: bool,
    /// The pose used for warping.
    #[serde(default)]
    pub view_motion: ViewMotion,
    /// Canonical focal length f_c, in pixels of the network's input, to which all cameras are brought (Metric3D). The network predicts
    /// depth × f_c/f_y, so that equal pixels mean equal output for every lens. Absent: it predicts depth for the training camera, the first
    /// one if there are several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub canonical_focal_px: Option<f64>,
    /// Weights that do not learn, given by the beginnings of their names: `depth.encoder`, `depth.encoder.layer1`, `pose`. A batch norm's
    /// statistics are not among them (see `frozen_statistics`). With `pose` and `view_motion = "vehicle"`, PoseNet is left out unless it
    /// has masks (`explainability`): nothing would use its output, steps are shorter, and the run has no odometry.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub freeze: Vec<String>,
    /// The camera of recordings that do not state theirs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub assumed_camera: Option<AssumedCamera>,
    /// The recordings.
    #[serde(default)]
    pub data: DataConfig,
    /// The loss.
    pub loss: LossConfig,
    /// The augmentation.
    pub augmentation: Augmentation,
    /// The depth network.
    pub depth_net: DepthNetConfig,
    /// The pose network. `metres_per_unit` 0 means the data's mean displacement per pair, and 1 without
    /// the speed loss.
    pub pose_net: PoseNetConfig,
    /// The flow decoder. It exists only in training, and only if `loss.flow.weight` is above 0.
    #[serde(default)]
    pub flow_decoder: FlowDecoderConfig,
}

fn no_zoom() -> f32 {
    1.0
}

/// At most this much work is lost if the process is killed or the power fails.
fn checkpoint_minutes() -> f64 {
    10.0
}

impl DataConfig {
    /// Maximum number of loader threads if the configuration sets none.
    const LOADER_THREADS: usize = 4;

    /// Number of loader threads on this machine.
    #[must_use]
    pub fn loader_threads_here(&self) -> usize {
        self.loader_threads.unwrap_or_else(|| {
            let processors = std::thread::available_parallelism().map_or(1, usize::from);
            processors.min(Self::LOADER_THREADS)
        })
    }

    /// Maximum size of the image cache in bytes.
    #[must_use]
    pub fn cache_bytes(&self) -> usize {
        self.cache_mib.unwrap_or(2048).saturating_mul(1 << 20)
    }

    /// Makes every path absolute, so that the run can be resumed and evaluated from any folder.
    pub fn make_absolute(&mut self) {
        // All fields are listed, so that whoever adds one decides whether it is a path.
        let Self {
            paths,
            validation,
            split,
            validation_split,
            camera_ahead_s: _,
            topics: _,
            camera: _,
            measured_turns_only: _,
            learn: _,
            loader_threads: _,
            cache_mib: _,
            sets,
        } = self;
        let mut all: Vec<&mut PathBuf> = paths.iter_mut().chain(validation).collect();
        all.extend(split);
        all.extend(validation_split);
        for set in sets {
            all.extend(set.paths.iter_mut().chain(&mut set.validation));
            all.extend(&mut set.split);
            all.extend(&mut set.validation_split);
        }
        for path in all {
            *path = absolute(path);
        }
    }
}

impl TrainConfig {
    /// Makes every path absolute, except for the name of an embedded network.
    pub fn make_absolute(&mut self) {
        self.data.make_absolute();
        if self.init_sha256.is_none() {
            self.init = self.init.as_deref().map(absolute);
        }
    }

    /// Names that [`Self::with`] and [`Self::without`] accept: parts of the depth network, then the terms of the loss.
    pub const TERMS: [&'static str; 9] = [
        "hce",
        "attention",
        "aggregation",
        "smoothness",
        "speed",
        "automask",
        "affine",
        "flow",
        "moving",
    ];

    /// Metres per unit of PoseNet's translation unless the configuration sets it: the data's mean displacement, so that the raw outputs
    /// stay near 1. Without the speed loss it is 1, as no measured motion may influence the training, not even initially.
    #[must_use]
    pub fn first_unit(&self, mean_displacement_m: f64) -> f64 {
        if self.loss.speed > 0.0 {
            mean_displacement_m
        } else {
            1.0
        }
    }

    /// Reads a TOML file. From a run's file it reads the settings, not the findings ([`crate::RunFolder::read_findings`]).
    ///
    /// # Errors
    /// [`Error::NoSuchFile`], [`Error::Io`], [`Error::ConfigFile`] naming the line, and those of [`Self::validate`].
    pub fn read(path: &std::path::Path) -> Result<Self, Error> {
        let text = std::fs::read_to_string(path).map_err(|e| Error::io(path, "read", e))?;
        let (config, _) = Self::from_run_text(&text).map_err(|e| Error::ConfigFile {
            path: path.to_owned(),
            reason: e.into(),
        })?;
        config.validate()?;
        Ok(config)
    }

    /// The configuration as TOML.
    ///
    /// # Errors
    /// [`Error::Config`] if a value has no TOML form.
    pub fn to_toml(&self) -> Result<String, Error> {
        toml::to_string_pretty(self)
            .map_err(|e| Error::config("config", ExpectedSetting::TomlValues, e))
    }

    /// Switches a part of the depth network or a term of the loss on by its name. Unless it is already on, it gets the paper's settings.
    ///
    /// # Errors
    /// [`Error::Config`] for a name that is not in [`Self::TERMS`].
    pub fn with(&mut self, term: &str) -> Result<(), Error> {
        let net = &mut self.depth_net;
        match known(term, "with")? {
            "hce" => {
                net.hce.get_or_insert_with(HceConfig::default);
            }
            "attention" => {
                // Not the paper's product, which starts at a quarter of the feature: trained from scratch, it worsened abs_rel by 7 to 9 %
                // at 1,000 steps (docs/benchmarks/paper.md).
                net.attention.get_or_insert(AttentionConfig {
                    form: AttentionForm::Residual,
                    ..AttentionConfig::default()
                });
            }
            "aggregation" => net.aggregation = true,
            term => self.loss.with(term)?,
        }
        Ok(())
    }

    /// Switches a part of the depth network or a term of the loss off by its name. Without the speed loss no measurement fixes the scale,
    /// so the pose used for warping is then PoseNet's.
    ///
    /// # Errors
    /// [`Error::Config`] for a name that is not in [`Self::TERMS`].
    pub fn without(&mut self, term: &str) -> Result<(), Error> {
        match known(term, "without")? {
            "hce" => self.depth_net.hce = None,
            "attention" => self.depth_net.attention = None,
            "aggregation" => self.depth_net.aggregation = false,
            term => self.loss.without(term)?,
        }
        if self.loss.speed == 0.0 {
            self.view_motion = ViewMotion::PoseNet;
        }
        Ok(())
    }

    /// The name that freezes all of PoseNet in [`Self::freeze`].
    pub const POSE_NET: &'static str = "pose";

    /// Whether PoseNet is left out: it is frozen, its poses are not used for warping, and it predicts no masks.
    #[must_use]
    pub fn leaves_pose_net_out(&self) -> bool {
        self.view_motion == ViewMotion::Vehicle
            && !self.pose_net.explainability
            && self.freeze.iter().any(|name| name == Self::POSE_NET)
    }

    /// Number of optimiser steps, for epochs of `steps_per_epoch` steps.
    #[must_use]
    pub fn steps_of(&self, steps_per_epoch: usize) -> usize {
        let of_epochs = self.epochs * steps_per_epoch;
        self.steps.unwrap_or(of_epochs.max(self.min_steps))
    }

    /// What is learned from the data set at an index of `data.sets`.
    #[must_use]
    pub fn learn(&self, set: usize) -> Learn {
        let own = self.data.sets.get(set).map(|set| set.learn);
        own.unwrap_or(self.data.learn)
    }

    /// Samples with known depth per step.
    #[must_use]
    pub fn depth_batch(&self) -> usize {
        match self.depth_batch {
            0 => self.batch,
            own => own,
        }
    }

    /// Size of the images with known depth in batch number `number`. Batches that several workers learn from in one step count as one.
    #[must_use]
    pub fn size_of_depth_batch(&self, number: usize) -> InputSize {
        in_turns(self.size, &self.augmentation.sizes, number)
    }

    /// Size of the video images in batch number `number`. Batches that several workers learn from in one step count as one.
    #[must_use]
    pub fn size_of_video_batch(&self, number: usize) -> InputSize {
        in_turns(self.size, &self.augmentation.video_sizes, number)
    }

    /// Whether training needs to know how the vehicle turned, not only how far it moved. With `auto`, turns are used if they are known.
    #[must_use]
    pub fn reads_rotation(&self) -> bool {
        match self.view_motion {
            ViewMotion::Vehicle => true,
            ViewMotion::Auto => false,
            ViewMotion::PoseNet | ViewMotion::Distance => {
                self.loss.speed > 0.0 && self.loss.rotation > 0.0
            }
        }
    }
}

/// The run's own size for every other batch, and one of the other sizes in turn for those between.
fn in_turns(own: InputSize, others: &[InputSize], number: usize) -> InputSize {
    if others.is_empty() || number.is_multiple_of(2) {
        own
    } else {
        others[number / 2 % others.len()]
    }
}

/// Checks that there is a term of this name.
fn known(term: &str, field: &'static str) -> Result<&'static str, Error> {
    let terms = TrainConfig::TERMS;
    let found = terms.iter().find(|t| **t == term).copied();
    found.ok_or_else(|| {
        let known = terms.map(str::to_owned).to_vec();
        Error::config(field, ExpectedSetting::OneOf(known), term.to_owned())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_path_becomes_absolute() {
        let set = DataSetConfig {
            paths: vec!["c".into()],
            validation: vec!["d".into()],
            split: Some("e.txt".into()),
            validation_split: Some("i.txt".into()),
            ..DataSetConfig::default()
        };
        let mut data = DataConfig {
            paths: vec!["a".into(), "/b".into()],
            validation: vec!["f".into()],
            split: Some("g.txt".into()),
            validation_split: Some("h.txt".into()),
            camera_ahead_s: None,
            topics: Vec::new(),
            camera: "both".into(),
            measured_turns_only: true,
            learn: Learn::default(),
            loader_threads: None,
            cache_mib: None,
            sets: vec![set],
        };
        data.make_absolute();
        let here = std::env::current_dir().unwrap();
        assert_eq!(data.paths, [here.join("a"), "/b".into()]);
        assert_eq!(data.validation, [here.join("f")]);
        assert_eq!(data.split, Some(here.join("g.txt")));
        assert_eq!(data.validation_split, Some(here.join("h.txt")));
        assert_eq!(data.sets[0].validation_split, Some(here.join("i.txt")));
        assert_eq!(data.sets[0].paths, [here.join("c")]);
        assert_eq!(data.sets[0].validation, [here.join("d")]);
        assert_eq!(data.sets[0].split, Some(here.join("e.txt")));
    }

    /// The paths of a run become absolute. The name of an embedded network is not a path.
    #[test]
    fn the_name_of_an_embedded_network_stays() {
        let mut config = Preset::Tiny.config();
        config.init = Some("street".into());
        let mut path = config.clone();
        path.make_absolute();
        let here = std::env::current_dir().unwrap();
        assert_eq!(path.init, Some(here.join("street")));
        config.init_sha256 = Some("ab".repeat(32));
        let mut name = config.clone();
        name.make_absolute();
        assert_eq!(name, config);
        let text = config.to_toml().unwrap();
        assert_eq!(toml::from_str::<TrainConfig>(&text).unwrap(), config);
    }

    /// A run from before this key existed is read with its default.
    #[test]
    fn checkpoints_are_due_every_ten_minutes_by_default() {
        let config = Preset::Tiny.config();
        assert_eq!(config.checkpoint_minutes, 10.0);
        let text = config.to_toml().unwrap();
        let older: String = text
            .lines()
            .filter(|line| !line.starts_with("checkpoint_minutes"))
            .map(|line| format!("{line}\n"))
            .collect();
        assert_ne!(older, text);
        assert_eq!(toml::from_str::<TrainConfig>(&older).unwrap(), config);
        let mut config = config;
        config.checkpoint_minutes = -1.0;
        let error = config.validate().unwrap_err().to_string();
        assert!(error.contains("`checkpoint_minutes`"), "{error}");
    }

    #[test]
    fn networks_that_could_not_read_pairs_or_learn_are_refused() {
        let mut config = Preset::Tiny.config();
        config.pose_net.encoder.frames = 3;
        let error = config.validate().unwrap_err().to_string();
        assert!(error.contains("pose_net.encoder.frames"), "{error}");
        let mut config = Preset::Tiny.config();
        config.data.sets = vec![DataSetConfig {
            name: "rooms".into(),
            paths: vec!["rooms".into()],
            learn: Learn::Depth,
            ..DataSetConfig::default()
        }];
        config.validate().unwrap();
        config.loss.depth.weight = 0.0;
        let error = config.validate().unwrap_err().to_string();
        assert!(error.contains("loss.depth.weight"), "{error}");
        config.depth_net.uncertainty = true;
        config.validate().unwrap();
    }

    #[test]
    fn parts_of_the_network_are_switched_by_name() {
        let start = Preset::Light.config();
        let mut config = start.clone();
        for term in TrainConfig::TERMS {
            config.with(term).unwrap();
        }
        config.validate().unwrap();
        let net = &config.depth_net;
        assert!(net.hce.is_some() && net.attention.is_some() && net.aggregation);
        for term in ["hce", "attention", "aggregation"] {
            config.without(term).unwrap();
        }
        assert_eq!(config.depth_net, start.depth_net);
        let error = config.with("hope").unwrap_err().to_string();
        assert!(error.contains("hce, attention, aggregation"), "{error}");
    }

    /// A short drive gets the minimum number of steps, a long one its epochs, and an explicit number of steps is kept.
    #[test]
    fn a_short_drive_has_enough_steps() {
        let mut config = Preset::Light.config();
        assert_eq!((config.epochs, config.min_steps), (20, 1200));
        assert_eq!(config.steps_of(34), 1200);
        assert_eq!(config.steps_of(340), 6800);
        config.min_steps = 0;
        assert_eq!(config.steps_of(34), 680);
        config.steps = Some(5);
        assert_eq!(config.steps_of(34), 5);
    }

    /// Without the speed loss, PoseNet's poses are used for warping: `without` changes the setting, and setting another one afterwards is
    /// an error.
    #[test]
    fn without_the_speed_loss_posenet_warps_the_views() {
        let mut config = Preset::Tiny.config();
        assert_ne!(config.view_motion, ViewMotion::PoseNet);
        assert_eq!(config.first_unit(0.7), 0.7);
        config.without("speed").unwrap();
        assert_eq!(config.first_unit(0.7), 1.0, "no measured motion is used");
        config.validate().unwrap();
        for motion in [ViewMotion::Distance, ViewMotion::Vehicle, ViewMotion::Auto] {
            config.view_motion = motion;
            let error = config.validate().unwrap_err();
            let Error::Config { field, found, .. } = &error else {
                panic!("{error}");
            };
            assert_eq!(*field, "view_motion");
            assert_eq!(found.to_string(), format!("{motion:?}").to_lowercase());
            assert!(error.to_string().contains("posenet if loss.speed is 0"));
        }
    }
}
