//! Inspects a bag without images.

use super::config::BagConfig;
use super::index::Index;
use super::mounts::Mounts;
use super::streams::{damage_of, oddities_of, streams};
use super::topics::Topics;
use super::{sensors, source};
use crate::{DatasetKind, DriveInspection, Inspection, OpenOptions, Result, SpeedRange, TopicRole};
use deepfusion_geometry::Se3;
use deepfusion_motion::Signal;
use std::path::Path;

/// Longest gap between speeds that is bridged, in seconds.
const MAX_GAP_S: f64 = 0.5;

/// The streams of a bag without images; `None` if it has images.
///
/// # Errors
/// Those of [`crate::Dataset::open`].
pub(crate) fn without_images(path: &Path, options: &OpenOptions) -> Result<Option<Inspection>> {
    let config = BagConfig::of(path, options)?;
    let bag = source::open(path)?;
    let topics = Topics::find(bag.as_ref(), &config)?;
    if topics.of(TopicRole::Image).is_some() {
        return Ok(None);
    }
    let index = Index::read(bag.as_ref(), &topics, &config)?;
    let mut warnings = damage_of(bag.as_ref(), &index);
    warnings.extend(oddities_of(&topics, &index));
    // Only the inertial unit's mount is needed here. Errors in the others prevent opening the bag, but not inspecting it.
    let mounts = Mounts::find(path, &config, &index, &mut Vec::new()).ok();
    let imu = mounts.and_then(|mounts| mounts.vehicle_from_imu);
    let mut speeds = index.speed_mps.clone();
    speeds.sort_by_key(|s| s.0);
    let seconds = |from: i64, to: i64| (to - from) as f64 * 1e-9;
    let steps = speeds
        .windows(2)
        .map(|w| (seconds(w[0].0, w[1].0), 0.5 * (w[0].1 + w[1].1)));
    let driven = steps
        .filter(|(dt, _)| *dt <= MAX_GAP_S)
        .map(|(dt, v)| (dt * v).abs());
    let distance_m = (speeds.len() > 1).then(|| driven.sum());
    let range = bag.time_range();
    let duration_s = range.map(|(first, last)| last.seconds_since(first));
    let speed_mps = SpeedRange::of(speeds.iter().map(|s| s.1));
    let drive = DriveInspection {
        name: source::name(path),
        camera: 2,
        frames: 0,
        missing_frames: Vec::new(),
        usable_pairs: 0,
        why_no_pairs: Some("none of the bag's topics has images".into()),
        scans: 0,
        speed_mps,
        distance_m,
        turn_rad: turn(path, &index, &config, imu.as_ref()),
        duration_s,
        camera_ahead_s: 0.0,
        time_offset: None,
        mounts: Vec::new(),
        warnings,
    };
    Ok(Some(Inspection {
        kind: DatasetKind::Bag,
        frames: 0,
        size: None,
        intrinsics: None,
        streams: streams(bag.as_ref(), &topics, &index)?,
        speed_mps,
        distance_m,
        duration_s,
        drives: vec![drive],
        unreadable: Vec::new(),
    }))
}

/// The vehicle's total turn, in radians, positive to the left: from all its sensors if it has a speed, otherwise from the
/// measured yaw rates, including their bias. `None` without either.
fn turn(
    path: &Path,
    index: &Index,
    config: &BagConfig,
    vehicle_from_imu: Option<&Se3>,
) -> Option<f64> {
    let origin_ns = index.speed_mps.iter().map(|s| s.0).min();
    // Contradicting sensors prevent opening the bag, but here their measurements are still reported.
    let motion = |ns| sensors::motion(path, index, config, vehicle_from_imu, ns);
    let motion = origin_ns.and_then(|ns| motion(ns).ok().flatten());
    if let Some(motion) = motion.filter(|m| m.yaw_known) {
        let track = &motion.track;
        let pairs = track.times_s().windows(2);
        return total(pairs.filter_map(|t| Some(track.motion(t[0], t[1])?.yaw_rad)));
    }
    let mut rates = yaw_rates(index, vehicle_from_imu);
    rates.sort_by_key(|r| r.0);
    let first_ns = rates.first()?.0;
    let seconds = |ns: i64| (ns - first_ns) as f64 * 1e-9;
    let signal = Signal::new(rates.into_iter().map(|(ns, rate)| (seconds(ns), rate)));
    let pairs = signal.times_s().windows(2);
    total(pairs.filter_map(|t| signal.integral(t[0], t[1])))
}

/// Yaw rates in rad/s, from the speed's messages if they have any (not every publisher fills them in), otherwise from the
/// inertial unit, whose z is up unless the file beside the bag, or its frames, rotate it.
fn yaw_rates(index: &Index, vehicle_from_imu: Option<&Se3>) -> Vec<(i64, f64)> {
    if index.has_yaw_rates() {
        return index.yaw_rate.clone();
    }
    let rates = index.imu.iter().map(|(ns, sample)| {
        let rate = sample.angular_rate_radps;
        let turned = vehicle_from_imu.map_or(rate, |t| t.rotate(&rate));
        (*ns, turned.z)
    });
    rates.collect()
}

/// The sum; `None` without values.
fn total(parts: impl Iterator<Item = f64>) -> Option<f64> {
    parts.reduce(|sum, part| sum + part)
}
