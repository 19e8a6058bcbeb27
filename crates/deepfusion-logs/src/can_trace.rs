//! CAN frames, as text (`candump -l` and `candump -L`, Vector's ASC) or binary ([`blf`]). A DBC file describes what they contain.

use crate::blf;
use crate::error::{BadLine, Error, Result};
use crate::log::{Clock, DriveLog, Format, ReadOptions, Speed};
use crate::note::{CanNote, LogNote};
use crate::problem::{CanFrameProblem, SignalProblem, SpeedProblem};
use crate::rows::{enough, text_of};
use crate::units::SpeedUnit;
use deepfusion_motion::can::{CanId, Dbc};
use std::io::Read;
use std::path::Path;

/// Result of reading a part of a frame.
type Parsed<T> = std::result::Result<T, CanFrameProblem>;

/// A frame of a trace.
struct Frame {
    ns: i64,
    /// The bus, as the trace names it.
    channel: String,
    id: CanId,
    data: Vec<u8>,
}

/// Whether a line is one of candump's log: `(1436509052.249713) can0 1A2#DEADBEEF`.
pub(crate) fn is_candump(line: &str) -> bool {
    candump(line).is_some_and(|frame| frame.is_ok())
}

/// The signal over the trace.
pub(crate) fn read(path: &Path, options: &ReadOptions) -> Result<DriveLog> {
    let missing = |problem| Error::Signal {
        path: path.to_owned(),
        problem,
    };
    let dbc = options
        .dbc
        .as_deref()
        .ok_or_else(|| missing(SignalProblem::NoDbc))?;
    let dbc = Dbc::open(dbc)?;
    let name = options.speed.as_deref().ok_or_else(|| {
        let candidates = dbc
            .names()
            .filter(|n| n.to_lowercase().contains("speed"))
            .take(12)
            .collect();
        missing(SignalProblem::NoName { candidates })
    })?;
    let signal = dbc.signal(name)?;
    let written = dbc.unit(name).unwrap_or("");
    let unit = written
        .parse::<SpeedUnit>()
        .ok()
        .or(options.unit)
        .ok_or_else(|| {
            missing(SignalProblem::Unit {
                signal: name.to_owned(),
                unit: written.to_owned(),
            })
        })?;
    let Trace {
        mut frames,
        all,
        clock,
    } = trace(path, signal.id)?;
    let several = one_channel(&mut frames);
    let (mut speeds, mut of_signal, mut repeated) = (Vec::<Speed>::new(), 0, 0);
    for frame in &frames {
        let Some(value) = signal.decode(&frame.data) else {
            continue;
        };
        of_signal += 1;
        if speeds.last().is_some_and(|last| frame.ns <= last.ns) {
            repeated += 1;
            continue;
        }
        speeds.push(Speed {
            ns: frame.ns,
            mps: value * unit.mps(),
            sigma_mps: None,
        });
    }
    if of_signal == 0 {
        return Err(Error::NoSpeed {
            path: path.to_owned(),
            problem: SpeedProblem::NoFrame {
                frames: all,
                signal: name.to_owned(),
            },
        });
    }
    let beyond = signal.keep_measured(&mut speeds, |speed| speed.mps / unit.mps());
    enough(path, &speeds)?;
    let read = CanNote::Signal {
        signal: name.to_owned(),
        unit,
        speeds: speeds.len(),
        frames: all,
    };
    let left_out = (repeated > 0).then_some(CanNote::NotLater { frames: repeated });
    let beyond = (beyond > 0).then_some(CanNote::BeyondRange { frames: beyond });
    let notes = [Some(read), several, left_out, beyond];
    Ok(DriveLog {
        format: Format::CanTrace,
        clock,
        speeds,
        yaw_rates: Vec::new(),
        course_rates: Vec::new(),
        notes: notes.into_iter().flatten().map(LogNote::from).collect(),
    })
}

/// Keeps the frames of one bus, the one with the most: a gateway repeats a message on another bus, later. Adds a note if there are several.
fn one_channel(frames: &mut Vec<Frame>) -> Option<CanNote> {
    let mut counts: Vec<(String, usize)> = Vec::new();
    for frame in frames.iter() {
        match counts.iter_mut().find(|(name, _)| *name == frame.channel) {
            Some((_, count)) => *count += 1,
            None => counts.push((frame.channel.clone(), 1)),
        }
    }
    if counts.len() < 2 {
        return None;
    }
    let channels = counts.clone();
    // The first of those with equally many.
    counts.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    let (read, _) = counts.swap_remove(0);
    frames.retain(|frame| frame.channel == read);
    Some(CanNote::Channels { channels, read })
}

/// The part of a trace that is used.
struct Trace {
    /// The frames of one identifier.
    frames: Vec<Frame>,
    /// How many frames with data there are, of any identifier.
    all: usize,
    clock: Clock,
}

/// The frames of one identifier.
fn trace(path: &Path, id: CanId) -> Result<Trace> {
    if !is_blf(path)? {
        return of_text(path, &text_of(path)?, id);
    }
    let (mut frames, mut all) = (Vec::new(), 0);
    let start_ns = blf::read(path, |frame| {
        all += 1;
        if frame.id == id {
            frames.push(Frame {
                ns: frame.ns,
                channel: frame.channel.to_string(),
                id,
                data: frame.data.to_vec(),
            });
        }
    })?;
    for frame in &mut frames {
        frame.ns = frame.ns.saturating_add(start_ns.unwrap_or(0));
    }
    Ok(Trace {
        frames,
        all,
        clock: start_ns.map_or(Clock::Free, |_| Clock::LocalDate),
    })
}

/// Whether a file has the name or the first bytes of a Vector binary log.
pub(crate) fn is_blf(path: &Path) -> Result<bool> {
    if path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("blf"))
    {
        return Ok(true);
    }
    let file = std::fs::File::open(path).map_err(|e| Error::file(path, e))?;
    let mut first = Vec::new();
    file.take(blf::MARK.len() as u64)
        .read_to_end(&mut first)
        .map_err(|e| Error::file(path, e))?;
    Ok(first == blf::MARK)
}

/// The frames of one identifier of a text. Others are counted but not kept, as a trace of hours has hundreds of millions.
fn of_text(path: &Path, text: &str, id: CanId) -> Result<Trace> {
    let is_asc = text.lines().take(200).any(|l| {
        let l = l.trim().to_ascii_lowercase();
        l.starts_with("base hex")
            || l.starts_with("base dec")
            || l.starts_with("begin triggerblock")
    });
    let (mut frames, mut all, mut first_ns) = (Vec::new(), 0, None);
    let mut header = AscHeader::default();
    for (index, line) in text.lines().enumerate() {
        let parsed = if is_asc {
            header.read(line);
            asc(line, header.decimal).map(|parsed| {
                let frame = parsed?;
                Ok(Frame {
                    ns: frame.ns.saturating_add(header.begin_ns),
                    ..frame
                })
            })
        } else {
            candump(line)
        };
        match parsed {
            None => {}
            Some(Ok(frame)) => {
                all += 1;
                first_ns.get_or_insert(frame.ns);
                if frame.id == id {
                    frames.push(frame);
                }
            }
            Some(Err(problem)) => {
                return Err(BadLine::new(index as u64 + 1, "frame", problem).of(path));
            }
        }
    }
    let is_date = first_ns.is_some_and(|ns| ns > 946_000_000_000_000_000);
    Ok(Trace {
        frames,
        all,
        clock: if is_date { Clock::Date } else { Clock::Free },
    })
}

/// SocketCAN's bit of an identifier that marks a report of an error (`CAN_ERR_FLAG` of linux/can.h).
const CAN_ERROR: u32 = 0x2000_0000;

/// Settings in the first lines of Vector's text: `base hex  timestamps absolute`. With `relative`, each line's time counts from the line
/// before it, whatever that line contains.
#[derive(Default)]
struct AscHeader {
    decimal: bool,
    relative: bool,
    /// The time from which a line's time counts.
    begin_ns: i64,
    /// Time of the line before, on that clock.
    before_ns: i64,
}

impl AscHeader {
    fn read(&mut self, line: &str) {
        let words = line.to_ascii_lowercase();
        let mut words = words.split_whitespace();
        let Some(first) = words.next() else { return };
        if first == "base" {
            let rest: Vec<&str> = words.collect();
            self.decimal = rest.first() == Some(&"dec");
            self.relative = rest.ends_with(&["timestamps", "relative"]);
        } else if self.relative
            && first.starts_with(|c: char| c.is_ascii_digit())
            && let Ok(ns) = seconds(first)
        {
            self.begin_ns = self.before_ns;
            self.before_ns = self.begin_ns.saturating_add(ns);
        }
    }
}

/// `None` for a line without a frame, such as an empty one, or for a frame without data.
fn candump(line: &str) -> Option<Parsed<Frame>> {
    let rest = line.trim().strip_prefix('(')?;
    let (time, rest) = rest.split_once(')')?;
    let mut words = rest.split_whitespace();
    let (channel, frame) = (words.next()?, words.next()?);
    let (id, data) = frame.split_once('#')?;
    // A remote request has no data; `##` and a digit of flags is CAN FD.
    let data = match data.strip_prefix('#') {
        Some(fd) => fd.get(1..)?,
        None if data.starts_with(['R', 'r']) => return None,
        None => data,
    };
    let number = u32::from_str_radix(id, 16);
    // The controller's report of an error, not a frame on the bus.
    if number.as_ref().is_ok_and(|number| number & CAN_ERROR != 0) {
        return None;
    }
    let parsed = || {
        let ns = seconds(time)?;
        let number = number.map_err(|_| CanFrameProblem::Identifier(id.to_owned()))?;
        // The tool writes 3 digits of a standard identifier, 8 of an extended one.
        let id = can_id(number, id.len() > 3)?;
        Ok(Frame {
            ns,
            channel: channel.to_owned(),
            id,
            data: hex(data)?,
        })
    };
    Some(parsed())
}

/// `   0.012345 1  1A2x  Rx   d 8 00 01 …`: time, channel, identifier (x: extended), direction, `d`, length, data; CAN FD differs.
fn asc(line: &str, decimal: bool) -> Option<Parsed<Frame>> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let time = *words.first()?;
    if !time.starts_with(|c: char| c.is_ascii_digit()) {
        return None;
    }
    let radix = if decimal { 10 } else { 16 };
    let (channel, id, length, data) = if words.get(1) == Some(&"CANFD") {
        // CANFD channel direction identifier [name] brs esi dlc length data…
        let named = words.get(5)?.parse::<u8>().is_err() || words.get(5)?.len() > 1;
        let shift = usize::from(named);
        (
            *words.get(2)?,
            *words.get(4)?,
            words.get(8 + shift)?.parse::<usize>().ok()?,
            words.get(9 + shift..)?,
        )
    } else {
        if !matches!(words.get(3), Some(&("Rx" | "Tx"))) || words.get(4) != Some(&"d") {
            return None;
        }
        let length = usize::from_str_radix(words.get(5)?, radix).ok()?;
        (*words.get(1)?, *words.get(2)?, length, words.get(6..)?)
    };
    let parsed = || {
        let (digits, extended) = match id.strip_suffix(['x', 'X']) {
            Some(digits) => (digits, true),
            None => (id, false),
        };
        let number = u32::from_str_radix(digits, radix)
            .map_err(|_| CanFrameProblem::Identifier(id.to_owned()))?;
        let bytes = data.get(..length).ok_or(CanFrameProblem::Length {
            bytes: data.len(),
            length,
        })?;
        let byte = |word: &&str| {
            u8::from_str_radix(word, radix).map_err(|_| CanFrameProblem::Byte((*word).to_owned()))
        };
        Ok(Frame {
            ns: seconds(time)?,
            channel: channel.to_owned(),
            id: can_id(number, extended)?,
            data: bytes.iter().map(byte).collect::<Parsed<_>>()?,
        })
    };
    Some(parsed())
}

fn can_id(number: u32, extended: bool) -> Parsed<CanId> {
    match (extended, u16::try_from(number)) {
        (true, _) => Ok(CanId::Extended {
            extended: number & 0x1fff_ffff,
        }),
        (false, Ok(standard)) if standard < 0x800 => Ok(CanId::Standard(standard)),
        _ => Err(CanFrameProblem::LongIdentifier(number)),
    }
}

fn seconds(word: &str) -> Parsed<i64> {
    let style = crate::dates::TimeStyle::Number(1_000_000_000);
    crate::dates::nanoseconds(word, style, None)
        .ok_or_else(|| CanFrameProblem::Time(word.to_owned()))
}

fn hex(digits: &str) -> Parsed<Vec<u8>> {
    let bad = || CanFrameProblem::Bytes(digits.to_owned());
    if !digits.is_ascii() || !digits.len().is_multiple_of(2) {
        return Err(bad());
    }
    let byte = |at: usize| u8::from_str_radix(&digits[at..at + 2], 16).map_err(|_| bad());
    (0..digits.len()).step_by(2).map(byte).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn frames_of_both_kinds() {
        let frame = candump("(1436509052.249713) vcan0 123#0102FF")
            .unwrap()
            .unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(
            (frame.ns, frame.id, frame.data),
            (
                1_436_509_052_249_713_000,
                CanId::Standard(0x123),
                vec![1, 2, 255]
            )
        );
        let frame = candump("(0.5) can0 18FEF100#AA")
            .unwrap()
            .unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(
            frame.id,
            CanId::Extended {
                extended: 0x18FE_F100
            }
        );
        let frame = candump("(0.5) can0 123##1AABB")
            .unwrap()
            .unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(frame.data, [0xaa, 0xbb]);
        assert!(candump("(0.5) can0 123#R").is_none());
        assert!(candump("(0.5) can0 123#A").unwrap().is_err());
        let frame = asc(
            "   0.500000 1  18FEF100x       Rx   d 2 01 FF  Length = 0",
            false,
        )
        .unwrap();
        let frame = frame.unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(
            (frame.ns, frame.id, frame.data),
            (
                500_000_000,
                CanId::Extended {
                    extended: 0x18FE_F100
                },
                vec![1, 255]
            )
        );
        assert!(asc("   0.5 1  123 Rx d 8 01 02", false).unwrap().is_err());
        assert!(asc("// a comment", false).is_none());
    }

    #[test]
    fn an_error_report_is_not_a_frame() {
        assert!(candump("(1.0) can0 20000004#0000000000000000").is_none());
        assert!(candump("(1.0) can0 00000004#0000000000000000").is_some());
    }

    /// Each line counts from the one before it, even from one without a frame.
    #[test]
    fn relative_times_are_added_up() {
        let lines =
            "   0.010 1  1A0 Rx d 1 00\n   0.020 CAN 1 Status: active\n   0.030 1  1A0 Rx d 1 00\n";
        for (times, expected) in [("absolute", [10, 30]), ("relative", [10, 60])] {
            let text =
                format!("date Mon Nov 2 10:00:00 2026\nbase hex  timestamps {times}\n{lines}");
            let id = CanId::Standard(0x1A0);
            let trace = of_text(Path::new("a.asc"), &text, id).unwrap();
            let ms: Vec<i64> = trace.frames.iter().map(|f| f.ns / 1_000_000).collect();
            assert_eq!(ms, expected, "{times}");
        }
    }

    /// Other identifiers' frames are counted but not kept, and the very first frame decides the clock.
    #[test]
    fn frames_of_one_identifier_are_kept() {
        let text = "(1436509052.2) can0 123#01\n(1.5) can0 124#02\n(1.6) can0 123#03\n";
        let trace = of_text(Path::new("a.log"), text, CanId::Standard(0x124)).unwrap();
        let data: Vec<&[u8]> = trace.frames.iter().map(|f| &f.data[..]).collect();
        assert_eq!(data, [&[2_u8][..]]);
        assert_eq!((trace.all, trace.clock), (3, Clock::Date));
    }

    #[test]
    fn one_of_two_buses_is_read() {
        let frame = |ns: i64, channel: &str| Frame {
            ns,
            channel: channel.into(),
            id: CanId::Standard(1),
            data: Vec::new(),
        };
        let mut one = vec![frame(0, "can0"), frame(1, "can0")];
        assert_eq!(one_channel(&mut one), None);
        let mut two = vec![frame(0, "can1"), frame(1, "can0"), frame(2, "can0")];
        let note = one_channel(&mut two).unwrap();
        assert_eq!(
            note,
            CanNote::Channels {
                channels: vec![("can1".into(), 1), ("can0".into(), 2)],
                read: "can0".into(),
            }
        );
        assert_eq!(two.iter().map(|f| f.ns).collect::<Vec<_>>(), [1, 2]);
        // A gateway's copies: the bus on which a frame was first is read.
        let mut gateway = vec![frame(0, "2"), frame(1, "1"), frame(2, "2"), frame(3, "1")];
        one_channel(&mut gateway);
        assert_eq!(gateway.iter().map(|f| f.ns).collect::<Vec<_>>(), [0, 2]);
    }

    proptest! {
        #[test]
        fn garbage_never_panics(text in ".{0,60}") {
            let _ = candump(&text);
            let _ = candump(&format!("(0.1) can0 {text}"));
            let _ = asc(&text, false);
            let _ = asc(&format!("0.1 CANFD {text}"), true);
        }
    }
}
