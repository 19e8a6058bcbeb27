//! Videos, read with the installed ffmpeg; skipped without one.

use crate::common::text_of;
use deepfusion_data::{Dataset, DatasetKind, FrameImage, OpenOptions, RgbImage, inspect};
use deepfusion_hint::Hint;
use deepfusion_video::{VideoPicture, frames_folder, shown_for};
use image::Rgb;
use ndarray::Array1;
use ndarray_npy::WriteNpyExt;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Ten frames of a uniform colour each, 64x48 at 10 Hz, as a video with few key frames; `None` without ffmpeg.
fn write_video(folder: &Path, name: &str) -> Option<PathBuf> {
    encode(
        folder,
        name,
        &["-c:v", "mpeg4", "-q:v", "1", "-g", "5", "-bf", "2"],
    )
}

fn encode(folder: &Path, name: &str, codec: &[&str]) -> Option<PathBuf> {
    for n in 0..10_u8 {
        let image = RgbImage::from_pixel(64, 48, Rgb([20 * n, 120, 200 - 20 * n]));
        image.save(folder.join(format!("source{n}.png"))).unwrap();
    }
    let video = folder.join(name);
    let made = Command::new("ffmpeg")
        .current_dir(folder)
        .args(["-v", "error", "-framerate", "10", "-i", "source%d.png"])
        .args(codec)
        .arg(name)
        .status();
    for n in 0..10 {
        fs::remove_file(folder.join(format!("source{n}.png"))).unwrap();
    }
    match made {
        Ok(status) if status.success() => Some(video),
        _ => {
            eprintln!("skipped: no ffmpeg that can write a video");
            None
        }
    }
}

fn write_tables(folder: &Path) {
    let speeds: String = (0..30)
        .map(|i| format!("{},{}\n", f64::from(i) * 0.05, 36))
        .collect();
    fs::write(
        folder.join("speed.csv"),
        format!("time_s,speed_kmh\n{speeds}"),
    )
    .unwrap();
    fs::write(folder.join("intrinsics.txt"), "50,50,31.5,23.5").unwrap();
}

/// An entry of GoPro's metadata, with values of `size` bytes each.
fn entry(key: &[u8; 4], kind: u8, size: u8, value: &[u8]) -> Vec<u8> {
    let count = (value.len() / usize::from(size)) as u16;
    let mut bytes = [key.as_slice(), &[kind, size], &count.to_be_bytes(), value].concat();
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    bytes
}

/// Adds a GoPro's metadata about its lens to a video: a letter, and the angle from corner to corner.
fn add_gopro_lens(video: &Path, letter: u8, diagonal_deg: f32) {
    let mut file = fs::read(video).unwrap();
    let at = file.windows(4).position(|w| w == b"moov").unwrap() - 4;
    let length = u32::from_be_bytes(file[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!(at + length, file.len(), "ffmpeg writes it last");
    let size = [64_u32.to_be_bytes(), 48_u32.to_be_bytes()].concat();
    let all = [
        entry(b"MINF", b'c', 1, b"HERO11 Black"),
        entry(b"VRES", b'L', 4, &size),
        entry(b"ZFOV", b'f', 4, &diagonal_deg.to_be_bytes()),
        entry(b"VFOV", b'c', 1, &[letter]),
    ];
    let boxed = |kind: &[u8; 4], content: &[u8]| {
        let length = (content.len() + 8) as u32;
        [length.to_be_bytes().as_slice(), kind, content].concat()
    };
    let ours = boxed(
        b"udta",
        &boxed(b"GPMF", &entry(b"DEVC", 0, 1, &all.concat())),
    );
    // Before ffmpeg's user data, which only has its own name.
    let name = file.windows(4).rposition(|w| w == b"udta").unwrap() - 4;
    file.splice(name..name, ours.iter().copied());
    let grown = (length + ours.len()) as u32;
    file[at..at + 4].copy_from_slice(&grown.to_be_bytes());
    fs::write(video, file).unwrap();
}

#[test]
fn a_gopros_camera_is_known_only_with_the_linear_lens() {
    let root = tempfile::tempdir().unwrap();
    for (name, letter) in [("linear", b'L'), ("wide", b'W')] {
        let folder = root.path().join(name);
        fs::create_dir(&folder).unwrap();
        let Some(video) = write_video(&folder, "drive.mp4") else {
            return;
        };
        add_gopro_lens(&video, letter, 90.0);
        let hfov = OpenOptions {
            hfov_deg: Some(60.0),
            ..OpenOptions::default()
        };
        let given = Dataset::open(&video, &hfov).unwrap();
        let bends = |dataset: &Dataset| text_of(dataset.warnings()).contains("bends lines");
        if letter == b'L' {
            // Half a diagonal of 80 pixels over tan 45°.
            let found = &Dataset::open(&video, &OpenOptions::default()).unwrap()[0];
            let k = found.intrinsics(0);
            assert!(
                (k.fx - 40.0).abs() < 1e-6 && (k.fy - 40.0).abs() < 1e-6,
                "{k:?}"
            );
            assert!(!found.camera_assumed());
            let text = text_of(found.warnings());
            assert!(text.contains("linear lens of a HERO11 Black"), "{text}");
            assert!(!bends(&given[0]));
            // A given camera takes precedence.
            assert!((given[0].intrinsics(0).fx - 32.0 / 30_f64.to_radians().tan()).abs() < 1e-6);
        } else {
            let error = Dataset::open(&video, &OpenOptions::default()).unwrap_err();
            assert!(error.to_string().contains("\"wide\""), "{error}");
            assert!(bends(&given[0]), "{:?}", given[0].warnings());
        }
    }
}

#[test]
fn a_video_gives_its_frames_in_any_order() {
    let root = tempfile::tempdir().unwrap();
    // A `%` in a path must not be a placeholder for a number.
    let folder = root.path().join("100% drive");
    fs::create_dir(&folder).unwrap();
    let Some(video) = write_video(&folder, "drive.mp4") else {
        return;
    };
    write_tables(&folder);
    for path in [&video, &folder] {
        let mut datasets = Dataset::open(path, &OpenOptions::default()).unwrap();
        let dataset = datasets.remove(0);
        assert_eq!(
            (dataset.kind(), dataset.name()),
            (DatasetKind::Video, "drive")
        );
        assert_eq!(dataset.frames().len(), 10);
        assert!((dataset.frames()[7].time_s.unwrap() - 0.7).abs() < 1e-6);
        let image = &dataset.frames()[7].image;
        assert!(matches!(image, FrameImage::Within { index: 7, .. }) && image.file().is_none());
        for n in [7, 0, 9, 3] {
            let image = dataset.load_image(n).unwrap();
            // Colours pass through two 4:2:0 codecs, so they differ by a few levels.
            let [r, _, b] = image.get_pixel(32, 24).0.map(i32::from);
            let n = n as i32;
            assert!(
                (r - 20 * n).abs() < 9 && (b - 200 + 20 * n).abs() < 9,
                "{n}: {r} {b}"
            );
        }
        let snippets = dataset.snippets(&[1], 0.5).unwrap();
        assert_eq!(snippets.len(), 9);
    }
    // Decoded once, beside the video; another video with the same name is decoded again.
    let cache = folder.join("drive.mp4.frames");
    assert_eq!(fs::read_dir(&cache).unwrap().count(), 11);
    fs::write(cache.join("0000000000.jpg"), "broken").unwrap();
    let dataset = Dataset::open(&video, &OpenOptions::default())
        .unwrap()
        .remove(0);
    assert!(dataset.load_image(0).is_err());
    fs::remove_file(cache.join("origin.json")).unwrap();
    fs::remove_dir_all(&cache).unwrap();
    let dataset = Dataset::open(&video, &OpenOptions::default())
        .unwrap()
        .remove(0);
    assert!(dataset.load_image(0).is_ok());
    let seen = inspect(&folder).unwrap();
    assert_eq!((seen.frames, seen.size), (10, Some([64, 48])));
    assert!((seen.streams[0].rate_hz.unwrap() - 10.0).abs() < 1e-3);
    assert!(seen.to_string().contains("on the tables' clock"), "{seen}");
}

/// comma2k19's videos have no time stamps; the times are in an array beside them.
#[test]
fn frame_times_of_a_comma_segment_come_from_its_log() {
    let root = tempfile::tempdir().unwrap();
    let codec = [
        "-c:v",
        "libx265",
        "-x265-params",
        "log-level=error",
        "-crf",
        "10",
        "-f",
        "hevc",
    ];
    if encode(root.path(), "video.hevc", &codec).is_none() {
        return;
    }
    let speed = root.path().join("processed_log/CAN/speed");
    fs::create_dir_all(&speed).unwrap();
    fs::create_dir_all(root.path().join("global_pose")).unwrap();
    let write = |path: PathBuf, values: Vec<f64>| {
        let file = fs::File::create(path).unwrap();
        Array1::from_vec(values).write_npy(file).unwrap();
    };
    write(
        speed.join("t"),
        (0..100).map(|i| 46408.0 + f64::from(i) * 0.012).collect(),
    );
    write(speed.join("value"), vec![12.0; 100]);
    // The log continues after the video's last frame.
    let times = (0..12).map(|i| 46408.1 + f64::from(i) * 0.05).collect();
    write(root.path().join("global_pose/frame_times"), times);
    let error = Dataset::open(root.path(), &OpenOptions::default()).unwrap_err();
    assert!(
        error.hint().unwrap().contains("[910, 910, 582, 437]"),
        "{error}"
    );
    fs::write(
        root.path().join("dataset.toml"),
        "intrinsics = [50, 50, 31.5, 23.5]",
    )
    .unwrap();
    let dataset = Dataset::open(root.path(), &OpenOptions::default())
        .unwrap()
        .remove(0);
    assert_eq!(
        (dataset.kind(), dataset.frames().len()),
        (DatasetKind::Comma2k19, 10)
    );
    let snippets = dataset.snippets(&[1], 0.5).unwrap();
    assert_eq!(snippets.len(), 9);
    let motion = snippets[4].sources[0].motion;
    assert!((motion.distance_m - 0.6).abs() < 1e-6 && motion.source_from_target.is_none());
    let image = dataset.load_image(6).unwrap();
    assert!((i32::from(image.get_pixel(32, 24).0[0]) - 120).abs() < 9);
    let text = inspect(root.path()).unwrap().to_string();
    assert!(
        text.contains("has 12 times, video.hevc 10 frames"),
        "{text}"
    );
}

#[test]
fn files_that_are_not_videos_are_errors() {
    let root = tempfile::tempdir().unwrap();
    let video = root.path().join("x.mp4");
    fs::write(&video, "no video").unwrap();
    let error = Dataset::open(&video, &OpenOptions::default()).unwrap_err();
    // The error is ffprobe's, or that it is missing.
    assert!(error.to_string().contains("x.mp4: ffprobe"), "{error}");
    assert!(error.hint().is_some());
    fs::write(root.path().join("y.mkv"), "another").unwrap();
    let error = Dataset::open(root.path(), &OpenOptions::default()).unwrap_err();
    assert!(
        error.to_string().contains("the folder has 2 videos"),
        "{error}"
    );
    let hint = error.hint().unwrap();
    assert!(hint.contains("set video = "), "{hint}");
}

#[test]
fn images_are_written_as_a_video_with_their_own_times() {
    let root = tempfile::tempdir().unwrap();
    if encode(root.path(), "there_is_ffmpeg.mp4", &[]).is_none() {
        return;
    }
    let folder = root.path().join("made");
    fs::create_dir(&folder).unwrap();
    // Thirty and sixty frames per second, and a pause.
    let times = [0.0, 1.0 / 30.0, 2.0 / 30.0, 0.2, 0.2 + 1.0 / 60.0, 0.25];
    let seconds = shown_for(&times.map(Some));
    let shown: Vec<VideoPicture> = seconds
        .into_iter()
        .enumerate()
        .map(|(i, seconds)| {
            // Names that ffmpeg would interpret as a protocol, a quotation or a sequence.
            let file = format!("12:30 it's %03d {i}.png");
            // An odd size, and a smaller image.
            let (w, h) = if i == 3 { (32, 24) } else { (65, 49) };
            let grey = RgbImage::from_pixel(w, h, Rgb([40 + 30 * i as u8; 3]));
            grey.save(folder.join(&file)).unwrap();
            VideoPicture { file, seconds }
        })
        .collect();
    let made = |name: &str| deepfusion_video::write_video(&folder, &shown, name);
    made("drive.mp4").unwrap();
    fs::write(folder.join("intrinsics.txt"), "50,50,32,24").unwrap();
    let opened = Dataset::open(&folder.join("drive.mp4"), &OpenOptions::default()).unwrap();
    let frames = opened[0].frames();
    // The last frame is shown for its duration too, and then once more.
    assert_eq!(frames.len(), 7);
    for (i, expected) in times.into_iter().enumerate() {
        let time = frames[i].time_s.unwrap();
        assert!(
            (time - expected).abs() < 0.001,
            "{i}: {time} for {expected}"
        );
        let image = opened[0].load_image(i).unwrap();
        assert_eq!(image.dimensions(), (66, 50));
        let grey = image.get_pixel(33, 25)[0];
        assert!(grey.abs_diff(40 + 30 * i as u8) < 12, "{i}: {grey}");
    }
    // An invalid image at any position is an error, and leaves nothing behind; existing files are kept.
    let before = fs::read(folder.join("drive.mp4")).unwrap();
    for broken in [0, 2] {
        let path = folder.join(&shown[broken].file);
        let original = fs::read(&path).unwrap();
        fs::write(&path, "no picture").unwrap();
        for name in ["drive.mp4", "other.mp4"] {
            let error = made(name).unwrap_err();
            assert!(error.hint().is_some(), "{error}");
        }
        fs::remove_file(&path).unwrap();
        let error = made("other.mp4").unwrap_err();
        assert!(error.to_string().contains(&shown[broken].file), "{error}");
        fs::write(&path, original).unwrap();
    }
    assert_eq!(fs::read(folder.join("drive.mp4")).unwrap(), before);
    let names = fs::read_dir(&folder)
        .unwrap()
        .map(|e| e.unwrap().file_name());
    let mut names = names.map(|n| n.into_string().unwrap());
    assert!(names.all(|n| !n.contains("partial") && n != "other.mp4"));
}

/// As written by `data import`: the video stays in its place, and the tables are in a folder of their own.
#[test]
fn a_folder_may_name_a_video_elsewhere() {
    let root = tempfile::tempdir().unwrap();
    let Some(video) = write_video(root.path(), "drive.mp4") else {
        return;
    };
    let folder = root.path().join("my-drive");
    fs::create_dir(&folder).unwrap();
    write_tables(&folder);
    let named = format!("video = {video:?}\ncache = {folder:?}\n");
    fs::write(folder.join("dataset.toml"), named).unwrap();
    let dataset = Dataset::open(&folder, &OpenOptions::default())
        .unwrap()
        .remove(0);
    assert_eq!(dataset.frames().len(), 10);
    assert_eq!(dataset.intrinsics(0).fx, 50.0);
    assert!((dataset.frames()[3].speed_mps.unwrap() - 10.0).abs() < 1e-9);
    dataset.load_image(3).unwrap();
    // Another video with the same name may keep its frames there too.
    assert!(frames_folder(&folder, &video, "drive.mp4").is_dir());
    assert!(!folder.join("drive.mp4.frames").exists());
    assert!(!root.path().join("drive.mp4.frames").exists());
}
