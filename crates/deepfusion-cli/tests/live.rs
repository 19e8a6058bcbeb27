//! Live sources through the program: streams on standard input and from a server in this test. Tests that need ffmpeg are
//! skipped with a message if it is missing.

use std::io::Write;
use std::net::TcpListener;
use std::path::Path;
use std::process::Command;

use crate::support::streams::{brightness, piped, serve, stream, stream_of, with_path};
use crate::support::{Run, fails, is_lock, run};
use serde_json::Value;

const CAMERA: &str = "--intrinsics 186,186,157,44";

fn has_ffmpeg() -> bool {
    let answer = Command::new("ffmpeg").arg("-version").output();
    let there = answer.is_ok_and(|o| o.status.success());
    if !there {
        eprintln!("skipped: there is no ffmpeg that could read a stream");
    }
    there
}

/// A network trained for a few steps on a street.
fn network(folder: &Path) {
    for args in [
        "simulate --out street --frames 6 --seed 5 --size 320x96",
        "train --data street --preset tiny --size 128x64 --batch 2 --steps 2 --init none --out run",
    ] {
        let run = run(folder, args);
        assert_eq!(run.code, 0, "{args}: {}", run.stderr);
    }
}

fn json(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn files(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .filter(|name| !is_lock(name))
        .collect();
    names.sort();
    names
}

/// The lines of `targets.jsonl`; asserts that every file beside it is complete.
fn complete_lines(folder: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(folder.join("targets.jsonl")).unwrap();
    let lines: Vec<Value> = text
        .lines()
        .map(|l| serde_json::from_str(l).unwrap())
        .collect();
    for line in &lines {
        let name = line["frame"].as_str().unwrap();
        assert_eq!(&json(&folder.join(format!("{name}_targets.json"))), line);
        let sidecar = json(&folder.join(format!("{name}.json")));
        assert_eq!(sidecar["live"]["dropped"], line["dropped"]);
        let files = sidecar["files"].as_array().unwrap();
        for (file, bytes) in files.iter().zip(sidecar["file_bytes"].as_array().unwrap()) {
            let found = std::fs::metadata(folder.join(file.as_str().unwrap())).unwrap();
            assert_eq!(found.len(), bytes.as_u64().unwrap());
        }
    }
    let names = files(folder);
    assert!(!names.iter().any(|n| n.ends_with("partial")), "{names:?}");
    let records = names.iter().filter(|n| n.ends_with("_targets.json"));
    assert_eq!(records.count(), lines.len());
    lines
}

fn number(line: &Value) -> u64 {
    line["frame"]
        .as_str()
        .unwrap()
        .strip_prefix("live-")
        .unwrap()
        .parse()
        .unwrap()
}

#[test]
fn frames_of_a_source_that_is_too_fast_are_skipped_without_delay() {
    if !has_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    network(at);
    const SENT: usize = 1000;
    let args = format!("perceive --model run - {CAMERA} --out seen --speed 5 --json");
    let printed = piped(at, &args, stream(SENT));
    assert_eq!(printed.code, 0, "{}", printed.stderr);
    let lines = complete_lines(&at.join("seen"));
    assert_eq!(printed.stdout.lines().count(), lines.len());
    for (place, line) in lines.iter().enumerate() {
        // The gaps in the numbers are the frames that were skipped.
        assert_eq!(
            line["dropped"].as_u64().unwrap(),
            number(line) - place as u64
        );
        assert!(line["latency_ms"].as_f64().unwrap() > 0.0);
        assert!(line["arrived_unix_s"].as_f64().unwrap() > 1.7e9);
        assert_eq!(line["speed_mps"], 5.0);
        // A frame's picture has its number, and depth was predicted from that picture.
        let name = line["frame"].as_str().unwrap();
        let picture = image::open(at.join(format!("seen/{name}_image.jpg")))
            .unwrap()
            .into_rgb8();
        let grey = picture.get_pixel(160, 48).0[1];
        assert!(
            grey.abs_diff(brightness(number(line) as usize)) < 4,
            "{name}: {grey}"
        );
    }
    let last = lines.last().unwrap();
    assert_eq!(number(last), SENT as u64 - 1, "the newest frame is used");
    assert!(last["dropped"].as_u64().unwrap() > 0, "{last}");
    // Straight ahead, for the time that it took to arrive.
    let forward = last["camera_motion"][11].as_f64().unwrap();
    let took =
        last["arrived_unix_s"].as_f64().unwrap() - lines[0]["arrived_unix_s"].as_f64().unwrap();
    assert!(
        (forward - 5.0 * took).abs() < 0.5,
        "{forward} m in {took} s"
    );
    assert!(
        printed.stderr.contains("skipped") && printed.stderr.contains("latency"),
        "{}",
        printed.stderr
    );
    // Frames of another run would be mixed with these.
    let again = piped(at, &args, stream(2));
    assert_eq!(again.code, 1);
    assert!(
        again.stderr.contains("live-") && again.stderr.contains("--overwrite"),
        "{}",
        again.stderr
    );
    let anew = piped(at, &format!("{args} --overwrite"), stream(1));
    assert_eq!(anew.code, 0, "{}", anew.stderr);
    assert_eq!(complete_lines(&at.join("seen")).len(), 1);
}

#[test]
fn prediction_of_a_stream_stops_at_the_given_frame() {
    if !has_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    network(at);
    let args =
        format!("predict --model run - {CAMERA} --out depth --frames 2 --save npy,video --json");
    let printed = piped(at, &args, stream(2000));
    assert_eq!(printed.code, 0, "{}", printed.stderr);
    let sidecars: Vec<Value> = printed
        .stdout
        .lines()
        .map(|l| serde_json::from_str(l).unwrap())
        .collect();
    assert_eq!(sidecars.len(), 2);
    for sidecar in &sidecars {
        assert_eq!(sidecar["image"], "standard input");
        assert!(sidecar["live"]["latency_ms"].as_f64().unwrap() > 0.0);
        assert_eq!(sidecar["intrinsics_from"], "given");
        for file in sidecar["files"].as_array().unwrap() {
            assert!(at.join("depth").join(file.as_str().unwrap()).is_file());
        }
    }
    // Two frames of four files each, and their video: no manifest, no lock.
    let files = files(&at.join("depth"));
    assert_eq!(files.len(), 9, "{files:?}");
    assert!(files.contains(&"live_video.mp4".to_owned()), "{files:?}");

    // Frames of a shape unlike any in training, which the network sees whole: both commands warn of them once.
    for command in ["predict", "perceive"] {
        let args = format!(
            "{command} --model run - --intrinsics 500,500,479.5,31.5 --stretch --out odd-{command}"
        );
        let odd = piped(at, &args, stream_of((960, 64), 3));
        assert_eq!(odd.code, 0, "{}", odd.stderr);
        let about = odd.stderr.lines();
        let about = about.filter(|line| line.contains("not trained on such images"));
        assert_eq!(about.count(), 1, "{}", odd.stderr);
    }
}

#[test]
fn frames_before_the_connection_was_lost_are_kept() {
    if !has_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    network(at);
    // The server stays connected, but sends no more.
    let (stop, until) = std::sync::mpsc::channel::<()>();
    let (address, server) = serve(move |mut connection| {
        connection.write_all(&stream(60)).unwrap();
        until.recv().ok();
    });
    let args = format!("perceive --model run {address} {CAMERA} --out silent --timeout 5");
    let silent = run(at, &args);
    drop(stop);
    server.join().unwrap();
    assert_eq!(silent.code, 1, "{}", silent.stderr);
    for part in [
        address.as_str(),
        "gave no frame for 5 s, after 60 frames",
        "hint:",
        "--timeout",
        "was lost",
    ] {
        assert!(silent.stderr.contains(part), "{part}: {}", silent.stderr);
    }
    assert!(!complete_lines(&at.join("silent")).is_empty());
    // The server disconnects before it has sent what it announced.
    let (address, server) = serve(|mut connection| {
        for part in stream(60).chunks(200_000) {
            connection.write_all(part).unwrap();
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
    });
    let gone = run(
        at,
        &format!("perceive --model run {address} {CAMERA} --out gone"),
    );
    server.join().unwrap();
    assert_eq!(gone.code, 1, "{}", gone.stderr);
    for part in ["lost the connection after", "ends prematurely", "hint:"] {
        assert!(gone.stderr.contains(part), "{part}: {}", gone.stderr);
    }
    assert!(!complete_lines(&at.join("gone")).is_empty());
}

#[test]
fn a_source_that_cannot_be_opened_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    network(at);
    let nobody = {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        listener.local_addr().unwrap()
    };
    let refused = |run: &Run, parts: &[&str]| {
        assert_eq!((run.code, run.stdout.as_str()), (1, ""), "{}", run.stderr);
        for part in parts.iter().chain(&["hint:"]) {
            assert!(run.stderr.contains(part), "{part}: {}", run.stderr);
        }
    };
    let image = "street/2026_01_01/2026_01_01_drive_0005_sync/image_02/data/0000000003.png";
    let cases = [
        (
            "predict --model run camera:0 - --out a".to_owned(),
            "combined with other inputs",
        ),
        (
            format!("perceive --model run camera:0 {image} --out a"),
            "combined with other inputs",
        ),
        (
            "predict --model run - --shard 1/2 --out a".to_owned(),
            "shard",
        ),
        (
            format!("predict --model run {image} --duration 3 --out a"),
            "--duration",
        ),
        (
            format!("perceive --model run {image} --speed 0 --out a"),
            "--speed",
        ),
        (
            "perceive --model run camera:0?sise=640x480 --out a".to_owned(),
            "unknown setting `sise`",
        ),
    ];
    for (args, part) in &cases {
        refused(&run(at, args), &[part]);
    }
    // No ffmpeg.
    let absent = with_path(
        at,
        "perceive --model run udp://127.0.0.1:1 --out b",
        at.as_os_str(),
    );
    refused(
        &absent,
        &["udp://127.0.0.1:1", "ffmpeg", "not installed", "PATH"],
    );
    if !has_ffmpeg() {
        return;
    }
    for command in ["perceive", "predict"] {
        let args = format!("{command} --model run tcp://me:secret@{nobody} --out c");
        let run = run(at, &args);
        refused(&run, &["gave no frame", "check that the source is running"]);
        assert!(!run.stderr.contains("secret"), "{}", run.stderr);
        assert_eq!(files(&at.join("c")), Vec::<String>::new());
    }
    let noise = piped(at, "predict --model run - --out d", vec![7; 10_000]);
    refused(&noise, &["standard input", "Invalid data"]);
    let nothing = piped(at, "predict --model run - --out d", Vec::new());
    refused(&nothing, &["standard input", "gave no frame"]);
}

/// Frames and targets of a running run cannot be replaced by another, even with --overwrite.
#[test]
fn a_folder_in_which_a_run_is_at_work_is_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let out = at.join("seen");
    std::fs::create_dir(&out).unwrap();
    let written = ["live-0000000000.json", "targets.jsonl.partial"];
    for file in written {
        std::fs::write(out.join(file), "{}\n").unwrap();
    }
    image::RgbImage::new(320, 96)
        .save(at.join("a.png"))
        .unwrap();
    let lock = std::fs::File::create(out.join(".predict-1-of-1.lock")).unwrap();
    lock.lock().unwrap();
    for command in [
        "predict udp://127.0.0.1:1",
        "perceive udp://127.0.0.1:1",
        "perceive a.png",
    ] {
        let args = format!("{command} --model tiny {CAMERA} --overwrite --out seen");
        fails(
            at,
            &args,
            &["already writing to this folder", "choose another folder"],
        );
    }
    for file in written {
        assert_eq!(std::fs::read(out.join(file)).unwrap(), b"{}\n", "{file}");
    }
}

/// Before ffmpeg 5.1, one of its options had another name.
#[test]
#[cfg(unix)]
fn an_old_ffmpeg_is_given_its_old_option() {
    use std::os::unix::fs::PermissionsExt;

    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    network(at);
    let old = at.join("ffmpeg");
    let script = "#!/bin/sh\ncase \"$*\" in *-fps_mode*) echo \"Unrecognized option 'fps_mode'.\" >&2; exit 1;; esac\n\
                  printf 'P6\\n320 96\\n255\\n'; head -c 92160 /dev/zero\n";
    std::fs::write(&old, script).unwrap();
    std::fs::set_permissions(&old, std::fs::Permissions::from_mode(0o755)).unwrap();
    let mut path = at.as_os_str().to_owned();
    path.push(":/usr/bin:/bin");
    let args = format!("perceive --model run tcp://camera:1 {CAMERA} --out seen");
    let printed = with_path(at, &args, &path);
    assert_eq!(printed.code, 0, "{}", printed.stderr);
    assert_eq!(complete_lines(&at.join("seen")).len(), 1);
}
