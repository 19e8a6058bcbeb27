//! A drive that turns as its images show, if nothing else recorded how it turned.

use super::heading::heading;
use super::seen_turns::seen_turns;
use deepfusion_data::{Dataset, Heading};
use std::ops::Range;

/// Frames in a row that are read. Training reads all, which takes minutes for a long drive; a part suffices to check the speeds.
const STRETCH: usize = 300;

/// A stretch of the drive that turns as its images show. Without a mount, its camera points as training assumes. `None` if its
/// turns are recorded, if its speeds are not, and if the images do not show the turns.
pub(crate) fn turning_as_seen(dataset: &Dataset) -> Option<Dataset> {
    if dataset.yaw_known() || !dataset.tilt_unknown() {
        return None;
    }
    let stretch = dataset.with_frames(longest_distance(dataset)?);
    let mut turning = turned(&stretch);
    if stretch.mount_assumed() {
        // The direction of travel needs the turns, and the turns get more accurate with the direction of travel.
        let sure = heading(&turning).ok().filter(Heading::is_sure);
        if let Some(heading) = sure {
            let mut aimed = stretch;
            aimed.aim(&heading);
            turning = turned(&aimed);
        }
    }
    turning.yaw_known().then_some(turning)
}

fn turned(dataset: &Dataset) -> Dataset {
    let mut turning = dataset.clone();
    turning.take_turns(&seen_turns(dataset).turns);
    turning
}

/// The [`STRETCH`] frames in a row with the longest distance driven: while the vehicle stands, no road moves. `None` without speeds.
fn longest_distance(dataset: &Dataset) -> Option<Range<usize>> {
    let ego = dataset.ego().ok()?;
    let frames = dataset.frames();
    let distance = |pair: usize| {
        let times = frames[pair].time_s.zip(frames[pair + 1].time_s);
        let motion = times.and_then(|(from_s, to_s)| ego.vehicle_motion(from_s, to_s));
        motion.map_or(0.0, |motion| motion.distance_m.abs())
    };
    let distances: Vec<f64> = (0..frames.len().saturating_sub(1)).map(distance).collect();
    Some(longest(&distances, STRETCH))
}

/// The `most` frames in a row with the longest distance, from the distances between neighbouring frames; all if there are no more.
fn longest(distances: &[f64], most: usize) -> Range<usize> {
    let frames = distances.len() + 1;
    let length = most.min(frames);
    let last = frames - length;
    let starts = (0..last).step_by((most / 2).max(1)).chain([last]);
    let distance = |start: &usize| distances[*start..start + length - 1].iter().sum::<f64>();
    let start = starts
        .max_by(|a, b| distance(a).total_cmp(&distance(b)))
        .unwrap_or(0);
    start..start + length
}

#[cfg(test)]
mod tests {
    use super::longest;

    #[test]
    fn the_stretch_with_the_longest_distance_is_read() {
        assert_eq!(longest(&[], 4), 0..1);
        assert_eq!(longest(&[1.0; 3], 4), 0..4);
        assert_eq!(longest(&[0.0, 0.0, 0.0, 0.0, 1.0, 1.0], 4), 3..7);
        let mut distances = [0.0; 20];
        distances[7..12].fill(1.0);
        assert_eq!(longest(&distances, 6), 6..12);
    }
}
