//! How a CAN trace was interpreted.

use crate::units::SpeedUnit;
use deepfusion_hint::count_of;

/// How a CAN trace was interpreted, or what was left out.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CanNote {
    /// Which signal is the speed.
    #[error(
        "speed from the signal {signal} in {unit}: {speeds} of {}",
        count_of(*frames, "frame")
    )]
    Signal {
        /// Name of the signal.
        signal: String,
        /// Unit of the signal.
        unit: SpeedUnit,
        /// Number of frames that gave a speed.
        speeds: usize,
        /// Number of frames in the trace.
        frames: usize,
    },
    /// The signal's message is on several buses, one of which is read.
    #[error("its message is on the channels {}; {read} is read", counted(channels))]
    Channels {
        /// The buses as the trace names them, each with its number of frames.
        channels: Vec<(String, usize)>,
        /// The bus that is read.
        read: String,
    },
    /// Frames are not later than the one before.
    #[error(
        "left out, as not later than the frame before: {}",
        count_of(*frames, "frame")
    )]
    NotLater {
        /// Number of such frames.
        frames: usize,
    },
    /// Values lie outside the signal's range in the DBC file.
    #[error(
        "left out, as outside the signal's range: {}",
        count_of(*frames, "frame")
    )]
    BeyondRange {
        /// Number of such frames.
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
    fn notes_on_a_trace_as_text() {
        for (note, text) in [
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
                "its message is on the channels can1 (1 frame), can0 (2 frames); can0 is read",
            ),
            (
                CanNote::NotLater { frames: 2 },
                "left out, as not later than the frame before: 2 frames",
            ),
            (
                CanNote::BeyondRange { frames: 1 },
                "left out, as outside the signal's range: 1 frame",
            ),
        ] {
            assert_eq!(note.to_string(), text);
        }
    }
}
