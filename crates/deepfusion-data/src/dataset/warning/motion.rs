//! What is unsure about how the vehicle moved.

use crate::TopicRole;
use deepfusion_hint::count_of;
use deepfusion_logs::LogNote;
use deepfusion_motion::can::CanId;

/// What is unsure about how the vehicle moved.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MotionWarning {
    /// No speed was measured about the time of some frames.
    #[error(
        "no speed is measured about the time of {frames} of {}",
        count_of(*of, "frame")
    )]
    FramesWithoutSpeed {
        /// How many frames.
        frames: usize,
        /// Of so many that have a time.
        of: usize,
    },
    /// Speeds are in a log, and turns nowhere.
    #[error("{log}: no yaw rate, here or in imu.csv: how the car turned is not recorded")]
    NoYawRate {
        /// The log's name.
        log: String,
    },
    /// A recording in KITTI's layout whose `dataset.toml` says that its yaw rates are none.
    #[error("oxts: yaw_known = false in dataset.toml: how the car turned is not recorded")]
    YawNotMeasured,
    /// How another program's log was understood ([`deepfusion_logs::DriveLog::notes`]).
    #[error("{log}: {note}")]
    Understood {
        /// The log's name.
        log: String,
        /// How.
        note: LogNote,
    },
    /// `course.csv` is not what this program writes under that name.
    #[error("course.csv: not read, as it has no column course_rate_radps")]
    NoCourseRates,
    /// `course.csv` is no table.
    #[error("not read: {why}")]
    CourseNotRead {
        /// The error that reading it gave, with its path.
        why: String,
    },
    /// Speeds lie far apart, and those between were filled in.
    #[error(
        "{log}: {} of up to {longest_s:.1} s between speeds are bridged in a straight line ({setting})",
        count_of(*gaps, "gap")
    )]
    Bridged {
        /// The name of the log or the topic.
        log: String,
        /// How many gaps.
        gaps: usize,
        /// The longest of them, seconds.
        longest_s: f64,
        /// The key that says which are bridged, and its file.
        setting: &'static str,
    },
    /// Speeds lie so far apart that nothing is known between them.
    #[error(
        "{log}: {} of more than {most_s:.1} s, across which the speed counts as unknown ({setting})",
        count_of(*gaps, "gap")
    )]
    NotBridged {
        /// The name of the log or the topic.
        log: String,
        /// How many gaps.
        gaps: usize,
        /// The longest that would be bridged, seconds.
        most_s: f64,
        /// The key that says which are bridged, and its file.
        setting: &'static str,
    },
    /// Nothing in a comma2k19 segment says how the car turned.
    #[error(
        "the segment has neither gyroscope and accelerometer nor a steering angle of a known vehicle: how the car turned is unknown"
    )]
    SegmentWithoutTurns,
    /// Turns were not recorded, and are taken from the images ([`crate::Dataset::take_turns`]).
    #[error(
        "{} are not recorded: they are taken from the images{}, {:.2} degrees of pitch from one to the next (median)",
        if *yaw_recorded { "roll and pitch" } else { "the vehicle's turns (yaw, roll and pitch)" },
        some_of(*seen, *pairs),
        pitch_rad.to_degrees()
    )]
    TurnsOfImages {
        /// Whether a yaw rate was recorded, so that roll and pitch alone are taken.
        yaw_recorded: bool,
        /// Between how many neighbouring images the turn was seen.
        seen: usize,
        /// How many neighbours there are.
        pairs: usize,
        /// The median change of pitch from one image to the next, radians.
        pitch_rad: f64,
    },
    /// A satellite receiver had no position for a while.
    #[error(
        "{topic}: left out, as they have no position: {messages} of {}",
        count_of(*of, "message")
    )]
    NoPosition {
        /// The topic.
        topic: String,
        /// How many of its messages have none.
        messages: usize,
        /// How many messages it has.
        of: usize,
    },
    /// A satellite receiver's positions are too few to give a speed.
    #[error(
        "{topic}: no speed from {}, at least two in ten seconds are needed",
        count_of(*positions, "position")
    )]
    TooFewPositions {
        /// The topic.
        topic: String,
        /// How many there are.
        positions: usize,
    },
    /// The speeds follow from a satellite receiver's positions.
    #[error(
        "{topic}: speeds are those of its positions, smoothed, sure to {sigma_mps:.2} m/s in the middle"
    )]
    OfPositions {
        /// The topic.
        topic: String,
        /// The median of their standard deviations, m/s.
        sigma_mps: f64,
    },
    /// A topic's velocities are along other axes than the vehicle's.
    #[error(
        "{topic}: its velocities are in the world's axes: their length is taken as the speed, and always as forward"
    )]
    WorldAxes {
        /// The topic.
        topic: String,
    },
    /// What the vehicle was asked for stands for what it did.
    #[error(
        "{topic}: by its name a command, taken for the measured {role} as nothing else is there; another source is better"
    )]
    Commanded {
        /// The topic.
        topic: String,
        /// What it is taken for.
        role: TopicRole,
    },
    /// The messages of an odometry have no twist: its poses say how the vehicle moves.
    #[error("{topic}: its messages have no twist: speed and turns are those of its poses")]
    OfPoses {
        /// The topic.
        topic: String,
    },
    /// The messages of an odometry have no twist, and its poses are of a body with other axes than the vehicle's.
    #[error(
        "{topic}: no speed, as its messages have no twist, and its poses' x does not point along the way"
    )]
    PosesOfOtherAxes {
        /// The topic.
        topic: String,
    },
    /// The messages of an odometry have no twist, and so much time is between its poses that nothing is known in between.
    #[error(
        "{topic}: no speed, as its messages have no twist, and its poses are too far apart in time"
    )]
    PosesFarApart {
        /// The topic.
        topic: String,
    },
    /// The messages of an inertial unit say no angular rates.
    #[error(
        "{topic}: not read, as it has no angular rates: they are 0 throughout, or said not to be there"
    )]
    NoRates {
        /// The topic.
        topic: String,
    },
    /// Values that a signal has by its description never: the bus's way to say that it has none.
    #[error("{key}: {} beyond the signal's range left out", count_of(*frames, "value"))]
    BeyondRange {
        /// The signal's key in the file beside the bag.
        key: &'static str,
        /// How many.
        frames: usize,
    },
    /// No frame of the bus holds a signal that was named.
    #[error("{key}: no CAN frame {} holds a value of it", number(*id))]
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
    fn what_is_said_of_speeds() {
        let log = || "speed.csv".to_owned();
        let topic = || "/gnss/fix".to_owned();
        for (warning, said) in [
            (
                MotionWarning::FramesWithoutSpeed { frames: 3, of: 12 },
                "no speed is measured about the time of 3 of 12 frames",
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
                "speed.csv: 4 gaps of up to 1.0 s between speeds are bridged in a straight line (max_gap_s in dataset.toml)",
            ),
            (
                MotionWarning::NotBridged {
                    log: log(),
                    gaps: 1,
                    most_s: 3.0,
                    setting: "max_gap_s in dataset.toml",
                },
                "speed.csv: 1 gap of more than 3.0 s, across which the speed counts as unknown (max_gap_s in dataset.toml)",
            ),
            (
                MotionWarning::NoPosition {
                    topic: topic(),
                    messages: 1,
                    of: 10,
                },
                "/gnss/fix: left out, as they have no position: 1 of 10 messages",
            ),
            (
                MotionWarning::TooFewPositions {
                    topic: topic(),
                    positions: 1,
                },
                "/gnss/fix: no speed from 1 position, at least two in ten seconds are needed",
            ),
            (
                MotionWarning::OfPositions {
                    topic: topic(),
                    sigma_mps: 0.123,
                },
                "/gnss/fix: speeds are those of its positions, smoothed, sure to 0.12 m/s in the middle",
            ),
            (
                MotionWarning::Commanded {
                    topic: "/cmd_vel".into(),
                    role: TopicRole::Speed,
                },
                "/cmd_vel: by its name a command, taken for the measured speed as nothing else is there; another source is better",
            ),
            (
                MotionWarning::OfPoses {
                    topic: "/Odometry".into(),
                },
                "/Odometry: its messages have no twist: speed and turns are those of its poses",
            ),
            (
                MotionWarning::PosesOfOtherAxes {
                    topic: "/vins".into(),
                },
                "/vins: no speed, as its messages have no twist, and its poses' x does not point along the way",
            ),
            (
                MotionWarning::NoRates {
                    topic: "/camera/accel/sample".into(),
                },
                "/camera/accel/sample: not read, as it has no angular rates: they are 0 throughout, or said not to be there",
            ),
            (
                MotionWarning::WorldAxes { topic: topic() },
                "/gnss/fix: its velocities are in the world's axes: their length is taken as the speed, and always as forward",
            ),
        ] {
            assert_eq!(warning.to_string(), said);
        }
    }

    #[test]
    fn what_is_said_of_turns() {
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
        for (warning, said) in [
            (
                MotionWarning::NoYawRate {
                    log: "speed.csv".into(),
                },
                "speed.csv: no yaw rate, here or in imu.csv: how the car turned is not recorded",
            ),
            (
                MotionWarning::CourseNotRead {
                    why: "course.csv:2: column any: 1 value".into(),
                },
                "not read: course.csv:2: column any: 1 value",
            ),
            (
                MotionWarning::SegmentWithoutTurns,
                "the segment has neither gyroscope and accelerometer nor a steering angle of a known vehicle: how the car turned is unknown",
            ),
            (
                turns(true, 10),
                "roll and pitch are not recorded: they are taken from the images, 0.25 degrees of pitch from one to the next (median)",
            ),
            (
                turns(false, 6),
                "the vehicle's turns (yaw, roll and pitch) are not recorded: they are taken from the images (6 of 10 pairs), 0.25 degrees of \
                 pitch from one to the next (median)",
            ),
            (
                MotionWarning::BeyondRange {
                    key: "can.speed",
                    frames: 1,
                },
                "can.speed: 1 value beyond the signal's range left out",
            ),
            (
                silent(CanId::Standard(0x158)),
                "can.speed: no CAN frame 0x158 holds a value of it",
            ),
            (
                silent(CanId::Extended {
                    extended: 0x18f0_090b,
                }),
                "can.speed: no CAN frame 0x18f0090b (29 bits) holds a value of it",
            ),
        ] {
            assert_eq!(warning.to_string(), said);
        }
    }
}
