//! How a CAN trace was understood.

use crate::units::SpeedUnit;
use deepfusion_hint::count_of;

/// How a CAN trace was understood, or what of it was left out.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CanNote {
    /// Which signal is the speed.
    #[error(
        "speed from the signal {signal} in {unit}: {speeds} of {}",
        count_of(*frames, "frame")
    )]
    Signal {
        /// Its name.
        signal: String,
        /// Its unit.
        unit: SpeedUnit,
        /// How many frames gave a speed.
        speeds: usize,
        /// How many frames the trace has.
        frames: usize,
    },
    /// The signal's message comes on several buses, of which one is read.
    #[error(
        "its message comes on the channels {}: {read} is read",
        counted(channels)
    )]
    Channels {
        /// The buses as the trace names them, each with how many of the frames it has.
        channels: Vec<(String, usize)>,
        /// The one that is read.
        read: String,
    },
    /// Frames that are not later than the one before.
    #[error(
        "left out, not later than the one before: {}",
        count_of(*frames, "frame")
    )]
    NotLater {
        /// How many.
        frames: usize,
    },
    /// Values that the description says the signal never has.
    #[error(
        "left out, beyond the range of the signal: {}",
        count_of(*frames, "frame")
    )]
    BeyondRange {
        /// How many.
        frames: usize,
    },
}

fn counted(channels: &[(String, usize)]) -> String {
    let channels = channels.iter();
    let channels = channels.map(|(name, count)| format!("{name} ({})", count_of(*count, "frame")));
    channels.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_said_of_a_trace() {
        for (note, said) in [
            (
                CanNote::Signal {
                    signal: "Wheels.Speed".into(),
                    unit: SpeedUnit::KilometresPerHour,
                    speeds: 240,
                    frames: 961,
                },
                "speed from the signal Wheels.Speed in km/h: 240 of 961 frames",
            ),
            (
                CanNote::Channels {
                    channels: vec![("can1".into(), 1), ("can0".into(), 2)],
                    read: "can0".into(),
                },
                "its message comes on the channels can1 (1 frame), can0 (2 frames): can0 is read",
            ),
            (
                CanNote::NotLater { frames: 2 },
                "left out, not later than the one before: 2 frames",
            ),
            (
                CanNote::BeyondRange { frames: 1 },
                "left out, beyond the range of the signal: 1 frame",
            ),
        ] {
            assert_eq!(note.to_string(), said);
        }
    }
}
