//! The boxes of a drive's `tracklet_labels.xml`, in the camera of each frame.

use deepfusion_data::kitti::{Calibration, Tracklet};
use deepfusion_data::{Dataset, Error, MissingPart};
use deepfusion_geometry::{Intrinsics, Se3};
use deepfusion_perception::Label;
use nalgebra::Vector3;

use super::visibility::{VisibilityDepth, counts};
use crate::Result;

/// With dense depth, a box counts if it has at least this many pixels, scaled to an image of 640×192.
const LEAST_PIXELS: f64 = 50.0;
/// With scans, a box counts if it contains at least this many points.
const LEAST_POINTS: usize = 15;
/// Number of frames before and after over which a label's velocity is measured.
const REACH: u64 = 2;

/// The boxes of a drive.
pub(super) struct Labels {
    tracklets: Vec<Tracklet>,
    cam_from_velo: Se3,
}

impl Labels {
    /// Reads a drive's boxes, and the calibration that transforms them into the camera.
    ///
    /// # Errors
    /// One of them is missing.
    pub(super) fn read(dataset: &Dataset) -> Result<Self> {
        let folder = dataset.folder();
        let tracklets = Tracklet::read(&folder.join(Tracklet::FILE))?;
        let date = folder.parent().unwrap_or(folder);
        let calibration = Calibration::read(date, dataset.camera())?;
        let cam_from_velo = calibration.cam_from_velo.ok_or_else(|| Error::Missing {
            path: date.join(Calibration::VELO_TO_CAM),
            part: MissingPart::AxesOfBoxes,
        })?;
        Ok(Self {
            tracklets,
            cam_from_velo,
        })
    }

    /// The boxes of a frame.
    pub(super) fn of(
        &self,
        dataset: &Dataset,
        index: usize,
        visibility: &VisibilityDepth,
    ) -> Vec<Label> {
        let number = dataset.frames()[index].number;
        let k = dataset.intrinsics(index);
        let of_tracklet = |(object, tracklet): (usize, &Tracklet)| {
            let (center_m, yaw_rad) = self.pose(tracklet, number)?;
            let mut label = Label {
                object: object as u64,
                center_m: center_m.into(),
                size_m: tracklet.size_m,
                yaw_rad,
                velocity_mps: self.velocity(dataset, index, tracklet),
                counts: true,
            };
            let least = if visibility.dense {
                let area = f64::from(k.width) * f64::from(k.height) / (640.0 * 192.0);
                (LEAST_PIXELS * area) as usize
            } else {
                LEAST_POINTS
            };
            let seen = pixels_within(&label, visibility, &k, least);
            label.counts = counts(&label, &tracklet.object, seen, least);
            Some(label)
        };
        self.tracklets
            .iter()
            .enumerate()
            .filter_map(of_tracklet)
            .collect()
    }

    /// Centre of a tracklet's box in a frame's camera, and its rotation_y.
    fn pose(&self, tracklet: &Tracklet, number: u64) -> Option<(Vector3<f64>, f64)> {
        let pose = tracklet.pose(number)?;
        let up = Vector3::new(0.0, 0.0, 0.5 * tracklet.size_m[2]);
        let center = self.cam_from_velo.transform(&(pose.bottom_m + up));
        let along = Vector3::new(pose.yaw_rad.cos(), pose.yaw_rad.sin(), 0.0);
        let along = self.cam_from_velo.rotate(&along);
        Some((center, (-along.z).atan2(along.x)))
    }

    /// The tracklet's velocity over ground around a frame, in that frame's camera.
    fn velocity(&self, dataset: &Dataset, index: usize, tracklet: &Tracklet) -> Option<[f64; 3]> {
        let number = dataset.frames()[index].number;
        let last = tracklet.first_frame + (tracklet.poses.len() as u64).checked_sub(1)?;
        let at = |number: u64| {
            let frames = dataset.frames();
            let other = frames.binary_search_by_key(&number, |f| f.number).ok()?;
            let here_from_there = if other == index {
                Se3::identity()
            } else {
                dataset.camera_motion(index, other)?
            };
            let (center, _) = self.pose(tracklet, number)?;
            Some((here_from_there.transform(&center), frames[other].time_s?))
        };
        let (from, from_s) = at(number.saturating_sub(REACH).max(tracklet.first_frame))?;
        let (to, to_s) = at((number + REACH).min(last))?;
        (to_s > from_s).then(|| ((to - from) / (to_s - from_s)).into())
    }
}

/// The number of pixels whose depth lies in a box, up to `enough`. The box's lowest 2 cm are the road.
pub(super) fn pixels_within(
    label: &Label,
    visibility: &VisibilityDepth,
    k: &Intrinsics,
    enough: usize,
) -> usize {
    let depth = &visibility.depth;
    let [x, y, z] = label.center_m;
    let reach = 0.5 * label.size_m.iter().map(|s| s * s).sum::<f64>().sqrt() + 0.1;
    if z + reach < 0.5 {
        return 0;
    }
    let near = (z - reach).max(0.5);
    let range = |centre: f64, f: f64, c: f64, size: usize| {
        let ends = [centre - reach, centre + reach]
            .into_iter()
            .flat_map(|p| [p / near, p / (z + reach)])
            .map(|ray| f * ray + c);
        let (low, high) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), e| {
            (a.min(e), b.max(e))
        });
        let clamp = |p: f64| p.clamp(0.0, size as f64) as usize;
        clamp(low.floor())..clamp(high.ceil() + 1.0)
    };
    let (sin, cos) = label.yaw_rad.sin_cos();
    let half = label.size_m.map(|s| 0.5 * s);
    let mut count = 0;
    for v in range(y, k.fy, k.cy, depth.height) {
        for u in range(x, k.fx, k.cx, depth.width) {
            let Some(d) = depth.get(u, v) else { continue };
            let p = k.back_project(u as f64, v as f64, f64::from(d));
            let (dx, dy, dz) = (p.x - x, p.y - y, p.z - z);
            let (along, across) = (cos * dx - sin * dz, sin * dx + cos * dz);
            let inside = along.abs() <= half[0] + 0.05
                && across.abs() <= half[1] + 0.05
                && dy >= -half[2] - 0.05
                && dy < half[2] - 0.02;
            count += usize::from(inside);
            if count >= enough {
                return count;
            }
        }
    }
    count
}
