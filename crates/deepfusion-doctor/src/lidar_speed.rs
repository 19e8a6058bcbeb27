//! The vehicle's speed compared with the radial velocities of an FMCW LiDAR.

use super::finding::{Figure, Limit, Outcome, Severity, median};
use super::reason::MotionReason;
use super::shared_error::SharedError;
use super::skip::MotionSkip;
use deepfusion_data::{Dataset, LidarMotion};
use nalgebra::Vector3;

/// Number of scans examined.
const MOST_SCANS: usize = 40;
/// Slower scans do not give a ratio, m/s.
const MOVING_MPS: f64 = 1.0;
const LEAST_SCANS: usize = 4;
/// Speed measured by the vehicle over speed measured by the LiDAR.
const RATIO: Limit = Limit::Within(0.95, 1.05);
/// Sideways speed over speed, as an angle in degrees: the LiDAR's yaw on the vehicle.
const MOST_SIDEWAYS_DEG: f64 = 1.5;
/// Upward speed over speed, as an angle in degrees: the LiDAR's pitch. A loaded boot lifts the nose by some tenths, and few rays look
/// up or down.
const MOST_UPWARD_DEG: f64 = 2.0;

pub(super) fn check(dataset: &Dataset) -> Outcome {
    let motions = match dataset.lidar_motion(MOST_SCANS) {
        Ok(motions) => motions,
        Err(error) => return Outcome::skipped("lidar-speed", SharedError::from(error)),
    };
    let moving: Vec<_> = motions
        .iter()
        .filter(|m| m.by_scan_mps.norm().max(m.by_vehicle_mps.norm()) > MOVING_MPS)
        .collect();
    if moving.len() < LEAST_SCANS {
        return Outcome::skipped("lidar-speed", MotionSkip::NoRadialVelocities);
    }
    let ratio = median(
        moving
            .iter()
            .map(|m| m.by_vehicle_mps.x / m.by_scan_mps.x)
            .collect(),
    );
    let off = |axis: usize| {
        let angle = |v: &Vector3<f64>| v[axis].atan2(v.x.abs());
        let apart = |m: &&LidarMotion| angle(&m.by_scan_mps) - angle(&m.by_vehicle_mps);
        median(moving.iter().map(apart).collect()).to_degrees()
    };
    let (sideways, upward) = (off(1), off(2));
    let mut outcome = Outcome::new("lidar-speed");
    let figure = Figure::new(
        "speed by the vehicle over speed by the LiDAR",
        ratio,
        "",
        RATIO,
    );
    outcome.judge(Severity::Error, figure, || MotionReason::LidarSpeed {
        factor: ratio,
        scans: moving.len(),
    });
    let limit = Limit::Within(-MOST_SIDEWAYS_DEG, MOST_SIDEWAYS_DEG);
    let figure = Figure::new(
        "the LiDAR drifts to the left by",
        sideways,
        "degrees",
        limit,
    );
    outcome.judge(Severity::Warning, figure, || {
        let left_deg = sideways;
        MotionReason::LidarSideways { left_deg }
    });
    let limit = Limit::Within(-MOST_UPWARD_DEG, MOST_UPWARD_DEG);
    let figure = Figure::new("the LiDAR climbs by", upward, "degrees", limit);
    outcome.judge(Severity::Warning, figure, || {
        let up_deg = upward;
        MotionReason::LidarUpward { up_deg }
    });
    outcome
}
