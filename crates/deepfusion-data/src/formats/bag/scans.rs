//! The scans of a bag in its camera: depth, velocities, dynamic points.

use super::config::LidarConfig;
use super::doppler::ego_velocity;
use super::dynamic::{DynamicPoints, MatchedPoints};
use super::image;
use super::index::{self, MessageRef};
use super::scan::{MIN_STATIC, Scan, SeenScan};
use crate::truth::MovingPixels;
use crate::{DynamicAgreement, GtKind, LidarMotion, MotionModel, Result, ScanTruth};
use deepfusion_geometry::{DepthMap, Intrinsics, Se3};
use deepfusion_rosbag::MessageSource;
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Half the interval over which a yaw rate is computed, seconds.
const YAW_RATE_REACH_S: f64 = 0.05;

/// The scans of a bag, for projection into its camera.
#[derive(Debug)]
pub(super) struct BagScans {
    pub(super) bag: Arc<dyn MessageSource>,
    pub(super) topic: String,
    /// Each scan's position in the bag, and its time on the frames' clock.
    pub(super) places: Vec<(MessageRef, f64)>,
    /// The dynamic points of the scans, from another topic.
    pub(super) dynamic: Option<DynamicPoints>,
    pub(super) lidar: LidarConfig,
    pub(super) within_s: f64,
    pub(super) cam_from_lidar: Se3,
    pub(super) cam_from_vehicle: Se3,
    pub(super) intrinsics: Intrinsics,
    pub(super) track: Option<MotionModel>,
}

impl BagScans {
    /// The scan nearest in time to a frame, if it is near enough, and its time.
    ///
    /// # Errors
    /// Those of [`Scan::decode`].
    fn scan(&self, frame_s: f64) -> Result<Option<(Scan, f64)>> {
        let Some((place, time_s)) = index::nearest(&self.places, frame_s, self.within_s) else {
            return Ok(None);
        };
        Ok(Some((self.decode(place)?, *time_s)))
    }

    fn decode(&self, place: &MessageRef) -> Result<Scan> {
        let message = image::message(self.bag.as_ref(), &self.topic, place)?;
        Scan::decode(self.bag.as_ref(), &message, &self.lidar)
    }

    /// A scan in a frame's camera: static points are moved to the frame's time with the vehicle's motion, each from
    /// its own time if it has one.
    fn seen(&self, scan: &Scan, frame_s: f64, scan_s: f64) -> SeenScan {
        let cam_from_lidar =
            |after_s: f64| self.frame_from_scan(frame_s, scan_s + after_s) * self.cam_from_lidar;
        scan.seen(cam_from_lidar, &self.intrinsics)
    }

    /// Each point's speed over ground along its ray, m/s; `None` without radial velocities.
    fn ground(&self, scan: &Scan, scan_s: f64) -> Option<Vec<f32>> {
        scan.ground_radial(self.sensor_velocity(scan_s), self.lidar.over_ground)
    }

    /// Which points move according to their speeds over ground.
    fn fast(&self, ground: &[f32]) -> Vec<bool> {
        let limit = self.lidar.moving_mps as f32;
        ground.iter().map(|v| v.abs() > limit).collect()
    }

    /// Which points are listed by the topic of dynamic points; `None` without that topic, or if its list belongs to another scan.
    fn listed(&self, scan: &Scan, scan_s: f64) -> Result<Option<MatchedPoints>> {
        let Some(dynamic) = &self.dynamic else {
            return Ok(None);
        };
        dynamic.of(self.bag.as_ref(), &scan.xyz, scan_s, self.within_s)
    }

    /// The transform from the camera at the scan's time to the camera at the frame's time.
    fn frame_from_scan(&self, frame_s: f64, scan_s: f64) -> Se3 {
        let (from_s, to_s) = (frame_s.min(scan_s), frame_s.max(scan_s));
        let motion = self.track.as_ref().and_then(|t| t.motion(from_s, to_s));
        let Some(motion) = motion else {
            return Se3::identity();
        };
        let earlier_from_later = motion.camera0_from_camera1(&self.cam_from_vehicle);
        if frame_s <= scan_s {
            earlier_from_later
        } else {
            earlier_from_later.inverse()
        }
    }

    /// The LiDAR's velocity over ground at a time according to the vehicle, in the LiDAR's axes, m/s: v + ω × r.
    fn sensor_velocity(&self, time_s: f64) -> Option<Vector3<f64>> {
        let track = self.track.as_ref()?;
        let speed = track.speed_at(time_s)?;
        let turn = track.motion(time_s - YAW_RATE_REACH_S, time_s + YAW_RATE_REACH_S);
        let yaw_rate = turn.map_or(0.0, |m| m.yaw_rad / (2.0 * YAW_RATE_REACH_S));
        let vehicle_from_lidar = self.cam_from_vehicle.inverse() * self.cam_from_lidar;
        let arm = vehicle_from_lidar.translation();
        let velocity = Vector3::new(speed, 0.0, 0.0) + Vector3::new(0.0, 0.0, yaw_rate).cross(&arm);
        Some(vehicle_from_lidar.inverse().rotate(&velocity))
    }

    /// Whether a frame has a scan near enough.
    pub(super) fn has(&self, frame_s: f64) -> bool {
        index::nearest(&self.places, frame_s, self.within_s).is_some()
    }

    /// A frame's ground truth, H×W; `None` without a scan.
    ///
    /// # Errors
    /// Those of [`Self::scan`].
    pub(super) fn depth(&self, frame_s: f64) -> Result<Option<DepthMap>> {
        let scan = self.scan(frame_s)?;
        Ok(scan.map(|(scan, scan_s)| self.seen(&scan, frame_s, scan_s).depth))
    }

    /// See [`crate::Recording::scan_truth`].
    pub(super) fn truth(&self, frame_s: f64) -> Result<Option<ScanTruth>> {
        let Some((scan, scan_s)) = self.scan(frame_s)? else {
            return Ok(None);
        };
        let seen = self.seen(&scan, frame_s, scan_s);
        let ground = self.ground(&scan, scan_s);
        Ok(Some(ScanTruth {
            velocity_mps: ground.map(|ground| seen.pixels(&ground, f32::NAN)),
            depth: seen.depth,
        }))
    }

    /// Which pixels of a frame's ground truth move: according to the radial velocities or, if the scan has none, to the topic
    /// of dynamic points. `None` without a scan or without either.
    ///
    /// # Errors
    /// Those of [`Self::scan`].
    pub(super) fn moving(&self, frame_s: f64) -> Result<Option<Vec<bool>>> {
        let Some((scan, scan_s)) = self.scan(frame_s)? else {
            return Ok(None);
        };
        let moves = match self.ground(&scan, scan_s) {
            Some(ground) => Some(self.fast(&ground)),
            None => self
                .listed(&scan, scan_s)?
                .filter(MatchedPoints::belongs_to_scan)
                .map(|listed| listed.moves),
        };
        let seen = self.seen(&scan, frame_s, scan_s);
        Ok(moves.map(|moves| seen.pixels(&moves, false)))
    }

    /// See [`crate::Recording::dynamic_agreement`].
    pub(super) fn agreement(&self, most: usize) -> Result<Option<DynamicAgreement>> {
        let mut sum = DynamicAgreement::default();
        let step = self.places.len().div_ceil(most.max(1)).max(1);
        for (place, scan_s) in self.places.iter().step_by(step).take(most) {
            let scan = self.decode(place)?;
            let Some(ground) = self.ground(&scan, *scan_s) else {
                continue;
            };
            let Some(listed) = self.listed(&scan, *scan_s)? else {
                continue;
            };
            let fast = self.fast(&ground);
            sum.scans += 1;
            sum.listed += listed.points;
            sum.in_scan += listed.found;
            sum.fast += fast.iter().filter(|fast| **fast).count();
            let both = fast.iter().zip(&listed.moves).filter(|(a, b)| **a && **b);
            sum.both += both.count();
        }
        Ok((sum.scans > 0).then_some(sum))
    }

    /// See [`crate::Recording::lidar_motion`].
    pub(super) fn motion(&self, most: usize) -> Result<Vec<LidarMotion>> {
        if self.lidar.over_ground || most == 0 {
            return Ok(Vec::new());
        }
        let vehicle_from_lidar = self.cam_from_vehicle.inverse() * self.cam_from_lidar;
        let step = self.places.len().div_ceil(most).max(1);
        let mut motions = Vec::new();
        for (place, time_s) in self.places.iter().step_by(step) {
            let scan = self.decode(place)?;
            let (Some(radial), Some(by_vehicle)) = (&scan.radial, self.sensor_velocity(*time_s))
            else {
                continue;
            };
            // Without an initial value, so that the estimate does not depend on the vehicle's velocity.
            let ego = ego_velocity(&scan.xyz, radial, None);
            if let Some(ego) = ego.filter(|ego| ego.static_share >= MIN_STATIC) {
                motions.push(LidarMotion {
                    time_s: *time_s,
                    by_scan_mps: vehicle_from_lidar.rotate(&ego.velocity),
                    by_vehicle_mps: vehicle_from_lidar.rotate(&by_vehicle),
                });
            }
        }
        Ok(motions)
    }

    /// Whether the points have velocities, according to the first scan.
    pub(super) fn has_velocities(&self) -> Result<bool> {
        let Some((place, _)) = self.places.first() else {
            return Ok(false);
        };
        Ok(self.decode(place)?.radial.is_some())
    }
}

/// Scans as labels of dynamic pixels.
#[derive(Debug)]
pub(super) struct MovingPoints {
    pub(super) scans: Arc<BagScans>,
    /// Times of the frames in seconds, by frame number.
    pub(super) times_s: BTreeMap<u64, f64>,
}

impl MovingPixels for MovingPoints {
    fn pixels(&self, frame: u64, _: &DepthMap, _: GtKind) -> Result<Option<Vec<bool>>> {
        match self.times_s.get(&frame) {
            Some(time_s) => self.scans.moving(*time_s),
            None => Ok(None),
        }
    }
}
