//! The settings with which a network is adapted to new drives.

use deepfusion_data::{Cameras, Dataset};
use deepfusion_model::{
    AssumedCamera, DataSetConfig, InputSize, Learn, LearningRateSchedule, Preset, SimulatedCamera,
    SimulatedConfig, TrainConfig, ViewMotion,
};
use deepfusion_nn::ops::{Precision, supports};
use deepfusion_runtime::{Augmentation, DepthEstimator};
use deepfusion_train::{Device, recordings_with_stereo};

use super::{AdaptSettings, cameras};
use crate::Result;
use crate::recordings::camera_word;

/// Number of steps over which the learning rate rises: at first the optimiser has no estimate of the gradients' magnitude.
const WARMUP: usize = 30;
/// Seed of simulated worlds that no other recipe uses.
const SEED: u64 = 91;
/// Share of them in clear weather and through an undistorted camera.
const PLAIN: f64 = 0.2;

/// Largest relative difference between the aspect ratios of another size and of the network's own: squeezed images look different.
const SQUEEZE: f64 = 0.05;

/// The configuration: the network as it is, with the loss of its own run if that learned from drives, otherwise Monodepth2's with the
/// vehicle's motion; with a small learning rate.
pub(super) fn config(
    settings: &AdaptSettings,
    estimator: &DepthEstimator,
    device: &Device,
    opened: &[Dataset],
) -> Result<TrainConfig> {
    let own = estimator.config();
    let learned_from_drives = learned_from_drives(own, estimator.training_camera().is_some());
    let mut config = if learned_from_drives {
        own.clone()
    } else {
        let monodepth2 = Preset::Monodepth2.config_on(settings.compute);
        TrainConfig {
            preset: own.preset,
            size: own.size,
            depth_net: own.depth_net.clone(),
            view_motion: ViewMotion::Vehicle,
            ..monodepth2
        }
    };
    // A few drives give poor batch norm statistics.
    config.depth_net.encoder.frozen_statistics = true;
    // Other cameras are converted to the focal length that it was trained with: only the place should be new to it.
    config.canonical_focal_px = own.canonical_focal_px.or_else(|| {
        let camera = estimator.training_camera()?;
        let (width, height) = (own.size.width as u32, own.size.height as u32);
        Some(camera.resized(width, height).fy)
    });
    config.assumed_camera = assumed_camera(estimator);
    // Each of two cameras is a view for the other: their baseline is known more accurately than any speed.
    let both = settings.camera == Cameras::Both;
    config.stereo = both && (config.stereo || (!learned_from_drives && has_pairs(opened)));
    let new_pose_net = !learned_from_drives || own.leaves_pose_net_out();
    if new_pose_net {
        // A new PoseNet's unit is determined from these drives.
        config.pose_net.metres_per_unit = 0.0;
    }
    config.batch = settings.batch;
    config.depth_batch = settings.simulated;
    config.accumulate = 1;
    config.steps = Some(settings.steps);
    config.learning_rate = settings.learning_rate;
    config.learning_rate_warmup_steps = WARMUP.min(settings.steps / 4);
    config.learning_rate_schedule = LearningRateSchedule::Cosine;
    config.weight_decay = 0.0;
    config.seed = settings.seed;
    config.validation_share = settings.held_out;
    config.validate_every = (settings.steps / 4).max(1);
    config.checkpoint_minutes = 2.0;
    if supports(device, Precision::Bf16) {
        config.precision = Precision::Bf16;
    }
    config.data = Default::default();
    config.data.camera_ahead_s = settings.camera_ahead_s;
    config.data.camera = camera_word(settings.camera).into();
    config.data.topics = settings.topics.iter().map(ToString::to_string).collect();
    if settings.simulated == 0 {
        config.data.paths.clone_from(&settings.data);
        // The head has no ground truth to learn from, and what it has learned would no longer fit.
        config.depth_net.uncertainty = false;
    } else {
        let cameras = if settings.own_camera {
            cameras::of_drives(opened)?
        } else {
            Vec::new()
        };
        config.data.sets = vec![drives(settings, &config), simulated(&config, cameras)];
        config.loss.depth.weight = 1.0;
        config.loss.depth.gradient = 0.5;
    }
    assign(&mut config, &of_no_element(&settings.set))?;
    if new_pose_net {
        leave_pose_net_out(&mut config, &settings.set);
    }
    // Sizes around the current size; explicit settings of the sizes, or of single ones, take precedence.
    if own.canonical_focal_px.is_some() {
        learn_at_several_sizes(&mut config, settings.simulated > 0);
    }
    assign(&mut config, &settings.set)?;
    Ok(config)
}

/// Whether the network's own run learned from drives. Imported weights have no camera and no metric scale, but the settings of a preset
/// that learns from drives; they are trained with the vehicle's motion instead.
fn learned_from_drives(own: &TrainConfig, knows_camera: bool) -> bool {
    let from_motion = if own.data.sets.is_empty() {
        own.data.learn.from_motion()
    } else {
        own.data.sets.iter().any(|set| set.learn.from_motion())
    };
    from_motion && knows_camera
}

/// The settings except those of single elements of lists, which may not exist yet.
fn of_no_element(set: &[String]) -> Vec<String> {
    let of_none = |assignment: &&String| {
        let key = assignment.split('=').next();
        key.is_none_or(|key| !key.contains('['))
    };
    set.iter().filter(of_none).cloned().collect()
}

fn assign(config: &mut TrainConfig, settings: &[String]) -> Result<()> {
    for assignment in settings {
        config.set(assignment)?;
    }
    Ok(())
}

/// Leaves PoseNet out: depth does not need it. It is used and trained only if the views are warped by its poses, or if its masks are
/// requested; an explicit setting of what is frozen takes precedence.
fn leave_pose_net_out(config: &mut TrainConfig, set: &[String]) {
    let says_frozen = set.iter().any(|key| key.trim_start().starts_with("freeze"));
    if says_frozen {
        return;
    }
    let others = config
        .freeze
        .iter()
        .filter(|name| *name != TrainConfig::POSE_NET);
    let others: Vec<String> = others.cloned().collect();
    config.freeze.clone_from(&others);
    config.freeze.push(TrainConfig::POSE_NET.into());
    if !config.leaves_pose_net_out() {
        config.freeze = others;
    }
}

/// Keeps a network of many cameras as good with test-time augmentation at several scales as it was. One that was trained at several sizes
/// already keeps those.
fn learn_at_several_sizes(config: &mut TrainConfig, simulated: bool) {
    let sizes = sizes_around(config.size);
    let augmentation = &mut config.augmentation;
    if simulated && augmentation.sizes.is_empty() {
        augmentation.sizes.clone_from(&sizes);
    }
    if augmentation.video_sizes.is_empty() {
        augmentation.video_sizes = sizes;
    }
}

/// Sizes near those used for predicting an image at several scales, which the encoder supports and which hardly squeeze the image.
fn sizes_around(own: InputSize) -> Vec<InputSize> {
    let aspect = |size: &InputSize| size.width as f64 / size.height as f64;
    let side = |side: usize, scale: f64| 32 * (side as f64 * scale / 32.0).round() as usize;
    let sizes = Augmentation::MULTI_SCALE
        .scales
        .iter()
        .map(|scale| InputSize {
            width: side(own.width, *scale),
            height: side(own.height, *scale),
        });
    let hardly_squeezes = |size: &InputSize| (aspect(size) / aspect(&own) - 1.0).abs() < SQUEEZE;
    sizes
        .filter(|size| size.validate().is_ok() && hardly_squeezes(size))
        .collect()
}

/// Whether the settings use only measured turns, as [`config`] will decide.
pub(super) fn takes_measured_turns_only(
    settings: &AdaptSettings,
    estimator: &DepthEstimator,
) -> Result<bool> {
    let mut config = estimator.config().clone();
    config.data = Default::default();
    assign(&mut config, &of_no_element(&settings.set))?;
    Ok(config.data.measured_turns_only)
}

/// Whether the recordings contain rectified pairs of cameras, and every second camera can serve as a view of the first.
fn has_pairs(opened: &[Dataset]) -> bool {
    recordings_with_stereo(opened).is_ok_and(|count| count > 0)
}

/// The camera that a network's run learned or assumed for recordings without one, kept fixed; `None` if all had one.
#[must_use]
pub fn assumed_camera(estimator: &DepthEstimator) -> Option<AssumedCamera> {
    let assumed = estimator.config().assumed_camera?;
    if !assumed.learn {
        return Some(assumed);
    }
    estimator
        .training_camera()
        .as_ref()
        .map(AssumedCamera::fixed)
}

fn drives(settings: &AdaptSettings, config: &TrainConfig) -> DataSetConfig {
    DataSetConfig {
        name: "drives".into(),
        paths: settings.data.clone(),
        learn: Learn::OwnMotion,
        metres_per_unit: config.pose_net.metres_per_unit,
        ..DataSetConfig::default()
    }
}

fn simulated(config: &TrainConfig, cameras: Vec<SimulatedCamera>) -> DataSetConfig {
    DataSetConfig {
        name: "streets".into(),
        learn: Learn::Depth,
        simulated: Some(SimulatedConfig {
            seed: SEED.wrapping_add(config.seed),
            views: 2000,
            validation_views: 16,
            views_per_world: 12,
            plain: PLAIN,
            cameras,
            ..SimulatedConfig::default()
        }),
        metres_per_unit: 1.0,
        ..DataSetConfig::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An import has Monodepth2's settings. If they were taken for those it was trained with, only its PoseNet's motion would be used for
    /// warping.
    #[test]
    fn imported_weights_have_not_learned_from_drives() {
        let mut config = Preset::Monodepth2.config();
        assert!(learned_from_drives(&config, true));
        assert!(!learned_from_drives(&config, false));
        config.data.learn = Learn::Depth;
        assert!(!learned_from_drives(&config, true));
        config.data.sets = vec![DataSetConfig::default()];
        assert!(learned_from_drives(&config, true));
    }

    #[test]
    fn sizes_hardly_squeeze_the_image() {
        let around = |width, height| -> Vec<[usize; 2]> {
            let sizes = sizes_around(InputSize { width, height });
            sizes.iter().map(|s| [s.width, s.height]).collect()
        };
        assert_eq!(around(640, 192), [[512, 160], [768, 224]]);
        assert_eq!(around(1024, 320), [[832, 256], [1216, 384]]);
        // For such a low image, a step of 32 pixels is too large.
        assert_eq!(around(320, 96), Vec::<[usize; 2]>::new());
    }

    #[test]
    fn sizes_that_are_set_stay() {
        let mut config = Preset::Light.config();
        learn_at_several_sizes(&mut config, false);
        let video = config.augmentation.video_sizes.clone();
        assert_eq!((video.len(), config.augmentation.sizes.len()), (2, 0));
        let own = vec![InputSize {
            width: 320,
            height: 96,
        }];
        config.augmentation.video_sizes.clone_from(&own);
        learn_at_several_sizes(&mut config, true);
        assert_eq!(config.augmentation.video_sizes, own);
        assert_eq!(config.augmentation.sizes, video);
        // Settings of single sizes are applied once there are sizes.
        let set: [String; 2] = [
            "augmentation.sizes[1].width = 800".into(),
            "augmentation.video_sizes=[]".into(),
        ];
        assert_eq!(of_no_element(&set), set[1..]);
        assign(&mut config, &set).unwrap();
        assert!(config.augmentation.video_sizes.is_empty());
        assert_eq!(config.augmentation.sizes[1].width, 800);
    }

    #[test]
    fn a_new_pose_net_is_left_out_unless_something_needs_it() {
        let frozen = |before: &[&str], set: &[&str]| {
            let set: Vec<String> = set.iter().map(|&key| key.into()).collect();
            let mut config = Preset::Monodepth2.config();
            config.view_motion = ViewMotion::Vehicle;
            config.freeze = before.iter().map(|&name| name.into()).collect();
            assign(&mut config, &set).unwrap();
            leave_pose_net_out(&mut config, &set);
            config.freeze
        };
        let (nothing, pose): ([&str; 0], _) = ([], ["pose"]);
        // For a network without PoseNet, and for one that an earlier adaptation left without.
        for before in [&nothing[..], &pose[..]] {
            assert_eq!(frozen(before, &["loss.smoothness=0.01"]), pose);
            assert_eq!(frozen(before, &["view_motion=distance"]), nothing);
            assert_eq!(frozen(before, &["pose_net.explainability=true"]), nothing);
            assert_eq!(frozen(before, &["freeze=[]"]), nothing);
            let encoder = ["depth.encoder"];
            assert_eq!(frozen(before, &["freeze=[\"depth.encoder\"]"]), encoder);
        }
    }
}
