//! A vehicle's turns, estimated from its images.

use super::warning::MotionWarning;
use crate::MotionModel;

/// A vehicle's turn from one image to the next, estimated from these images.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeenTurn {
    /// Time of the earlier image, seconds on the frames' clock.
    pub from_s: f64,
    /// Time of the later image, seconds on the frames' clock.
    pub to_s: f64,
    /// Change of heading, radians, positive to the left.
    pub yaw_rad: f64,
    /// Roll (positive with the left side up) and pitch (positive with the nose down) at the later image relative to the earlier one, after
    /// the yaw, radians.
    pub tilt_rad: [f64; 2],
}

/// The track with the turns' roll and pitch, and also their yaw if it has no yaw rate.
pub(super) fn with_turns(track: MotionModel, turns: &[SeenTurn], yaw_known: bool) -> MotionModel {
    // A gap of a single pair is bridged, but no more.
    let longest = turns.iter().map(|turn| turn.to_s - turn.from_s);
    let max_gap_s = 1.5 * longest.fold(0.0, f64::max);
    let samples = rates(turns);
    let tilts: Vec<_> = samples.iter().map(|(t, (_, tilt))| (*t, *tilt)).collect();
    let mut track = track.into_track();
    if !yaw_known {
        let yaws: Vec<_> = samples.iter().map(|(t, (yaw, _))| (*t, *yaw)).collect();
        track = track.with_yaw_rate(&yaws, max_gap_s);
    }
    track.with_tilt_rates(&tilts, max_gap_s).into()
}

/// Rates of yaw, and of roll and pitch, whose integral over each turn's time is its angle: constant, except for short ramps to the next.
fn rates(turns: &[SeenTurn]) -> Vec<(f64, (f64, [f64; 2]))> {
    /// Duration of a ramp as a fraction of a turn's time.
    const RAMP: f64 = 0.01;
    let ends = |(i, turn): (usize, &SeenTurn)| {
        let dt_s = turn.to_s - turn.from_s;
        let rate = (turn.yaw_rad / dt_s, turn.tilt_rad.map(|angle| angle / dt_s));
        let before = i.checked_sub(1).map(|before| turns[before].to_s);
        let after = turns.get(i + 1).map(|after| after.from_s);
        // No ramp unless another turn follows immediately: the track ends here.
        let ramp = |neighbour: Option<f64>, end_s| {
            let follows = neighbour == Some(end_s);
            if follows { RAMP * dt_s } else { 0.0 }
        };
        let from_s = turn.from_s + ramp(before, turn.from_s);
        [(from_s, rate), (turn.to_s - ramp(after, turn.to_s), rate)]
    };
    turns.iter().enumerate().flat_map(ends).collect()
}

/// The warning about a recording of `images` images whose turns were estimated from them.
pub(super) fn warning(turns: &[SeenTurn], images: usize, yaw_known: bool) -> MotionWarning {
    let mut pitches: Vec<f64> = turns.iter().map(|turn| turn.tilt_rad[1].abs()).collect();
    pitches.sort_by(f64::total_cmp);
    MotionWarning::TurnsOfImages {
        yaw_recorded: yaw_known,
        seen: turns.len(),
        pairs: images.saturating_sub(1),
        pitch_rad: pitches.get(pitches.len() / 2).copied().unwrap_or(0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::VehicleTrack;

    fn track(seconds: u32) -> MotionModel {
        let speeds: Vec<_> = (0..=10 * seconds)
            .map(|i| (0.1 * f64::from(i), 8.0, 0.02))
            .collect();
        VehicleTrack::new(&speeds).into()
    }

    /// An hour of weaving with roll and pitch, and a constant drift to one side: between any two images the track turns as
    /// observed, at its end as at its start.
    #[test]
    fn the_track_has_the_observed_turns() {
        let wave = |i: usize, k: f64| (k * i as f64).sin();
        let turns: Vec<SeenTurn> = (0..36_000)
            .map(|i| SeenTurn {
                from_s: 0.1 * i as f64,
                to_s: 0.1 * (i + 1) as f64,
                yaw_rad: 0.05 * wave(i, 0.1),
                tilt_rad: [0.0003 + 0.003 * wave(i, 1.3), 0.0005 + 0.004 * wave(i, 0.9)],
            })
            .collect();
        for yaw_known in [true, false] {
            let track = with_turns(track(3600), &turns, yaw_known);
            for turn in turns.iter().step_by(7) {
                let moved = track.motion(turn.from_s, turn.to_s).unwrap();
                let yaw = if yaw_known { 0.002 } else { turn.yaw_rad };
                // The ramps are a hundredth of a turn long.
                assert!((moved.yaw_rad - yaw).abs() < 2e-4, "{turn:?} {moved:?}");
                for axis in 0..2 {
                    let off = (moved.tilt_rad[axis] - turn.tilt_rad[axis]).abs();
                    assert!(off < 1e-4, "{turn:?} {moved:?}");
                }
            }
        }
    }

    /// One missing pair is bridged. Two are a gap in the yaw, and count as level if the yaw is measured.
    #[test]
    fn longer_gaps_are_not_bridged() {
        let turn = |i: usize| SeenTurn {
            from_s: 2.0 * i as f64,
            to_s: 2.0 * (i + 1) as f64,
            yaw_rad: 0.1,
            tilt_rad: [0.01, 0.02],
        };
        let speeds: Vec<_> = (0..=160).map(|i| (0.25 * f64::from(i), 8.0, 0.0)).collect();
        let track: MotionModel = VehicleTrack::new(&speeds).into();
        let seen: Vec<_> = [0, 1, 3, 4, 8, 9].map(turn).into();
        let unmeasured = with_turns(track.clone(), &seen, false);
        for i in [0, 1, 2, 3, 4, 8, 9] {
            let moved = unmeasured.motion(2.0 * i as f64, 2.0 * (i + 1) as f64);
            assert!((moved.unwrap().yaw_rad - 0.1).abs() < 1e-3, "{i}");
        }
        assert!(unmeasured.motion(12.0, 14.0).is_none());
        let measured = with_turns(track, &seen, true);
        let tilt = |from_s: f64| measured.motion(from_s, from_s + 2.0).unwrap().tilt_rad;
        assert!((tilt(2.0)[1] - 0.02).abs() < 1e-3);
        assert_eq!(tilt(12.0), [0.0; 2]);
        let message = warning(&seen, 11, false).to_string();
        assert!(message.contains("(6 of 10 pairs)"), "{message}");
    }
}
