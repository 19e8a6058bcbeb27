//! The distance between neighbouring frames according to PoseNet.

use std::path::Path;

use deepfusion_data::Dataset;
use deepfusion_eval::verdict::{SpeedRow, speed_rows};
use deepfusion_model::TrainConfig;
use deepfusion_runtime::ModelSource;
use deepfusion_train::{Device, PosePredictor};

use super::{Unseen, VerdictOptions, VerdictWarning, plan};
use crate::Result;

/// If the focal length differs from the one trained with by more than this share, at the network's size, PoseNet's motion is not
/// comparable.
const FOCAL_TOLERANCE: f64 = 0.05;
/// Shortest distance that is compared, in metres.
const LEAST_WAY_M: f64 = 0.1;

/// Whether a run's PoseNet has learned the metric distance between neighbouring frames: from video with the vehicle's speed, and not from
/// frames chosen by distance. False for a run that left PoseNet out.
#[must_use]
pub fn pose_net_is_metric(config: &TrainConfig) -> bool {
    let mut sets = 0..config.data.sets.len().max(1);
    let from_video = sets.any(|set| config.learn(set).from_motion());
    let learned = !config.leaves_pose_net_out();
    let neighbours = config.frames.iter().all(|offset| offset.abs() == 1);
    from_video && learned && neighbours && config.frame_distance_m == 0.0 && config.loss.speed > 0.0
}

/// The path to load a network's PoseNet from, if it has one for which [`pose_net_is_metric`] is true; `config` is its run's. An imported
/// depth network has none.
#[must_use]
pub fn metric_pose_net<'a>(model: &'a ModelSource, config: &TrainConfig) -> Option<&'a Path> {
    match model {
        ModelSource::Run {
            given,
            folder,
            kind,
        } => {
            // A file that cannot be read gives an error when it is loaded.
            let has_one = || folder.has_pose_net(*kind).unwrap_or(true);
            (pose_net_is_metric(config) && has_one()).then_some(given.as_path())
        }
        ModelSource::Packed { .. } => None,
    }
}

/// As [`pose_speeds`], for the PoseNet at a path ([`metric_pose_net`]), with the units of a data set. If it cannot be loaded, that is a
/// warning, and depth is judged nevertheless.
///
/// # Errors
/// An image that cannot be read.
pub fn pose_speeds_of(
    (path, set): (&Path, Option<&str>),
    device: &Device,
    datasets: &[Dataset],
    unseen: &Unseen,
    options: &VerdictOptions,
) -> Result<Result<Vec<SpeedRow>, VerdictWarning>> {
    match PosePredictor::load(path, set, device) {
        Ok(predictor) => pose_speeds(&predictor, datasets, unseen, options).map(Ok),
        Err(why) => Ok(Err(VerdictWarning::NoPoseNet(why))),
    }
}

/// PoseNet's distance from each frame that [`super::verdict`] measures to the frame before, compared with the vehicle's, by speed. Empty
/// for recordings with another focal length than the one trained with, and for an imported PoseNet, whose unit is unknown. For networks for
/// which [`pose_net_is_metric`] is true.
///
/// # Errors
/// An image that cannot be read.
pub fn pose_speeds(
    predictor: &PosePredictor,
    datasets: &[Dataset],
    unseen: &Unseen,
    options: &VerdictOptions,
) -> Result<Vec<SpeedRow>> {
    if predictor.step == 0 {
        return Ok(Vec::new());
    }
    let mut logs = Vec::new();
    let targets = plan(datasets, unseen, options.blocks);
    for block in &targets.blocks {
        let dataset = &datasets[block.dataset];
        if !knows_the_camera(predictor, dataset) {
            continue;
        }
        for target in block.targets.iter().filter(|target| target.frame > 0) {
            let Some(way_m) = dataset
                .camera_motion(target.frame - 1, target.frame)
                .map(|motion| motion.translation().norm())
                .filter(|way_m| *way_m >= LEAST_WAY_M)
            else {
                continue;
            };
            let images = [target.frame - 1, target.frame].map(|frame| {
                let image = dataset.load_image(frame)?;
                Ok(predictor.prepare(&image))
            });
            let images: Vec<Vec<f32>> = images.into_iter().collect::<Result<_>>()?;
            let seen = predictor.motions(&images);
            let seen = seen.iter().map(|motion| motion.translation().norm());
            logs.extend(seen.map(|seen_m| (target.speed_mps, (seen_m / way_m).ln())));
        }
    }
    Ok(speed_rows(&logs))
}

/// Whether a recording's camera is the training camera, as far as that is known.
fn knows_the_camera(predictor: &PosePredictor, dataset: &Dataset) -> bool {
    let (Some(trained), Some(&frame)) = (predictor.training_camera(), dataset.selected().first())
    else {
        return true;
    };
    let size = predictor.config().size;
    let (width, height) = (size.width as u32, size.height as u32);
    let here = dataset.intrinsics(frame).resized(width, height);
    (here.fx / trained.resized(width, height).fx - 1.0).abs() <= FOCAL_TOLERANCE
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_model::{Learn, Preset};

    #[test]
    fn only_neighbouring_video_frames_with_speeds_give_a_metric_pose_net() {
        let config = Preset::Light.config();
        assert!(pose_net_is_metric(&config));
        let mut from_depth = config.clone();
        from_depth.data.learn = Learn::Depth;
        assert!(!pose_net_is_metric(&from_depth));
        let mut apart = config.clone();
        apart.frame_distance_m = 1.0;
        assert!(!pose_net_is_metric(&apart));
        let mut far = config.clone();
        far.frames = vec![-3, 3];
        assert!(!pose_net_is_metric(&far));
        let mut without_speed = config;
        without_speed.loss.speed = 0.0;
        assert!(!pose_net_is_metric(&without_speed));
    }
}
