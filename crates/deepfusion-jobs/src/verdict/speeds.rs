//! Compares the vehicle's speed with the speed measured in the images, by range of speed.

use std::collections::BTreeMap;
use std::sync::Arc;

use deepfusion_data::{Dataset, grey_image};
use deepfusion_eval::verdict::{SpeedRow, speed_range, speed_rows};
use deepfusion_motion::{GroundPair, RoadCosts, RoadTexture};
use nalgebra::Vector3;
use rayon::prelude::*;

use super::{Plan, Target};
use crate::Result;

/// Width of the images in which the road is measured.
const WIDTH: u32 = 320;

/// The speed measured by the road's motion, compared with the vehicle's. The road's motion gives speed divided by camera height: in a range
/// where the speed signal is too high, the camera seems higher than elsewhere. Each drive has its own height, so a drive has to show the
/// road in at least two ranges of speed; frame pairs that do not show it are not counted.
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
        let targets = blocks.flat_map(|b| &b.targets);
        let targets: Vec<&Target> = targets.filter(|t| t.speed_mps.is_finite()).collect();
        let seen = targets
            .par_iter()
            .filter_map(|target| road_costs(dataset, target, down).transpose())
            .collect::<Result<Vec<(f64, RoadCosts)>>>()?;
        let mut by_range: BTreeMap<usize, Vec<&(f64, RoadCosts)>> = BTreeMap::new();
        for pair in &seen {
            by_range.entry(speed_range(pair.0)).or_default().push(pair);
        }
        let height = |pairs: &[&(f64, RoadCosts)]| {
            let costs: Vec<&RoadCosts> = pairs.iter().map(|(_, costs)| costs).collect();
            RoadCosts::height(&costs)
        };
        let Some(height_m) = height(&seen.iter().collect::<Vec<_>>()) else {
            continue;
        };
        let ranges = by_range.values();
        let ranges: Vec<_> = ranges
            .filter_map(|pairs| Some((pairs, height(pairs)?)))
            .collect();
        if ranges.len() < 2 {
            continue;
        }
        for (pairs, here_m) in ranges {
            let log = (height_m / here_m).ln();
            logs.extend(pairs.iter().map(|(speed_mps, _)| (*speed_mps, log)));
        }
    }
    Ok(speed_rows(&logs))
}

/// The road's motion between a frame and the nearest one before it, with the vehicle's speed.
fn road_costs(
    dataset: &Dataset,
    target: &Target,
    down_in_cam: Vector3<f64>,
) -> Result<Option<(f64, RoadCosts)>> {
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
        // Pairs are independent here, so the acceleration is unknown.
        seconds: f64::NAN,
        earlier_from_later: *earlier_from_later,
        down_in_cam,
    };
    Ok(RoadCosts::of(&pair).map(|costs| (target.speed_mps, costs)))
}
