//! A ROS 2 bag whose cameras are video streams, written by PyPI's `rosbags` (`reference/video_drive.py`) and decoded with the installed
//! ffmpeg; skipped without one.

#![cfg(feature = "ros2")]
use deepfusion_data::{Dataset, Error, OpenOptions};
use deepfusion_hint::Hint;
use std::fs;
use std::path::Path;

fn open(bag: &Path, topics: &[&str]) -> Result<Dataset, Error> {
    let options = OpenOptions {
        topics: topics.iter().map(|t| t.parse().unwrap()).collect(),
        ..OpenOptions::default()
    };
    Ok(Dataset::open(bag, &options)?.remove(0))
}

#[test]
fn each_cameras_decoded_frames_have_their_own_folder() {
    if std::process::Command::new("ffmpeg")
        .arg("-version")
        .output()
        .is_err()
    {
        eprintln!("skipped: no ffmpeg");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("drive");
    fs::create_dir(&bag).unwrap();
    let written = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference/video_ros2");
    for name in ["metadata.yaml", "video_ros2.mcap"] {
        fs::copy(written.join(name), bag.join(name)).unwrap();
    }
    let error = open(&bag, &[]).unwrap_err();
    let text = error.to_string();
    assert!(
        text.contains("/front/video, /rear/image_raw/ffmpeg"),
        "{text}"
    );
    assert!(error.hint().unwrap().contains("topics"), "{error:?}");

    for (topic, focal) in [("/front/video", 60.0), ("/rear/image_raw/ffmpeg", 50.0)] {
        let drive = open(&bag, &[&format!("image={topic}")]).unwrap();
        assert_eq!(drive.frames().len(), 12);
        // CameraInfo comes from the camera's own namespace.
        assert_eq!(drive.intrinsics(0).fx, focal, "{topic}");
        for n in [7, 0, 11, 3] {
            let time_s = drive.frames()[n].time_s.unwrap();
            assert!((time_s - 0.1 * n as f64).abs() < 1e-9, "{n}: {time_s}");
            let image = drive.load_image(n).unwrap();
            // Two codecs round colours in a narrower range, so they differ by a few levels.
            let [r, g, b] = image.get_pixel(32, 24).0.map(i32::from);
            let n = n as i32;
            let apart = [r - 20 * n, g - 120, b - (200 - 20 * n).max(0)];
            assert!(apart.iter().all(|a| a.abs() < 9), "{n}: {r} {g} {b}");
        }
        assert!((drive.frames()[6].speed_mps.unwrap() - 10.0).abs() < 1e-6);
        let cache = format!("drive.{}.frames", topic.trim_matches('/').replace('/', "."));
        assert_eq!(fs::read_dir(folder.path().join(cache)).unwrap().count(), 13);
    }
    // Frames are decoded again if the bag changes, but not if the file with its settings does.
    let cache = folder.path().join("drive.front.video.frames");
    let damaged = cache.join("0000000003.jpg");
    fs::write(&damaged, "broken").unwrap();
    fs::write(bag.join("bag.toml"), "scenario = \"urban\"\n").unwrap();
    let front = ["image=/front/video"];
    assert!(open(&bag, &front).unwrap().load_image(3).is_err());
    let file = fs::File::options()
        .append(true)
        .open(bag.join("metadata.yaml"))
        .unwrap();
    std::io::Write::write_all(&mut &file, b"\n").unwrap();
    assert!(open(&bag, &front).unwrap().load_image(3).is_ok());
}
