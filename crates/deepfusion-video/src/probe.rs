//! What ffprobe reports about a video, without decoding it.

use crate::program::run;
use crate::{AnswerProblem, Error, ProgramTask, Result};
use jiff::{SignedDuration, Timestamp};
use serde::Deserialize;
use std::ops::RangeInclusive;
use std::path::Path;

/// Seconds since 1970 from 2000 to 2100: a recorder that writes another date has no clock.
const RECORDED_S: RangeInclusive<i64> = 946_684_800..=4_102_444_800;

/// A video's frames before they are decoded.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Probed {
    /// Width and height as shown, with the recorder's rotation applied and pixels made square.
    pub(crate) size: (u32, u32),
    /// Whether its pixels are square as they are stored.
    pub(crate) square: bool,
    /// Number of frames.
    pub(crate) frames: usize,
    /// The frames' times in order, in nanoseconds; `None` if the file has none.
    pub(crate) times_ns: Option<Vec<i64>>,
    /// The video's creation time according to the recorder, in nanoseconds since 1970: some recorders write that of the first frame, others
    /// that of the last.
    pub(crate) created_ns: Option<i64>,
}

#[derive(Debug, Deserialize)]
struct ProbeAnswer {
    #[serde(default)]
    packets: Vec<Packet>,
    #[serde(default)]
    streams: Vec<StreamAnswer>,
    #[serde(default)]
    format: FormatAnswer,
}

#[derive(Debug, Default, Deserialize)]
struct FormatAnswer {
    #[serde(default)]
    tags: Tags,
}

#[derive(Debug, Default, Deserialize)]
struct Tags {
    creation_time: Option<String>,
}

#[derive(Debug, Deserialize)]
struct Packet {
    pts_time: Option<String>,
    #[serde(default)]
    flags: String,
}

#[derive(Debug, Deserialize)]
struct StreamAnswer {
    width: Option<u32>,
    height: Option<u32>,
    sample_aspect_ratio: Option<String>,
    #[serde(default)]
    side_data_list: Vec<SideData>,
}

#[derive(Debug, Deserialize)]
struct SideData {
    rotation: Option<f64>,
}

/// Examines the first video stream. Its packets are listed rather than its frames: that needs no decoding,
/// and each packet is a frame.
pub(crate) fn probe(file: &Path) -> Result<Probed> {
    let entries = "packet=pts_time,flags:stream=width,height,sample_aspect_ratio:stream_side_data=rotation:format_tags=creation_time";
    let arguments = [
        "-v",
        "error",
        "-select_streams",
        "v:0",
        "-show_entries",
        entries,
        "-of",
        "json",
    ];
    let mut arguments: Vec<&std::ffi::OsStr> = arguments.iter().map(|a| a.as_ref()).collect();
    arguments.push(file.as_os_str());
    let folder = file.parent().unwrap_or(Path::new("."));
    parse(&run(
        "ffprobe",
        &arguments,
        (file, ProgramTask::Read),
        folder,
    )?)
    .map_err(|problem| Error::Program {
        path: file.to_owned(),
        program: "ffprobe",
        problem: problem.into(),
    })
}

fn parse(json: &[u8]) -> std::result::Result<Probed, AnswerProblem> {
    let answer: ProbeAnswer = serde_json::from_slice(json)?;
    let stream = answer.streams.first();
    let stream = stream.ok_or(AnswerProblem::NoStream)?;
    let (Some(width), Some(height)) = (stream.width, stream.height) else {
        return Err(AnswerProblem::NoSize);
    };
    let stretch = stretch(stream.sample_aspect_ratio.as_deref());
    let wide = (f64::from(width) * stretch).round() as u32;
    let mut rotations = stream.side_data_list.iter().filter_map(|s| s.rotation);
    let upright = rotations
        .next_back()
        .is_none_or(|r| (r / 90.0).round() % 2.0 == 0.0);
    // `D`: removed by the file's edit list, not shown and not decoded into a frame.
    let shown: Vec<&Packet> = answer
        .packets
        .iter()
        .filter(|p| !p.flags.contains('D'))
        .collect();
    if shown.is_empty() {
        return Err(AnswerProblem::NoFrame);
    }
    let times = shown.iter().map(|p| nanoseconds(p.pts_time.as_ref()?));
    let mut times_ns: Option<Vec<i64>> = times.collect();
    if let Some(times) = &mut times_ns {
        // Packets come in the order of decoding.
        times.sort_unstable();
    }
    let distinct = times_ns.filter(|t| t.windows(2).all(|w| w[0] < w[1]));
    Ok(Probed {
        size: if upright {
            (wide, height)
        } else {
            (height, wide)
        },
        square: wide == width,
        frames: shown.len(),
        times_ns: distinct,
        created_ns: created(answer.format.tags.creation_time.as_deref()),
    })
}

/// Ratio of a pixel's width to its height: videos for television were stored narrower than shown. A difference below one percent is
/// a rounding of the recorder's.
fn stretch(aspect: Option<&str>) -> f64 {
    let ratio = aspect.and_then(|text| {
        let (x, y) = text.split_once(':')?;
        Some(x.parse::<f64>().ok()? / y.parse::<f64>().ok()?)
    });
    let ratio = ratio.filter(|ratio| (0.1..=10.0).contains(ratio));
    ratio
        .filter(|ratio| (ratio - 1.0).abs() > 0.01)
        .unwrap_or(1.0)
}

/// Decimal seconds, exact to the last digit.
fn nanoseconds(seconds: &str) -> Option<i64> {
    let time: SignedDuration = format!("{seconds}s").parse().ok()?;
    i64::try_from(time.as_nanos()).ok()
}

/// A date with its zone; recorders without a clock write 1904 or 1970, which is not a date.
fn created(word: Option<&str>) -> Option<i64> {
    let stamp: Timestamp = word?.parse().ok()?;
    let known = RECORDED_S.contains(&stamp.as_second());
    known.then(|| i64::try_from(stamp.as_nanosecond()).ok())?
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn packets_become_frames_in_order_of_time() {
        let json = br#"{"packets": [
            {"pts_time": "0.080000", "flags": "K__"}, {"pts_time": "0.200000", "flags": "___"},
            {"pts_time": "0.120000", "flags": "___"}, {"pts_time": "-0.040000", "flags": "_D_"}],
            "streams": [{"width": 64, "height": 48}]}"#;
        let probed = parse(json).unwrap();
        assert_eq!((probed.size, probed.frames), ((64, 48), 3));
        assert_eq!(
            probed.times_ns.unwrap(),
            [80_000_000, 120_000_000, 200_000_000]
        );
    }

    #[test]
    fn rotated_videos_are_as_wide_as_they_look() {
        let json = br#"{"packets": [{"flags": "K__"}],
            "streams": [{"width": 64, "height": 48, "side_data_list": [{"rotation": -90}]}]}"#;
        let probed = parse(json).unwrap();
        assert_eq!((probed.size, probed.times_ns), ((48, 64), None));
    }

    #[test]
    fn non_square_pixels_are_made_square() {
        for (aspect, size, square) in [
            ("4:3", (1920, 1080), false),
            ("1:1", (1440, 1080), true),
            ("0:1", (1440, 1080), true),
            ("N/A", (1440, 1080), true),
            ("12160:12153", (1440, 1080), true),
        ] {
            let json = format!(
                r#"{{"packets": [{{"flags": "K__"}}],
                "streams": [{{"width": 1440, "height": 1080, "sample_aspect_ratio": "{aspect}"}}]}}"#
            );
            let probed = parse(json.as_bytes()).unwrap();
            assert_eq!((probed.size, probed.square), (size, square), "{aspect}");
        }
    }

    #[test]
    fn files_that_are_not_videos_are_errors() {
        for (json, problem) in [
            ("{}", "no video stream"),
            (r#"{"streams": [{}]}"#, "images' size"),
            (r#"{"streams": [{"width": 1, "height": 1}]}"#, "no frame"),
            ("x", "cannot be read"),
        ] {
            let text = parse(json.as_bytes()).unwrap_err().to_string();
            assert!(text.contains(problem), "{text}");
        }
    }

    proptest! {
        #[test]
        fn garbage_never_panics(text in ".{0,80}") {
            let _ = parse(text.as_bytes());
        }
    }
}
