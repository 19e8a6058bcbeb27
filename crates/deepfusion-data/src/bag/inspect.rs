//! What is in a bag that no camera wrote into.

use super::config::BagConfig;
use super::index::Index;
use super::recording::{remarks_on, streams};
use super::source;
use super::topics::{Role, Topics};
use crate::inspect::{DriveInspection, Inspection, SpeedRange};
use crate::{DatasetKind, Result};
use std::path::Path;

/// Speeds farther apart than this are not joined, in seconds.
const MAX_GAP_S: f64 = 0.5;

/// The streams of a bag without images; `None` where it has some.
///
/// # Errors
/// As [`crate::Dataset::open`].
pub(crate) fn without_images(path: &Path) -> Result<Option<Inspection>> {
    let config = BagConfig::beside(path)?;
    let bag = source::open(path)?;
    let topics = Topics::find(bag.as_ref(), &config)?;
    if topics.of(Role::Image).is_some() {
        return Ok(None);
    }
    let index = Index::read(bag.as_ref(), &topics, &config)?;
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
        why_no_pairs: Some("none of the bag's topics holds images".into()),
        scans: 0,
        speed_mps,
        distance_m,
        turn_rad: None,
        duration_s,
        time_offset: None,
        remarks: remarks_on(bag.as_ref(), &index),
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
    }))
}
