//! How a log was interpreted, and what was left out.

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

/// How a log was interpreted, or what was left out.
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
    /// A gyroscope whose mounting is unknown.
    #[error(transparent)]
    Turns(#[from] TurnsNote),
    /// How the log's clock is related to the video's.
    #[error(transparent)]
    Clock(#[from] ClockNote),
    /// One file of a folder.
    #[error("{file}: {note}")]
    OfFile {
        /// Name of the file.
        file: String,
        /// How the file was interpreted.
        note: Box<LogNote>,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One of each kind. All notes of a kind are tested beside it.
    #[test]
    fn a_note_prints_the_text_of_its_kind() {
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
        let texts = [
            "the header is repeated once among the rows",
            "speeds of the Fix rows of the GPS provider",
            "left out, as not later than the frame before: 1 frame",
            "speeds of the camera's GPS, 40 readings on the video's own clock",
            "no gyroscope with an accelerometer: how the vehicle turned is unknown",
            "the log's dates have no time zone and are taken as UTC, as the video's are",
            "Location.csv: the header is repeated once among the rows",
        ];
        assert_eq!(notes.map(|note| note.to_string()), texts);
    }
}
