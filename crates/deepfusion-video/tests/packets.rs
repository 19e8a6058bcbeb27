//! A long stream of packets, decoded part by part, compared with ffmpeg's output for one file.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]

use deepfusion_video::{Codec, Error, PacketFrames, PacketStream};
use std::fs;
use std::path::Path;
use std::process::Command;

/// More than twice as many as are decoded together.
const FRAMES: usize = 610;

fn ffmpeg(folder: &Path, arguments: &str) -> bool {
    let status = Command::new("ffmpeg")
        .current_dir(folder)
        .args(["-v", "error"])
        .args(arguments.split(' '))
        .status();
    status.is_ok_and(|status| status.success())
}

/// The packets of a stream of 25 Hz with a key frame each 20 frames.
fn stream(folder: &Path) -> Option<Vec<Vec<u8>>> {
    stream_of(folder, FRAMES, 25, 20)
}

/// The packets, separated at the unit that x264 puts before each; `None` if ffmpeg has no x264.
fn stream_of(folder: &Path, frames: usize, rate: u32, group: u32) -> Option<Vec<Vec<u8>>> {
    let source = format!("-f lavfi -i testsrc2=size=64x48:rate={rate} -frames:v {frames}");
    let encoder =
        format!("-pix_fmt yuv420p -c:v libx264 -qp 20 -bf 0 -g {group} -x264-params aud=1 s.h264");
    if !ffmpeg(folder, &format!("{source} {encoder}")) {
        eprintln!("skipped: no ffmpeg with libx264");
        return None;
    }
    let bytes = fs::read(folder.join("s.h264")).unwrap();
    let starts = bytes.windows(5).enumerate();
    let starts = starts.filter(|(_, w)| **w == [0, 0, 0, 1, 9]);
    let mut starts: Vec<usize> = starts.map(|(at, _)| at).collect();
    starts.push(bytes.len());
    let packets = starts.windows(2).map(|w| bytes[w[0]..w[1]].to_vec());
    Some(packets.collect())
}

fn frames(folder: &Path, cache: &str, count: usize) -> PacketFrames {
    let stream = PacketStream {
        file: folder.join("s.h264"),
        name: "/camera".into(),
        codec: Codec::H264,
        before: 7,
        count,
    };
    PacketFrames::new(stream, &folder.join(cache)).unwrap()
}

#[test]
fn batches_equal_the_whole_stream() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let Some(packets) = stream(at) else { return };
    assert_eq!(packets.len(), FRAMES);
    let kept = frames(at, "kept", FRAMES);
    let all = || Ok::<_, Error>(packets.iter().cloned().map(Ok));
    let last = kept.frame(FRAMES as u64 - 1, all).unwrap();
    assert_eq!(last, at.join("kept/0000000609.jpg"));
    // The frames and their description; the temporary files are gone.
    assert_eq!(fs::read_dir(at.join("kept")).unwrap().count(), FRAMES + 1);
    fs::create_dir(at.join("whole")).unwrap();
    assert!(ffmpeg(
        at,
        "-i s.h264 -q:v 2 -start_number 0 whole/%010d.jpg"
    ));
    for n in 0..FRAMES as u64 {
        let file = kept.frame(n, all).unwrap();
        let same = at.join("whole").join(file.file_name().unwrap());
        assert!(fs::read(&file).unwrap() == fs::read(same).unwrap(), "{n}");
    }
    // The frames are kept from then on: no packet is requested.
    let again = frames(at, "kept", FRAMES);
    let never = || -> Result<std::iter::Empty<Result<Vec<u8>, Error>>, Error> { unreachable!() };
    assert_eq!(
        again.frame(3, never).unwrap(),
        at.join("kept/0000000003.jpg")
    );
}

/// ffmpeg guesses a stream's rate from the stream itself if there are few packets: pictures must not be named by that guess.
#[test]
fn a_stream_of_any_rate_may_end_with_a_few_packets() {
    for (rate, count) in [(5, 3), (10, 1), (10, 253), (15, 259), (50, 252)] {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        // A part ends at the 250th packet: the next is a key frame.
        let Some(packets) = stream_of(at, count, rate, 25) else {
            return;
        };
        let kept = frames(at, "kept", count);
        let all = || Ok::<_, Error>(packets.iter().cloned().map(Ok));
        let last = kept.frame(count as u64 - 1, all).unwrap();
        assert!(last.is_file(), "{rate} Hz, {count} packets");
    }
}

/// A folder that is not a complete cache is refused before anything is decoded.
#[test]
fn other_files_are_refused_before_decoding() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("kept")).unwrap();
    fs::write(folder.path().join("kept/notes.txt"), "mine").unwrap();
    fs::write(folder.path().join("s.h264"), "x").unwrap();
    let kept = frames(folder.path(), "kept", 1);
    let never = || -> Result<std::iter::Empty<Result<Vec<u8>, Error>>, Error> { unreachable!() };
    let text = kept.frame(0, never).unwrap_err().to_string();
    assert!(text.contains("the folder has other files"), "{text}");
    assert!(folder.path().join("kept/notes.txt").is_file());
}

#[test]
fn the_damaged_message_is_named_in_any_batch() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let Some(packets) = stream(at) else { return };
    for wrong in [3, 333, FRAMES - 1] {
        let mut packets = packets.clone();
        let length = packets[wrong].len();
        packets[wrong].truncate(length / 2);
        let kept = frames(at, "kept", FRAMES);
        let error = kept.frame(0, || Ok::<_, Error>(packets.iter().cloned().map(Ok)));
        match error.unwrap_err() {
            // Seven messages came before the first key frame.
            Error::Packet { number, .. } => assert_eq!(number, 7 + wrong as u64),
            other => panic!("{other}"),
        }
    }
    // A recording that is shorter than it was.
    let kept = frames(at, "kept", FRAMES + 1);
    let error = kept.frame(0, || Ok::<_, Error>(packets.iter().cloned().map(Ok)));
    let text = error.unwrap_err().to_string();
    assert!(
        text.contains("message 617: ") && text.contains("611 packets"),
        "{text}"
    );
    // No temporary files of any of them are left.
    let left = fs::read_dir(at).unwrap().map(|e| e.unwrap().file_name());
    assert_eq!(left.collect::<Vec<_>>(), ["s.h264"]);
}
