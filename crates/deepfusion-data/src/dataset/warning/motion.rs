//! Warnings about the vehicle's motion.

use crate::TopicRole;
use deepfusion_hint::count_of;
use deepfusion_logs::LogNote;
use deepfusion_motion::can::CanId;

/// A warning about the vehicle's motion.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MotionWarning {
    /// No speed was measured around the time of some frames.
    #[error(
        "no speed was measured around the time of {frames} of {}",
        count_of(*of, "frame")
    )]
    FramesWithoutSpeed {
        /// Number of frames without a speed.
        frames: usize,
        /// Number of frames with a time.
        of: usize,
    },
    /// A log has speeds, but no yaw rate was recorded.
    #[error("{log}: no yaw rate, here or in imu.csv: the vehicle's turns are unknown")]
    NoYawRate {
        /// The log's name.
        log: String,
    },
    /// In a recording in KITTI's layout, `dataset.toml` marks the yaw rates as unknown.
    #[error("oxts: yaw_known = false in dataset.toml: the vehicle's turns are unknown")]
    YawNotMeasured,
    /// A note on how another program's log was interpreted ([`deepfusion_logs::DriveLog::notes`]).
    #[error("{log}: {note}")]
    Understood {
        /// The log's name.
        log: String,
        /// The note.
        note: LogNote,
    },
    /// `course.csv` was not written by this program.
    #[error("course.csv: not read, since it has no column course_rate_radps")]
    NoCourseRates,
    /// `course.csv` is not a readable table.
    #[error("not read: {why}")]
    CourseNotRead {
        /// Message of the error on reading it, with its path.
        why: String,
    },
    /// Gaps between speeds were interpolated.
    #[error(
        "{log}: speeds are interpolated linearly across {} of up to {longest_s:.1} s ({setting})",
        count_of(*gaps, "gap")
    )]
    Bridged {
        /// The name of the log or the topic.
        log: String,
        /// Number of gaps.
        gaps: usize,
        /// The longest of them, seconds.
        longest_s: f64,
        /// The key for the longest gap that is bridged, and its file.
        setting: &'static str,
    },
    /// Gaps between speeds are too long to be bridged.
    #[error(
        "{log}: {} of more than {most_s:.1} s, in which the speed counts as unknown ({setting})",
        count_of(*gaps, "gap")
    )]
    NotBridged {
        /// The name of the log or the topic.
        log: String,
        /// Number of gaps.
        gaps: usize,
        /// The longest gap that would be bridged, seconds.
        most_s: f64,
        /// The key for the longest gap that is bridged, and its file.
        setting: &'static str,
    },
    /// A comma2k19 segment has no measurement of turns.
    #[error(
        "the segment has neither gyroscope and accelerometer nor the steering angle of a known vehicle: the vehicle's turns are unknown"
    )]
    SegmentWithoutTurns,
    /// Turns were not recorded, and are estimated from the images ([`crate::Dataset::take_turns`]).
    #[error(
        "{} are not recorded: estimating them from the images{}; median pitch from one to the next {:.2} degrees",
        if *yaw_recorded { "roll and pitch" } else { "the vehicle's turns (yaw, roll and pitch)" },
        some_of(*seen, *pairs),
        pitch_rad.to_degrees()
    )]
    TurnsOfImages {
        /// Whether a yaw rate was recorded, so that only roll and pitch are estimated.
        yaw_recorded: bool,
        /// Number of neighbouring pairs with an estimated turn.
        seen: usize,
        /// Number of neighbouring pairs.
        pairs: usize,
        /// The median change of pitch from one image to the next, radians.
        pitch_rad: f64,
    },
    /// A GPS receiver had no position for a while.
    #[error(
        "{topic}: {messages} of {} left out for lack of a position",
        count_of(*of, "message")
    )]
    NoPosition {
        /// Name of the topic.
        topic: String,
        /// Number of its messages without a position.
        messages: usize,
        /// Number of its messages.
        of: usize,
    },
    /// A GPS receiver has too few positions for a speed.
    #[error(
        "{topic}: no speed from {}, expected at least two within 10 s",
        count_of(*positions, "position")
    )]
    TooFewPositions {
        /// Name of the topic.
        topic: String,
        /// Number of positions.
        positions: usize,
    },
    /// The speeds are computed from a GPS receiver's positions.
    #[error(
        "{topic}: speeds from its positions, smoothed, with a median standard deviation of {sigma_mps:.2} m/s"
    )]
    OfPositions {
        /// Name of the topic.
        topic: String,
        /// The median of their standard deviations, m/s.
        sigma_mps: f64,
    },
    /// A topic's velocities are in world axes instead of the vehicle's.
    #[error("{topic}: its velocities are in world axes: using their length as forward speed")]
    WorldAxes {
        /// Name of the topic.
        topic: String,
    },
    /// A command to the vehicle is used as a measurement.
    #[error("{topic}: a command by its name, used as measured {role} for lack of another source")]
    Commanded {
        /// Name of the topic.
        topic: String,
        /// The role for which it is used.
        role: TopicRole,
    },
    /// Odometry messages have no twist, so the vehicle's motion is computed from their poses.
    #[error("{topic}: its messages have no twist: speed and turns are computed from its poses")]
    OfPoses {
        /// Name of the topic.
        topic: String,
    },
    /// Odometry messages have no twist, and their poses have axes other than the vehicle's.
    #[error(
        "{topic}: no speed, since its messages have no twist and the x axis of its poses does not point forward"
    )]
    PosesOfOtherAxes {
        /// Name of the topic.
        topic: String,
    },
    /// Odometry messages have no twist, and the time between their poses is too long.
    #[error(
        "{topic}: no speed, since its messages have no twist and its poses are too far apart in time"
    )]
    PosesFarApart {
        /// Name of the topic.
        topic: String,
    },
    /// The messages of an inertial unit have no angular rates.
    #[error("{topic}: not read, since it has no angular rates (all are 0, or marked as missing)")]
    NoRates {
        /// Name of the topic.
        topic: String,
    },
    /// Values outside the signal's defined range, which mark missing values on the bus.
    #[error("{key}: {} outside the signal's range left out", count_of(*frames, "value"))]
    BeyondRange {
        /// The signal's key in the file beside the bag.
        key: &'static str,
        /// Number of values.
        frames: usize,
    },
    /// No CAN frame has a value of a named signal.
    #[error("{key}: no CAN frame {} has a value of it", number(*id))]
    SilentSignal {
        /// The signal's key in the file beside the bag.
        key: &'static str,
        /// The identifier of its frames.
        id: CanId,
    },
}

fn some_of(seen: usize, pairs: usize) -> String {
    if seen == pairs {
        String::new()
    } else {
        format!(" ({seen} of {})", count_of(pairs, "pair"))
    }
}

fn number(id: CanId) -> String {
    match id {
        CanId::Standard(id) => format!("0x{id:x}"),
        CanId::Extended { extended } => format!("0x{extended:x} (29 bits)"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_logs::TableNote;

    #[test]
    fn messages_about_speeds() {
        let log = || "speed.csv".to_owned();
        let topic = || "/gnss/fix".to_owned();
        for (warning, expected) in [
            (
                MotionWarning::FramesWithoutSpeed { frames: 3, of: 12 },
                "no speed was measured around the time of 3 of 12 frames",
            ),
            (
                MotionWarning::Understood {
                    log: "trip.csv".into(),
                    note: TableNote::HeaderAgain { more: 1 }.into(),
                },
                "trip.csv: the header is repeated once among the rows",
            ),
            (
                MotionWarning::Bridged {
                    log: log(),
                    gaps: 4,
                    longest_s: 1.04,
                    setting: "max_gap_s in dataset.toml",
                },
                "speed.csv: speeds are interpolated linearly across 4 gaps of up to 1.0 s (max_gap_s in dataset.toml)",
            ),
            (
                MotionWarning::NotBridged {
                    log: log(),
                    gaps: 1,
                    most_s: 3.0,
                    setting: "max_gap_s in dataset.toml",
                },
                "speed.csv: 1 gap of more than 3.0 s, in which the speed counts as unknown (max_gap_s in dataset.toml)",
            ),
            (
                MotionWarning::NoPosition {
                    topic: topic(),
                    messages: 1,
                    of: 10,
                },
                "/gnss/fix: 1 of 10 messages left out for lack of a position",
            ),
            (
                MotionWarning::TooFewPositions {
                    topic: topic(),
                    positions: 1,
                },
                "/gnss/fix: no speed from 1 position, expected at least two within 10 s",
            ),
            (
                MotionWarning::OfPositions {
                    topic: topic(),
                    sigma_mps: 0.123,
                },
                "/gnss/fix: speeds from its positions, smoothed, with a median standard deviation of 0.12 m/s",
            ),
            (
                MotionWarning::Commanded {
                    topic: "/cmd_vel".into(),
                    role: TopicRole::Speed,
                },
                "/cmd_vel: a command by its name, used as measured speed for lack of another source",
            ),
            (
                MotionWarning::OfPoses {
                    topic: "/Odometry".into(),
                },
                "/Odometry: its messages have no twist: speed and turns are computed from its poses",
            ),
            (
                MotionWarning::PosesOfOtherAxes {
                    topic: "/vins".into(),
                },
                "/vins: no speed, since its messages have no twist and the x axis of its poses does not point forward",
            ),
            (
                MotionWarning::NoRates {
                    topic: "/camera/accel/sample".into(),
                },
                "/camera/accel/sample: not read, since it has no angular rates (all are 0, or marked as missing)",
            ),
            (
                MotionWarning::WorldAxes { topic: topic() },
                "/gnss/fix: its velocities are in world axes: using their length as forward speed",
            ),
        ] {
            assert_eq!(warning.to_string(), expected);
        }
    }

    #[test]
    fn messages_about_turns() {
        let turns = |yaw_recorded, seen| MotionWarning::TurnsOfImages {
            yaw_recorded,
            seen,
            pairs: 10,
            pitch_rad: 0.25_f64.to_radians(),
        };
        let silent = |id| MotionWarning::SilentSignal {
            key: "can.speed",
            id,
        };
        for (warning, expected) in [
            (
                MotionWarning::NoYawRate {
                    log: "speed.csv".into(),
                },
                "speed.csv: no yaw rate, here or in imu.csv: the vehicle's turns are unknown",
            ),
            (
                MotionWarning::CourseNotRead {
                    why: "course.csv:2: 1 value".into(),
                },
                "not read: course.csv:2: 1 value",
            ),
            (
                MotionWarning::SegmentWithoutTurns,
                "the segment has neither gyroscope and accelerometer nor the steering angle of a known vehicle: the vehicle's turns are unknown",
            ),
            (
                turns(true, 10),
                "roll and pitch are not recorded: estimating them from the images; median pitch from one to the next 0.25 degrees",
            ),
            (
                turns(false, 6),
                "the vehicle's turns (yaw, roll and pitch) are not recorded: estimating them from the images (6 of 10 pairs); median pitch \
                 from one to the next 0.25 degrees",
            ),
            (
                MotionWarning::BeyondRange {
                    key: "can.speed",
                    frames: 1,
                },
                "can.speed: 1 value outside the signal's range left out",
            ),
            (
                silent(CanId::Standard(0x158)),
                "can.speed: no CAN frame 0x158 has a value of it",
            ),
            (
                silent(CanId::Extended {
                    extended: 0x18f0_090b,
                }),
                "can.speed: no CAN frame 0x18f0090b (29 bits) has a value of it",
            ),
        ] {
            assert_eq!(warning.to_string(), expected);
        }
    }
}
