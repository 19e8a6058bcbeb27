//! How a vehicle turned, as its images show it.

use crate::MotionModel;
use nalgebra::Rotation3;

/// What is said of a log of speeds that knows no turns.
pub(crate) const NO_YAW_RATE: &str = "no yaw rate, here or in imu.csv";

/// How a vehicle turned from one image to the next, as these show it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeenTurn {
    /// The earlier image's time, seconds on the frames' clock.
    pub from_s: f64,
    /// The later one's.
    pub to_s: f64,
    /// Change of heading, radians, positive to the left.
    pub yaw_rad: f64,
    /// Roll (the left side up) and pitch (the nose down) at the later image as seen from the earlier one, after the yaw, radians.
    pub tilt_rad: [f64; 2],
}

/// The track with the turns' roll and pitch, and where it has no yaw rate with their yaw as well.
pub(super) fn put_into(track: MotionModel, turns: &[SeenTurn], yaw_known: bool) -> MotionModel {
    let track = match yaw_known {
        true => track,
        false => track.with_yaw_rate(&yaw_rates(turns)),
    };
    let tilts = tilts(turns, &track);
    track.with_tilt(&tilts)
}

/// Yaw rates whose integral over each turn's time is its yaw: constant there, but for short ramps to the next.
fn yaw_rates(turns: &[SeenTurn]) -> Vec<(f64, f64)> {
    /// Share of a turn's time that a ramp takes.
    const RAMP: f64 = 0.01;
    let ends = |turn: &SeenTurn| {
        let dt_s = turn.to_s - turn.from_s;
        let rate = turn.yaw_rad / dt_s;
        [turn.from_s + RAMP * dt_s, turn.to_s - RAMP * dt_s].map(|time_s| (time_s, rate))
    };
    turns.iter().flat_map(ends).collect()
}

/// Roll and pitch at the images' times, from a level start: where two turns are apart, the vehicle is taken to stand as it did.
fn tilts(turns: &[SeenTurn], track: &MotionModel) -> Vec<(f64, f64, f64)> {
    let mut body = Rotation3::identity();
    let mut found: Vec<(f64, f64, f64)> = Vec::with_capacity(turns.len() + 1);
    for turn in turns {
        let (roll, pitch, _) = body.euler_angles();
        if found.last().is_none_or(|last| last.0 < turn.from_s) {
            found.push((turn.from_s, roll, pitch));
        }
        // The body as seen from where the vehicle heads now.
        let yaw = track.motion(turn.from_s, turn.to_s);
        let yaw = Rotation3::from_euler_angles(0.0, 0.0, yaw.map_or(0.0, |moved| moved.yaw_rad));
        let [roll, pitch] = turn.tilt_rad;
        let moved = Rotation3::from_euler_angles(roll, pitch, 0.0);
        let (roll, pitch, _) = (yaw.inverse() * body * yaw * moved).euler_angles();
        body = Rotation3::from_euler_angles(roll, pitch, 0.0);
        found.push((turn.to_s, roll, pitch));
    }
    found
}

/// What is said of a recording whose turns were taken from its images.
pub(super) fn warning(turns: &[SeenTurn], yaw_known: bool) -> String {
    let mut pitches: Vec<f64> = turns.iter().map(|turn| turn.tilt_rad[1].abs()).collect();
    pitches.sort_by(f64::total_cmp);
    let pitch = pitches.get(pitches.len() / 2).copied().unwrap_or(0.0);
    let what = match yaw_known {
        true => "roll and pitch",
        false => "the vehicle's turns (yaw, roll and pitch)",
    };
    format!(
        "{what} are not recorded: they are taken from the images, {:.2} degrees of pitch from one to the next (median)",
        pitch.to_degrees()
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::VehicleTrack;

    /// A weaving drive that rolls and pitches, and rises all the way: between any two of its images the track turns as was seen.
    #[test]
    fn the_track_turns_as_was_seen() {
        let wave = |i: usize, k: f64| (k * i as f64).sin();
        let turns: Vec<SeenTurn> = (0..80)
            .filter(|i| *i != 40)
            .map(|i| SeenTurn {
                from_s: 0.1 * i as f64,
                to_s: 0.1 * (i + 1) as f64,
                yaw_rad: 0.05 * wave(i, 0.1),
                tilt_rad: [0.003 * wave(i, 1.3), 0.002 + 0.004 * wave(i, 0.9)],
            })
            .collect();
        let speeds: Vec<_> = (0..=80).map(|i| (0.1 * f64::from(i), 8.0, 0.02)).collect();
        for yaw_known in [true, false] {
            let track = put_into(VehicleTrack::new(&speeds).into(), &turns, yaw_known);
            for turn in &turns {
                let moved = track.motion(turn.from_s, turn.to_s).unwrap();
                let yaw = if yaw_known { 0.002 } else { turn.yaw_rad };
                // The ramps between yaw rates are a hundredth of a turn long; a yaw that the body turns by is no part of its tilt.
                assert!((moved.yaw_rad - yaw).abs() < 1e-4, "{turn:?} {moved:?}");
                for axis in 0..2 {
                    let off = (moved.tilt_rad[axis] - turn.tilt_rad[axis]).abs();
                    assert!(off < 2e-4, "{yaw_known} {turn:?} {moved:?}");
                }
            }
        }
        // Half a second without a turn is a gap in the yaw, not a straight.
        let late = SeenTurn {
            from_s: 9.0,
            to_s: 9.1,
            ..turns[0]
        };
        let speeds: Vec<_> = (0..=100).map(|i| (0.1 * f64::from(i), 8.0, 0.0)).collect();
        let gap = put_into(VehicleTrack::new(&speeds).into(), &[turns[0], late], false);
        assert!(gap.motion(4.0, 4.1).is_none() && gap.motion(9.0, 9.1).is_some());
    }
}
