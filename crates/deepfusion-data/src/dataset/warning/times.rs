//! What is unsure about when something was measured.

use crate::logs::clock::seconds;
use deepfusion_hint::count_of;

/// What is unsure about when something was measured.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TimesWarning {
    /// The images have no times.
    #[error(
        "nothing says when the images were taken: no frames.csv, no timestamps.txt, no fps in dataset.toml"
    )]
    ImagesUntimed,
    /// The images' times are their names, which look like dates.
    #[error("the images' names are their times, in {unit}")]
    ImagesByName {
        /// The unit, by its sign.
        unit: &'static str,
    },
    /// A table does not say the unit of its times.
    #[error("{table}: column {column} has no unit, taken as {unit} by its numbers")]
    NoUnit {
        /// The table's name.
        table: String,
        /// The column's header.
        column: String,
        /// The unit that is taken, by its sign.
        unit: &'static str,
    },
    /// Rows of a table have the time of the row above.
    #[error(
        "{table}: {} {} the time of the row above ({} {line}) and {} left out",
        count_of(*rows, "row"),
        if *rows == 1 { "repeats" } else { "repeat" },
        if *rows == 1 { "in line" } else { "first in line" },
        if *rows == 1 { "is" } else { "are" }
    )]
    Repeated {
        /// The table's name.
        table: String,
        /// How many rows.
        rows: usize,
        /// The line of the first, counted from 1.
        line: u64,
    },
    /// The times of a log, or of a list of the frames' times, are dates without a zone.
    #[error(
        "{log}: its dates have no zone and are taken for UTC (start_s in dataset.toml moves the frames)"
    )]
    NoZone {
        /// The name of the log or the list.
        log: String,
    },
    /// A video's frames have no times.
    #[error("the video has no time stamps: set fps in dataset.toml")]
    VideoUntimed,
    /// A video's times count from its beginning, and only its recorder says when that was.
    #[error(
        "the video is taken to begin at {}, as its recorder says (start_s = {:.3} in dataset.toml; another moves it)",
        date(*start_ns),
        seconds(*start_ns, 0)
    )]
    VideoBegins {
        /// When it is taken to begin, nanoseconds since 1970.
        start_ns: i64,
    },
    /// Nothing of a video is within its log by what its recorder says.
    #[error("by its recorder's date nothing of the video is within the log{}", moved(*moved_ns))]
    VideoBesideLog {
        /// When it began, where the date is one of a local clock and by a single zone's time it is within the log, nanoseconds since 1970.
        moved_ns: Option<i64>,
    },
    /// The date of a video is of a recorder that writes local time, and the log does not show that this was UTC.
    #[error(
        "a {model} writes the time of its own zone, which is taken for UTC: the video may begin hours off (start_s in dataset.toml moves it)"
    )]
    LocalRecorder {
        /// The camera.
        model: String,
    },
    /// Nothing says that a video and the tables beside it have one clock.
    #[error(
        "the video's time stamps are taken to be on the tables' clock (start_s in dataset.toml moves them)"
    )]
    VideoOnTablesClock,
    /// A video and the list of its frames' times are of different lengths.
    #[error(
        "{list} has {}, {video} {}: the first {} are taken",
        count_of(*times, "time"),
        count_of(*frames, "frame"),
        usize::min(*times, *frames)
    )]
    OtherCount {
        /// The file of the times.
        list: &'static str,
        /// How many times it has.
        times: usize,
        /// The video.
        video: &'static str,
        /// How many frames it has.
        frames: usize,
    },
    /// The headers of a topic's messages have no time.
    #[error(
        "{topic}: {} {}; the time of recording is used, which is late by the transport delay",
        count_of(*messages, "message"),
        if *messages == 1 { "has no time in its header" } else { "have no time in their header" }
    )]
    Unstamped {
        /// The topic.
        topic: String,
        /// How many of its messages.
        messages: usize,
    },
}

/// What follows where a video's date may be one of a local clock.
fn moved(start_ns: Option<i64>) -> String {
    match start_ns {
        None => ": start_s in dataset.toml says when it begins".to_owned(),
        Some(ns) => format!(
            ": it may be local time, of which {} in UTC is within (start_s = {:.3} in dataset.toml)",
            date(ns),
            seconds(ns, 0)
        ),
    }
}

fn date(ns: i64) -> String {
    let date = jiff::Timestamp::from_nanosecond(ns.into());
    date.map_or_else(|_| "?".into(), |date| date.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_said_of_times() {
        let repeated = |rows| TimesWarning::Repeated {
            table: "speed.csv".into(),
            rows,
            line: 3,
        };
        let unstamped = |messages| TimesWarning::Unstamped {
            topic: "/imu".into(),
            messages,
        };
        for (warning, said) in [
            (
                TimesWarning::ImagesUntimed,
                "nothing says when the images were taken: no frames.csv, no timestamps.txt, no fps in dataset.toml",
            ),
            (
                TimesWarning::ImagesByName { unit: "ns" },
                "the images' names are their times, in ns",
            ),
            (
                TimesWarning::NoUnit {
                    table: "speed.csv".into(),
                    column: "timestamp".into(),
                    unit: "us",
                },
                "speed.csv: column timestamp has no unit, taken as us by its numbers",
            ),
            (
                repeated(1),
                "speed.csv: 1 row repeats the time of the row above (in line 3) and is left out",
            ),
            (
                repeated(2),
                "speed.csv: 2 rows repeat the time of the row above (first in line 3) and are left out",
            ),
            (
                TimesWarning::NoZone {
                    log: "trip.csv".into(),
                },
                "trip.csv: its dates have no zone and are taken for UTC (start_s in dataset.toml moves the frames)",
            ),
            (
                TimesWarning::VideoBegins {
                    start_ns: 1_700_000_000_000_000_000,
                },
                "the video is taken to begin at 2023-11-14T22:13:20Z, as its recorder says (start_s = 1700000000.000 in dataset.toml; \
                 another moves it)",
            ),
            (
                TimesWarning::VideoBesideLog { moved_ns: None },
                "by its recorder's date nothing of the video is within the log: start_s in dataset.toml says when it begins",
            ),
            (
                TimesWarning::VideoBesideLog {
                    moved_ns: Some(1_700_000_000_000_000_000),
                },
                "by its recorder's date nothing of the video is within the log: it may be local time, of which \
                 2023-11-14T22:13:20Z in UTC is within (start_s = 1700000000.000 in dataset.toml)",
            ),
            (
                TimesWarning::LocalRecorder {
                    model: "HERO11 Black".into(),
                },
                "a HERO11 Black writes the time of its own zone, which is taken for UTC: the video may begin hours off (start_s in \
                 dataset.toml moves it)",
            ),
            (
                TimesWarning::VideoOnTablesClock,
                "the video's time stamps are taken to be on the tables' clock (start_s in dataset.toml moves them)",
            ),
            (
                TimesWarning::OtherCount {
                    list: "global_pose/frame_times",
                    times: 1,
                    video: "video.hevc",
                    frames: 12,
                },
                "global_pose/frame_times has 1 time, video.hevc 12 frames: the first 1 are taken",
            ),
            (
                unstamped(1),
                "/imu: 1 message has no time in its header; the time of recording is used, which is late by the transport delay",
            ),
            (
                unstamped(25),
                "/imu: 25 messages have no time in their header; the time of recording is used, which is late by the transport delay",
            ),
        ] {
            assert_eq!(warning.to_string(), said);
        }
    }
}
