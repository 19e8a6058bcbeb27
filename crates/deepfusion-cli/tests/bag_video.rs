//! Bags whose camera is a video stream: a simulated drive's images, encoded by the installed ffmpeg, as messages of each type.
//!
//! The decoded images are compared with those that were encoded, after two lossy codecs: x264 at a quantiser of 12, then
//! JPEGs of ffmpeg's second best quality, both with subsampled colours. On these 96×64 pixels the worst PSNR is above 30 dB, with
//! some margin. A neighbouring image of the drive is several dB lower.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::support::{fails, json, ok};
use deepfusion_data::{Dataset, OpenOptions, RgbImage};
use deepfusion_hint::Hint;
use deepfusion_rosbag::msg::{
    CompressedImage, CompressedVideo, FfmpegPacket, Header, OldFfmpegPacket,
};
use deepfusion_rosbag::{Bag, BagWriter, RosMessage, Selection, WriterOptions};
use deepfusion_video::frames_folder;

const FRAMES: usize = 24;
/// Packets from one key frame to the next.
const KEYS: usize = 8;
const LEAST_DB: f64 = 30.0;
const IMAGES: &str = "/camera/image_rect/compressed";

/// The kinds of messages.
#[derive(Debug, Clone, Copy)]
enum Kind {
    Video,
    Packet,
    OldPacket,
    Image,
}

/// A simulated drive, and its pictures.
struct Drive {
    folder: tempfile::TempDir,
    pictures: Vec<RgbImage>,
    times_s: Vec<Option<f64>>,
}

impl Drive {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        ok(
            at,
            &format!("simulate --out sim --format bag --frames {FRAMES} --size 96x64"),
        );
        let drive = open(&at.join("sim/urban_0001.bag")).unwrap();
        let pictures = (0..FRAMES).map(|n| drive.load_image(n).unwrap());
        let pictures: Vec<RgbImage> = pictures.collect();
        for (n, picture) in pictures.iter().enumerate() {
            picture.save(at.join(format!("{n:03}.png"))).unwrap();
        }
        Self {
            pictures,
            times_s: drive.frames().iter().map(|f| f.time_s).collect(),
            folder,
        }
    }

    fn at(&self) -> &Path {
        self.folder.path()
    }

    /// The pictures as packets, one each; `None`, with a message, if the installed ffmpeg lacks this encoder.
    fn encode(&self, encoder: &str, extra: &[&str]) -> Option<Vec<Vec<u8>>> {
        let (file, common): (_, &[&str]) = match encoder {
            // A delimiter before every picture, which separates the packets.
            "libx264" => (
                "s.h264",
                &["-qp", "12", "-bf", "0", "-x264-params", "aud=1"],
            ),
            "libx265" => (
                "s.hevc",
                &[
                    "-x265-params",
                    "aud=1:bframes=0:qp=12:keyint=8:repeat-headers=1:log-level=none",
                ],
            ),
            "libvpx-vp9" => (
                "s.ivf",
                &[
                    "-crf",
                    "8",
                    "-b:v",
                    "0",
                    "-auto-alt-ref",
                    "0",
                    "-lag-in-frames",
                    "0",
                ],
            ),
            _ => (
                "s.ivf",
                &[
                    "-crf",
                    "8",
                    "-usage",
                    "realtime",
                    "-cpu-used",
                    "8",
                    "-lag-in-frames",
                    "0",
                ],
            ),
        };
        let made = Command::new("ffmpeg")
            .current_dir(self.at())
            .args(["-v", "error", "-y", "-framerate", "25", "-i", "%03d.png"])
            .args(["-pix_fmt", "yuv420p", "-c:v", encoder])
            .args(["-g", &KEYS.to_string()])
            .args(common)
            .args(extra)
            .arg(file)
            .stderr(Stdio::null())
            .status();
        if !made.is_ok_and(|status| status.success()) {
            eprintln!("skipped: there is no ffmpeg with {encoder}");
            return None;
        }
        let bytes = fs::read(self.at().join(file)).unwrap();
        let packets = match encoder {
            "libx264" => annex_b(&bytes, |head| head & 31 == 9),
            "libx265" => annex_b(&bytes, |head| (head >> 1) & 63 == 35),
            _ => ivf(&bytes),
        };
        assert_eq!(packets.len(), FRAMES, "{encoder}");
        Some(packets)
    }

    /// The drive's bag with packets in place of its pictures; `None` is a lost message.
    fn bag(&self, name: &str, kind: Kind, format: &str, packets: &[Option<Vec<u8>>]) -> PathBuf {
        let source = Bag::open(self.at().join("sim/urban_0001.bag")).unwrap();
        let path = self.at().join(name);
        let mut writer = BagWriter::create(&path, WriterOptions::default()).unwrap();
        let mut others = BTreeMap::new();
        let mut camera = None;
        let mut packets = packets.iter();
        for message in source.messages(Selection::all()).unwrap() {
            let message = message.unwrap();
            if message.topic() == IMAGES {
                let image: CompressedImage<'_> = message.decode().unwrap();
                if let Some(packet) = packets.next().unwrap() {
                    let written = kind.message(image.header, format, packet);
                    let camera = *camera.get_or_insert_with(|| {
                        let (kind, md5, definition) = written.0;
                        let topic = "/camera/image_rect/ffmpeg";
                        writer
                            .add_raw_connection(topic, kind, md5, definition)
                            .unwrap()
                    });
                    writer
                        .write_raw(camera, message.time(), &written.1)
                        .unwrap();
                }
                continue;
            }
            let c = message.connection();
            let other = *others.entry(c.id).or_insert_with(|| {
                writer
                    .add_raw_connection(&c.topic, &c.type_name, &c.md5, &c.definition)
                    .unwrap()
            });
            writer
                .write_raw(other, message.time(), message.data())
                .unwrap();
        }
        writer.finish().unwrap();
        path
    }

    /// Asserts that every frame has the right picture and time: the bag's frames are the pictures from the `first` on.
    fn assert_frames(&self, bag: &Path, first: usize) {
        let drive = open(bag).unwrap();
        assert_eq!(drive.frames().len(), FRAMES - first);
        // In any order, as training reads them.
        for n in (first..FRAMES).rev() {
            let frame = &drive.frames()[n - first];
            // The data set's clock begins with its first image.
            let time_s = frame.time_s.unwrap() + self.times_s[first].unwrap();
            assert!((time_s - self.times_s[n].unwrap()).abs() < 1e-6, "{n}");
            let image = drive.load_image(n - first).unwrap();
            let own = psnr(&image, &self.pictures[n]);
            assert!(own > LEAST_DB, "{}, {n}: {own} dB", bag.display());
            for other in [n.wrapping_sub(1), n + 1] {
                if let Some(other) = self.pictures.get(other) {
                    assert!(own > psnr(&image, other) + 2.0, "{n}: {own} dB");
                }
            }
        }
    }

    /// The error when an image is read.
    fn refused(&self, bag: &Path) -> String {
        let error = open(bag).and_then(|d| d.load_image(0)).unwrap_err();
        let left = fs::read_dir(self.at()).unwrap();
        let left = left.map(|e| e.unwrap().file_name().into_string().unwrap());
        assert_eq!(left.filter(|name| name.contains(".frames")).count(), 0);
        format!("{error} {}", error.hint().unwrap())
    }
}

impl Kind {
    /// Type, MD5, definition and bytes of a message.
    fn message<'t>(
        self,
        header: Header,
        format: &str,
        packet: &[u8],
    ) -> ((&'t str, &'t str, &'t str), Vec<u8>) {
        fn of<'a, 't, M: RosMessage<'a>>(message: &M) -> ((&'t str, &'t str, &'t str), Vec<u8>) {
            let mut bytes = Vec::new();
            message.encode(&mut bytes);
            ((M::TYPE, M::MD5, M::DEFINITION), bytes)
        }
        let (data, format) = (Cow::Borrowed(packet), format.to_owned());
        match self {
            Self::Video => of(&CompressedVideo {
                timestamp: header.stamp,
                frame_id: header.frame_id,
                data,
                format,
            }),
            Self::Packet => of(&FfmpegPacket {
                header,
                width: 96,
                height: 64,
                encoding: format,
                pts: 0,
                flags: 0,
                is_bigendian: false,
                data,
            }),
            Self::OldPacket => of(&OldFfmpegPacket {
                header,
                data,
                img_width: 96,
                img_height: 64,
                encoding: format,
                pts: 0,
                flags: 0,
            }),
            Self::Image => of(&CompressedImage {
                header,
                format,
                data,
            }),
        }
    }
}

fn open(bag: &Path) -> Result<Dataset, deepfusion_data::Error> {
    Ok(Dataset::open(bag, &OpenOptions::default())?.remove(0))
}

fn some(packets: &[Vec<u8>]) -> Vec<Option<Vec<u8>>> {
    packets.iter().cloned().map(Some).collect()
}

fn psnr(a: &RgbImage, b: &RgbImage) -> f64 {
    let squares = a.as_raw().iter().zip(b.as_raw());
    let sum: f64 = squares
        .map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2))
        .sum();
    10.0 * (255.0 * 255.0 * a.as_raw().len() as f64 / sum.max(1e-9)).log10()
}

/// Packets that each begin with a unit whose first byte `begins` recognises.
fn annex_b(bytes: &[u8], begins: impl Fn(u8) -> bool) -> Vec<Vec<u8>> {
    let starts = bytes.windows(4).enumerate();
    let starts = starts.filter(|(_, w)| w[..3] == [0, 0, 1] && begins(w[3]));
    let mut starts: Vec<usize> = starts.map(|(at, _)| at).collect();
    starts.push(bytes.len());
    starts
        .windows(2)
        .map(|w| bytes[w[0]..w[1]].to_vec())
        .collect()
}

/// The packets of an IVF file: after 32 bytes, each packet follows its length and a time of eight bytes.
fn ivf(bytes: &[u8]) -> Vec<Vec<u8>> {
    let mut rest = &bytes[32..];
    let mut packets = Vec::new();
    while let Some((length, behind)) = rest.split_first_chunk() {
        let length = u32::from_le_bytes(*length) as usize;
        packets.push(behind[8..8 + length].to_vec());
        rest = &behind[8 + length..];
    }
    packets
}

#[test]
fn frames_of_every_kind_come_back_in_order() {
    let drive = Drive::new();
    if let Some(packets) = drive.encode("libx264", &[]) {
        let packets = some(&packets);
        for (name, kind, format) in [
            ("video", Kind::Video, "h264"),
            ("packet", Kind::Packet, "h264;yuv420p;bgr8;bgr8"),
            ("old", Kind::OldPacket, "libx264"),
            ("image", Kind::Image, "h264"),
        ] {
            let bag = drive.bag(&format!("{name}.bag"), kind, format, &packets);
            drive.assert_frames(&bag, 0);
        }
        let cache = drive.at().join("video.bag.camera.image_rect.ffmpeg.frames");
        // The frames, and the record of what they were made from; they are not made again.
        assert_eq!(fs::read_dir(&cache).unwrap().count(), FRAMES + 1);
        fs::write(cache.join("0000000003.jpg"), "broken").unwrap();
        let again = open(&drive.at().join("video.bag")).unwrap();
        assert!(again.load_image(2).is_ok() && again.load_image(3).is_err());
    }
    for (encoder, format) in [
        ("libx265", "h265"),
        ("libvpx-vp9", "vp9"),
        ("libaom-av1", "av1"),
    ] {
        if let Some(packets) = drive.encode(encoder, &[]) {
            let name = format!("{format}.bag");
            let bag = drive.bag(&name, Kind::Video, format, &some(&packets));
            drive.assert_frames(&bag, 0);
        }
    }
}

#[test]
fn the_command_reads_a_stream_as_it_reads_images() {
    let drive = Drive::new();
    let Some(packets) = drive.encode("libx264", &[]) else {
        return;
    };
    let at = drive.at();
    let bag = drive.bag("drive.bag", Kind::Video, "h264", &some(&packets));
    // The file beside the bag says where the frames go, and which topic is the camera's.
    ok(at, "data inspect drive.bag --write-config");
    let config = fs::read_to_string(at.join("drive.toml")).unwrap();
    assert!(
        config.contains("image = \"/camera/image_rect/ffmpeg\""),
        "{config}"
    );
    fs::write(
        at.join("drive.toml"),
        format!("cache = \"scratch\"\n{config}"),
    )
    .unwrap();
    let seen = json(
        at,
        "data inspect drive.bag --topic image=/camera/image_rect/ffmpeg --json",
    );
    assert_eq!(seen["frames"], FRAMES);
    assert_eq!(seen["size"], serde_json::json!([96, 64]));
    let streams = seen["streams"].as_array().unwrap();
    let stream = streams
        .iter()
        .find(|s| s["name"] == "/camera/image_rect/ffmpeg");
    let stream = stream.unwrap();
    assert_eq!(
        (&stream["type"], &stream["count"]),
        (&"image".into(), &FRAMES.into())
    );
    ok(
        at,
        "train --data drive.bag --preset tiny --size 64x64 --batch 2 --steps 2 --init none --out run",
    );
    let name = "drive.bag.camera.image_rect.ffmpeg";
    let cache = frames_folder(&at.join("scratch"), &bag, name);
    assert_eq!(fs::read_dir(&cache).unwrap().count(), FRAMES + 1);
    drive.assert_frames(&bag, 0);
}

#[test]
fn frames_before_the_first_key_frame_are_left_out_with_a_warning() {
    let drive = Drive::new();
    let Some(packets) = drive.encode("libx264", &[]) else {
        return;
    };
    let mut late = some(&packets);
    late[..3].fill(None);
    let bag = drive.bag("late.bag", Kind::Packet, "h264", &late);
    drive.assert_frames(&bag, KEYS);
    let opened = open(&bag).unwrap();
    let warnings: Vec<String> = opened.warnings().iter().map(ToString::to_string).collect();
    let warnings = warnings.join("\n");
    let expected = format!("/camera/image_rect/ffmpeg: the first {} messages", KEYS - 3);
    assert!(warnings.contains(&expected), "{warnings}");

    // Without any key frame there are no images.
    let mut none = some(&packets);
    none[0] = None;
    none.truncate(KEYS);
    none.resize(FRAMES, None);
    drive.bag("none.bag", Kind::Packet, "h264", &none);
    fails(
        drive.at(),
        "data inspect none.bag",
        &["/camera/image_rect/ffmpeg has 7 messages and no key frame among them"],
    );
}

#[test]
fn gaps_and_damage_are_reported_with_the_message() {
    let drive = Drive::new();
    let Some(packets) = drive.encode("libx264", &[]) else {
        return;
    };
    let damaged = |name: &str, format: &str, packets: &[Option<Vec<u8>>]| {
        drive.refused(&drive.bag(name, Kind::Video, format, packets))
    };
    let says = |text: &str, parts: &[&str]| {
        for part in parts {
            assert!(text.contains(part), "no `{part}` in {text}");
        }
    };
    let place = |number: usize| format!("/camera/image_rect/ffmpeg, message {number}: ");
    // Message 11 was lost: the one after it depends on it. The same holds for a lost key frame.
    for lost in [11, 2 * KEYS] {
        let mut gap = some(&packets);
        gap[lost] = None;
        let text = damaged("gap.bag", "h264", &gap);
        says(
            &text,
            &["gap.bag: ", &place(lost), "missing", "counted from 0"],
        );
    }
    // Before the first key frame, messages count too.
    let mut late = some(&packets);
    late[0] = None;
    late[18] = None;
    let text = damaged("late.bag", "h264", &late);
    says(&text, &[&place(17), "missing"]);

    let mut cut = some(&packets);
    let packet = cut[13].as_mut().unwrap();
    packet.truncate(packet.len() / 2);
    says(&damaged("cut.bag", "h264", &cut), &[&place(13), "damaged"]);
    let mut empty = some(&packets);
    empty[5] = Some(Vec::new());
    says(
        &damaged("empty.bag", "h264", &empty),
        &[&place(5), "no picture"],
    );
    let mut rubbish = some(&packets);
    rubbish[5] = Some(vec![0xa5; 300]);
    says(
        &damaged("rubbish.bag", "h264", &rubbish),
        &[&place(5), "no picture"],
    );

    let text = damaged("jpeg.bag", "mjpeg", &some(&packets));
    says(
        &text,
        &[
            "jpeg.bag: /camera/image_rect/ffmpeg",
            "`mjpeg`",
            "h264, h265",
        ],
    );

    let reordered = drive.encode("libx264", &["-bf", "2", "-x264-params", "aud=1:b-adapt=0"]);
    let text = damaged("b.bag", "h264", &some(&reordered.unwrap()));
    // I, P, and the first B.
    says(&text, &[&place(2), "B-frame", "-bf 0"]);

    // HEVC packets are not parsed here: ffmpeg reports an error, and is run again with fewer packets until it does not.
    if let Some(packets) = drive.encode("libx265", &[]) {
        let mut gap = some(&packets);
        gap[11] = None;
        says(&damaged("hevc.bag", "hevc", &gap), &[&place(11), "missing"]);
        let mut cut = some(&packets);
        cut[13].as_mut().unwrap().truncate(9);
        says(&damaged("hevc.bag", "hevc", &cut), &[&place(13)]);
        let bframes = "aud=1:bframes=2:b-adapt=0:qp=12:log-level=none";
        let reordered = drive.encode("libx265", &["-x265-params", bframes]).unwrap();
        let text = damaged("hevc.bag", "hevc", &some(&reordered));
        says(&text, &["B-frame", "-bf 0"]);
    }
}

#[test]
fn several_readers_at_once_leave_no_temporary_files() {
    let drive = Drive::new();
    let Some(packets) = drive.encode("libx264", &[]) else {
        return;
    };
    let bag = drive.bag("drive.bag", Kind::Image, "h264", &some(&packets));
    // Each with its own data set, as in separate processes.
    std::thread::scope(|scope| {
        for n in 0..4 {
            let bag = &bag;
            scope.spawn(move || open(bag).unwrap().load_image(n).unwrap());
        }
    });
    let names = fs::read_dir(drive.at()).unwrap();
    let names = names.map(|e| e.unwrap().file_name().into_string().unwrap());
    let made: Vec<String> = names.filter(|name| name.contains("frames")).collect();
    assert_eq!(made, ["drive.bag.camera.image_rect.ffmpeg.frames"]);
}

#[test]
fn a_missing_ffmpeg_is_an_error_with_a_hint() {
    let drive = Drive::new();
    // Two packets that begin as H.264 does; they are never decoded.
    let key = [
        0, 0, 1, 0x67, 66, 0, 30, 0xda, 0x40, 0, 0, 1, 0x65, 0xe0, 0x80,
    ];
    drive.bag(
        "drive.bag",
        Kind::Video,
        "h264",
        &vec![Some(key.to_vec()); FRAMES],
    );
    let nowhere = drive.at().join("nowhere");
    fs::create_dir(&nowhere).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_deepfusion"))
        .current_dir(drive.at())
        .args(["data", "inspect", "drive.bag"])
        .env("PATH", &nowhere)
        .output()
        .unwrap();
    let printed = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{printed}");
    for part in ["ffmpeg is needed to read videos", "hint: install ffmpeg"] {
        assert!(printed.contains(part), "{printed}");
    }
}
