//! How a log was understood, and what of it was left out.

mod can;
mod clock;
mod fixes;
mod gopro;
mod table;
mod turns;

pub use self::can::CanNote;
pub use self::clock::ClockNote;
pub use self::fixes::FixesNote;
pub use self::gopro::GoproNote;
pub use self::table::TableNote;
pub use self::turns::{TurnSign, TurnsNote};

/// How a log was understood, or what of it was left out.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LogNote {
    /// A table.
    #[error(transparent)]
    Table(#[from] TableNote),
    /// A receiver's fixes.
    #[error(transparent)]
    Fixes(#[from] FixesNote),
    /// A CAN trace.
    #[error(transparent)]
    Can(#[from] CanNote),
    /// A GoPro's video.
    #[error(transparent)]
    Gopro(#[from] GoproNote),
    /// A gyroscope of which nobody knows how it is mounted.
    #[error(transparent)]
    Turns(#[from] TurnsNote),
    /// How the log's clock is connected with the video's.
    #[error(transparent)]
    Clock(#[from] ClockNote),
    /// One file of a folder.
    #[error("{file}: {note}")]
    OfFile {
        /// The file's name.
        file: String,
        /// How it was understood.
        note: Box<LogNote>,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One of each kind: what a kind says itself is tested beside it.
    #[test]
    fn a_note_says_what_its_kind_says() {
        let of_table = LogNote::from(TableNote::HeaderAgain { more: 1 });
        let notes: [LogNote; 7] = [
            of_table.clone(),
            FixesNote::FixRows {
                of_satellites: true,
            }
            .into(),
            CanNote::NotLater { frames: 1 }.into(),
            GoproNote::Gps { readings: 40 }.into(),
            TurnsNote::NoGyroscope.into(),
            ClockNote::NoZone.into(),
            LogNote::OfFile {
                file: "Location.csv".into(),
                note: of_table.into(),
            },
        ];
        let said = [
            "the header stands once more among the rows",
            "speeds of the Fix rows of satellites alone (GPS)",
            "left out, not later than the one before: 1 frame",
            "speeds of the camera's GPS, 40 readings on the video's own clock",
            "no gyroscope with an accelerometer beside it: how the vehicle turned is unknown",
            "the log's dates have no zone and are taken for UTC, as the video's are",
            "Location.csv: the header stands once more among the rows",
        ];
        assert_eq!(notes.map(|note| note.to_string()), said);
    }
}
