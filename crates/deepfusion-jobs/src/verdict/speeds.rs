//! The vehicle's speed beside what the images say of it, by speed.

use std::collections::BTreeSet;
use std::sync::Arc;

use deepfusion_data::{Dataset, grey_image};
use deepfusion_eval::verdict::{SpeedRow, speed_range, speed_rows};
use deepfusion_motion::{GroundPair, RoadTexture, refined_camera_height};
use nalgebra::Vector3;
use rayon::prelude::*;

use super::{Plan, Target};
use crate::Result;

/// Width of the images that the road is looked at in.
const WIDTH: u32 = 320;

/// The speed by the road's motion, against the vehicle's. The road tells speed over camera height: at speeds that the signal says too
/// high the camera seems higher than at the others. Each drive's height is its own.
///
/// # Errors
/// An image that cannot be read.
pub(super) fn road_speeds(datasets: &[Dataset], plan: &Plan) -> Result<Vec<SpeedRow>> {
    let mut logs = Vec::new();
    for (number, dataset) in datasets.iter().enumerate() {
        let Some(cam_from_vehicle) = dataset.cam_from_vehicle() else {
            continue;
        };
        let down = -cam_from_vehicle.rotate(&Vector3::z());
        let blocks = plan.blocks.iter().filter(|b| b.dataset == number);
        let targets: Vec<&Target> = blocks.flat_map(|b| &b.targets).collect();
        let pairs = targets
            .par_iter()
            .filter_map(|target| ground_pair(dataset, target, down).transpose())
            .collect::<Result<Vec<(f64, GroundPair)>>>()?;
        let height_of = |alike: &dyn Fn(f64) -> bool| {
            let alike = pairs.iter().filter(|(speed, _)| alike(*speed));
            let alike: Vec<GroundPair> = alike.map(|(_, pair)| pair.clone()).collect();
            refined_camera_height(&alike)
        };
        let Some(height_m) = height_of(&|_| true) else {
            continue;
        };
        let ranges: BTreeSet<usize> = pairs.iter().map(|(speed, _)| speed_range(*speed)).collect();
        for range in ranges {
            let alike = |speed: f64| speed_range(speed) == range;
            if let Some(here_m) = height_of(&alike) {
                let log = (height_m / here_m).ln();
                let speeds = pairs.iter().map(|(speed, _)| *speed);
                logs.extend(speeds.filter(|s| alike(*s)).map(|speed| (speed, log)));
            }
        }
    }
    Ok(speed_rows(&logs))
}

/// A frame and the nearest before it, with the vehicle's speed.
fn ground_pair(
    dataset: &Dataset,
    target: &Target,
    down_in_cam: Vector3<f64>,
) -> Result<Option<(f64, GroundPair)>> {
    let Some((source, earlier_from_later)) = target.sources.first() else {
        return Ok(None);
    };
    let k = dataset.intrinsics(target.frame);
    let width = WIDTH.min(k.width);
    let height = (width * k.height).div_ceil(k.width).max(1);
    let texture = |frame: usize| -> Result<Arc<RoadTexture>> {
        let grey = grey_image(&dataset.load_image(frame)?, width, height);
        Ok(Arc::new(RoadTexture::from(&grey)))
    };
    let pair = GroundPair {
        earlier: texture(*source)?,
        later: texture(target.frame)?,
        intrinsics: k.resized(width, height),
        // Pairs stand alone here: no acceleration is known.
        seconds: f64::NAN,
        earlier_from_later: *earlier_from_later,
        down_in_cam,
    };
    Ok(Some((target.speed_mps, pair)))
}
