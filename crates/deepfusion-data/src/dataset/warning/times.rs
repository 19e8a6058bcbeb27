//! Warnings about times.

use crate::logs::clock::seconds;
use deepfusion_hint::count_of;

/// A warning about times.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TimesWarning {
    /// The images have no times.
    #[error("the images have no times: no frames.csv, no timestamps.txt, no fps in dataset.toml")]
    ImagesUntimed,
    /// The images' times are taken from their names, which look like dates.
    #[error("the images' times are taken from their names, in {unit}")]
    ImagesByName {
        /// The unit's symbol.
        unit: &'static str,
    },
    /// A table does not state the unit of its times.
    #[error("{table}: column {column} has no unit, assuming {unit} from its numbers")]
    NoUnit {
        /// The table's name.
        table: String,
        /// The column's header.
        column: String,
        /// Symbol of the assumed unit.
        unit: &'static str,
    },
    /// Rows of a table repeat the time of the row above.
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
        /// Number of rows.
        rows: usize,
        /// The line of the first of them, counted from 1.
        line: u64,
    },
    /// The times of a log or of a list of frame times are dates without a time zone.
    #[error(
        "{log}: its dates have no time zone, assuming UTC (start_s in dataset.toml shifts the frames)"
    )]
    NoZone {
        /// The name of the log or the list.
        log: String,
    },
    /// A video's frames have no times.
    #[error("the video has no time stamps: set fps in dataset.toml")]
    VideoUntimed,
    /// A video's times count from its beginning, which is taken from the recorder's date.
    #[error(
        "the video is assumed to begin at {}, its recorder's date (start_s = {:.3} in dataset.toml; another value shifts it)",
        date(*start_ns),
        seconds(*start_ns, 0)
    )]
    VideoBegins {
        /// Assumed beginning, nanoseconds since 1970.
        start_ns: i64,
    },
    /// According to the recorder's date, a video does not overlap with its log.
    #[error("according to its recorder's date, no part of the video is within the log{}", moved(*moved_ns))]
    VideoBesideLog {
        /// Beginning of the video if the date is local time, nanoseconds since 1970; `None` unless a single time zone fits the log best.
        moved_ns: Option<i64>,
    },
    /// The recorder writes local time, and the log does not show that this was UTC.
    #[error(
        "a {model} writes local time, which is assumed to be UTC: the video's beginning may be wrong by hours (start_s in dataset.toml shifts it)"
    )]
    LocalRecorder {
        /// The camera's model.
        model: String,
    },
    /// It is only assumed that a video and the tables beside it have the same clock.
    #[error(
        "the video's time stamps are assumed to be on the tables' clock (start_s in dataset.toml shifts them)"
    )]
    VideoOnTablesClock,
    /// A video and the list of its frames' times have different lengths.
    #[error(
        "{list} has {}, {video} {}: using the first {}",
        count_of(*times, "time"),
        count_of(*frames, "frame"),
        usize::min(*times, *frames)
    )]
    OtherCount {
        /// Name of the file of times.
        list: &'static str,
        /// Number of times in it.
        times: usize,
        /// Name of the video.
        video: &'static str,
        /// Number of its frames.
        frames: usize,
    },
    /// The headers of a topic's messages have no time.
    #[error(
        "{topic}: {} {}; using the time of recording, which is later by the transport delay",
        count_of(*messages, "message"),
        if *messages == 1 { "has no time in its header" } else { "have no time in their headers" }
    )]
    Unstamped {
        /// Name of the topic.
        topic: String,
        /// Number of such messages.
        messages: usize,
    },
}

/// End of the warning: what to do if the video's date may be local time.
fn moved(start_ns: Option<i64>) -> String {
    match start_ns {
        None => ": set start_s in dataset.toml to its beginning".to_owned(),
        Some(ns) => format!(
            ": it may be local time; the video then begins at {} (start_s = {:.3} in dataset.toml)",
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
    fn messages_about_times() {
        let repeated = |rows| TimesWarning::Repeated {
            table: "speed.csv".into(),
            rows,
            line: 3,
        };
        let unstamped = |messages| TimesWarning::Unstamped {
            topic: "/imu".into(),
            messages,
        };
        for (warning, expected) in [
            (
                TimesWarning::ImagesUntimed,
                "the images have no times: no frames.csv, no timestamps.txt, no fps in dataset.toml",
            ),
            (
                TimesWarning::ImagesByName { unit: "ns" },
                "the images' times are taken from their names, in ns",
            ),
            (
                TimesWarning::NoUnit {
                    table: "speed.csv".into(),
                    column: "timestamp".into(),
                    unit: "us",
                },
                "speed.csv: column timestamp has no unit, assuming us from its numbers",
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
                "trip.csv: its dates have no time zone, assuming UTC (start_s in dataset.toml shifts the frames)",
            ),
            (
                TimesWarning::VideoBegins {
                    start_ns: 1_700_000_000_000_000_000,
                },
                "the video is assumed to begin at 2023-11-14T22:13:20Z, its recorder's date (start_s = 1700000000.000 in dataset.toml; \
                 another value shifts it)",
            ),
            (
                TimesWarning::VideoBesideLog { moved_ns: None },
                "according to its recorder's date, no part of the video is within the log: set start_s in dataset.toml to its beginning",
            ),
            (
                TimesWarning::VideoBesideLog {
                    moved_ns: Some(1_700_000_000_000_000_000),
                },
                "according to its recorder's date, no part of the video is within the log: it may be local time; the video then begins at \
                 2023-11-14T22:13:20Z (start_s = 1700000000.000 in dataset.toml)",
            ),
            (
                TimesWarning::LocalRecorder {
                    model: "HERO11 Black".into(),
                },
                "a HERO11 Black writes local time, which is assumed to be UTC: the video's beginning may be wrong by hours (start_s in \
                 dataset.toml shifts it)",
            ),
            (
                TimesWarning::VideoOnTablesClock,
                "the video's time stamps are assumed to be on the tables' clock (start_s in dataset.toml shifts them)",
            ),
            (
                TimesWarning::OtherCount {
                    list: "global_pose/frame_times",
                    times: 1,
                    video: "video.hevc",
                    frames: 12,
                },
                "global_pose/frame_times has 1 time, video.hevc 12 frames: using the first 1",
            ),
            (
                unstamped(1),
                "/imu: 1 message has no time in its header; using the time of recording, which is later by the transport delay",
            ),
            (
                unstamped(25),
                "/imu: 25 messages have no time in their headers; using the time of recording, which is later by the transport delay",
            ),
        ] {
            assert_eq!(warning.to_string(), expected);
        }
    }
}
