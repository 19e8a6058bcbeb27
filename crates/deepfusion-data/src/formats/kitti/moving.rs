//! Dynamic pixels of a KITTI raw drive: from the simulator's masks, or from the tracklets and the vehicle's own motion.

use super::calibration::Calibration;
use super::tracklets::{Tracklet, TrackletPose};
use super::velodyne::velo_point;
use crate::truth::MovingPixels;
use crate::{Dataset, Error, GtKind, MovingLabels, MovingSource, Result, load_rgb};
use deepfusion_geometry::{DepthMap, Se3};
use nalgebra::{Matrix3x4, Vector3};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Speed over ground from which a labelled box counts as moving, in m/s. In KITTI's drive 0005, the boxes
/// of parked cars move at up to 0.6 m/s in 19 of 20 frames (jitter of the labels), a slow pedestrian's at 0.9 m/s
/// or more.
const MOVING_MPS: f64 = 0.75;
/// Frames before and after over which that speed is measured, fewer at a tracklet's ends.
const REACH: u64 = 5;
/// How far outside a box's sides a point still belongs to it, in metres: for mirrors, and the half pixel by
/// which a projected point was rounded.
const MARGIN_M: f64 = 0.1;
/// Folder of the masks of simulated drives, one PNG per frame: 255 on dynamic objects.
pub(super) const MASKS: &str = "moving_02";

/// A moving box, in one frame's velodyne axes.
#[derive(Debug, Clone, Copy, PartialEq)]
struct MovingBox {
    pose: TrackletPose,
    size_m: [f64; 3],
}

/// The dynamic pixels of a drive; see [`Dataset::moving_labels`].
pub(super) fn labels(calibration: &Calibration, dataset: &Dataset) -> Result<Option<MovingLabels>> {
    let masks = dataset.folder().join(MASKS);
    if dataset.camera().number() == 2 && masks.is_dir() {
        return Ok(Some(MovingLabels::new(MovingSource::Masks, Masks(masks))));
    }
    let file = dataset.folder().join(Tracklet::FILE);
    let (Some(pixels_from_velo), Some(cam_from_velo), Some(cam_from_imu)) = (
        calibration.pixels_from_velo,
        calibration.cam_from_velo,
        calibration.cam_from_imu,
    ) else {
        return Ok(None);
    };
    if dataset.track().is_none() || !file.is_file() {
        return Ok(None);
    }
    let imu_from_velo = cam_from_imu.inverse() * cam_from_velo;
    let mut boxes: BTreeMap<u64, Vec<MovingBox>> = BTreeMap::new();
    for tracklet in Tracklet::read(&file)? {
        for (frame, pose) in (tracklet.first_frame..).zip(&tracklet.poses) {
            let speed = speed_over_ground(dataset, &tracklet, frame, &imu_from_velo);
            if speed.is_some_and(|speed| speed >= MOVING_MPS) {
                boxes.entry(frame).or_default().push(MovingBox {
                    pose: *pose,
                    size_m: tracklet.size_m,
                });
            }
        }
    }
    let boxes = Boxes {
        pixels_from_velo,
        boxes,
    };
    Ok(Some(MovingLabels::new(MovingSource::Tracklets, boxes)))
}

/// Speed over ground of a tracklet's box around a frame, in m/s; `None` if the box or the vehicle's own motion is
/// known only in that frame.
fn speed_over_ground(
    dataset: &Dataset,
    tracklet: &Tracklet,
    frame: u64,
    imu_from_velo: &Se3,
) -> Option<f64> {
    let last = tracklet.first_frame + (tracklet.poses.len() as u64).checked_sub(1)?;
    let from = frame.saturating_sub(REACH).max(tracklet.first_frame);
    let to = (frame + REACH).min(last);
    let (from_s, to_s) = (dataset.time_of(from)?, dataset.time_of(to)?);
    let imu0_from_imu1 = dataset
        .track()?
        .motion(from_s, to_s)?
        .vehicle0_from_vehicle1();
    let in_imu = |frame| Some(imu_from_velo.transform(&tracklet.pose(frame)?.bottom_m));
    let moved = imu0_from_imu1.transform(&in_imu(to)?) - in_imu(from)?;
    // Horizontally only: the boxes' heights follow the road.
    Some(moved.xy().norm() / (to_s - from_s))
}

/// Path of the folder of the simulator's masks.
#[derive(Debug)]
struct Masks(PathBuf);

impl MovingPixels for Masks {
    fn pixels(&self, frame: u64, truth: &DepthMap, _: GtKind) -> Result<Option<Vec<bool>>> {
        let path = self.0.join(format!("{frame:010}.png"));
        if !path.is_file() {
            return Ok(None);
        }
        let mask = load_rgb(&path)?;
        let size = (truth.width as u32, truth.height as u32);
        if mask.dimensions() != size {
            return Err(Error::Size {
                what: "the mask of dynamic objects",
                found: mask.dimensions(),
                image: size,
            });
        }
        Ok(Some(mask.pixels().map(|p| p.0[0] >= 128).collect()))
    }
}

/// Moving boxes by frame number.
#[derive(Debug)]
struct Boxes {
    pixels_from_velo: Matrix3x4<f64>,
    boxes: BTreeMap<u64, Vec<MovingBox>>,
}

impl MovingPixels for Boxes {
    fn pixels(&self, frame: u64, truth: &DepthMap, kind: GtKind) -> Result<Option<Vec<bool>>> {
        let boxes = self.boxes.get(&frame).map_or(&[][..], Vec::as_slice);
        let moves = |(index, depth): (usize, &f32)| {
            let pixel = (index % truth.width, index / truth.width);
            *depth > 0.0
                && !boxes.is_empty()
                && velo_point(&self.pixels_from_velo, pixel, f64::from(*depth), kind)
                    .is_some_and(|point| boxes.iter().any(|b| b.contains(&point)))
        };
        Ok(Some(truth.data.iter().enumerate().map(moves).collect()))
    }
}

impl MovingBox {
    /// Whether a point (velodyne axes, metres) is inside the box or within the margin of its sides. There is no margin
    /// below its bottom, since that is the road.
    fn contains(&self, point: &Vector3<f64>) -> bool {
        let from_centre = point - self.pose.bottom_m;
        let (sin, cos) = self.pose.yaw_rad.sin_cos();
        let along = cos * from_centre.x + sin * from_centre.y;
        let across = cos * from_centre.y - sin * from_centre.x;
        let [length, width, height] = self.size_m;
        along.abs() <= 0.5 * length + MARGIN_M
            && across.abs() <= 0.5 * width + MARGIN_M
            && (0.0..=height + MARGIN_M).contains(&from_centre.z)
    }
}
