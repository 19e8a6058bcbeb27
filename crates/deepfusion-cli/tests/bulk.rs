//! Bulk prediction: shards, stopped runs, unreadable images.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use crate::support::{fails, is_lock, ok};
use serde_json::Value;

const DRIVE: &str = "sim/2026_01_01/2026_01_01_drive_0003_sync/image_02/data";
const SAVE: &str = "--calib sim/2026_01_01 --save depth-png,npy,ply";

fn start(folder: &Path, args: &str) -> Child {
    Command::new(env!("CARGO_BIN_EXE_deepfusion"))
        .current_dir(folder)
        .args(args.split_whitespace())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

/// A drive of 30 small pictures and a network that has hardly been trained.
fn prepare(folder: &Path) {
    ok(
        folder,
        "simulate --out sim --frames 30 --seed 3 --scan-every 0 --size 96x64",
    );
    ok(
        folder,
        "train --data sim --size 96x64 --batch 2 --steps 1 --init none --out run",
    );
}

/// The folder's outputs and sidecars by name, without manifests, which depend on how the work was shared.
fn outputs(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap())
        .map(|e| (e.file_name().into_string().unwrap(), e.path()))
        .filter(|(name, _)| !name.ends_with(".manifest.json") && !is_lock(name))
        .map(|(name, path)| (name, fs::read(path).unwrap()))
        .collect()
}

fn assert_same(a: &BTreeMap<String, Vec<u8>>, b: &BTreeMap<String, Vec<u8>>) {
    assert!(a.keys().eq(b.keys()), "{:?} {:?}", a.keys(), b.keys());
    for (name, bytes) in a {
        assert!(*bytes == b[name], "{name} differs");
    }
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

#[test]
fn shards_started_at_once_write_what_one_run_writes() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    prepare(at);
    // Two folders with the same file names: outputs' names depend on all inputs.
    fs::create_dir(at.join("more")).unwrap();
    for i in 0..4 {
        let name = format!("000000000{i}.png");
        fs::copy(at.join(DRIVE).join(&name), at.join("more").join(&name)).unwrap();
    }
    let predict = format!("predict --model run {SAVE}");
    ok(at, &format!("{predict} {DRIVE} more --out whole"));
    let whole = outputs(&at.join("whole"));
    assert_eq!(whole.len(), 34 * 4, "{:?}", whole.keys());
    let shards: Vec<_> = (1..=3)
        .map(|i| {
            // The order of the inputs does not matter.
            let inputs = [format!("{DRIVE} more"), format!("more {DRIVE}")];
            let args = format!("{predict} {} --out parts --shard {i}/3", inputs[i % 2]);
            start(at, &args)
        })
        .collect();
    for mut shard in shards {
        assert!(shard.wait().unwrap().success());
    }
    assert_same(&outputs(&at.join("parts")), &whole);
    let mut done = 0;
    for i in 1..=3 {
        let path = at.join(format!("parts/predict-{i}-of-3.manifest.json"));
        let manifest = json(&path);
        let images = manifest["images"].as_array().unwrap();
        assert!(images.iter().all(|image| image["state"] == "done"));
        done += images.len();
    }
    assert_eq!(done, 34);
    // A shard of other inputs would leave images out.
    fails(
        at,
        &format!("{predict} {DRIVE} --out parts --shard 2/3"),
        &["of-3.manifest.json", "34 other inputs, not these 30"],
    );
    // Finishing with another number of shards finds everything done.
    let again = ok(at, &format!("{predict} {DRIVE} more --out parts"));
    assert!(
        again.stderr.contains("0 images written"),
        "{}",
        again.stderr
    );
    // Outputs among the images are not inputs: another run finds nothing new.
    let among = format!("{predict} more --out more");
    ok(at, &among);
    let once = outputs(&at.join("more"));
    ok(at, &among);
    assert_same(&once, &outputs(&at.join("more")));
    fails(
        at,
        &format!("{predict} more/0000000000_depth.png --out more"),
        &[
            "0000000000_depth.png: no images, only outputs",
            "hint: give the images",
        ],
    );
    // Nor are they if outputs go elsewhere.
    ok(at, &format!("{predict} more --out apart"));
    assert_eq!(outputs(&at.join("apart")).len(), 4 * 4);
}

/// First the first frames of each recording, then the rest.
#[test]
fn the_first_of_each_recording_are_done_alone() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(
        at,
        "simulate --out sim --frames 4 --seed 3 --scan-every 0 --size 96x64",
    );
    fs::create_dir(at.join("more")).unwrap();
    for i in 0..3 {
        let name = format!("000000000{i}.png");
        fs::copy(at.join(DRIVE).join(&name), at.join("more").join(&name)).unwrap();
    }
    let predict = "predict sim more --model tiny --save npy --out out";
    let printed = ok(at, &format!("{predict} --frames 2")).stderr;
    assert!(printed.contains("4 images written"), "{printed}");
    // The outputs' names are the same as for the whole.
    let printed = ok(at, predict).stderr;
    assert!(printed.contains("3 images written"), "{printed}");
    let line = ok(
        at,
        "perceive sim --model tiny --frames 1 --save depth-png --out seen --json",
    );
    assert_eq!(line.stdout.lines().count(), 1);
}

#[test]
fn a_camera_that_may_be_wrong_gives_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(
        at,
        "simulate --out sim --frames 1 --seed 3 --scan-every 0 --size 96x64",
    );
    let predict = format!("predict {DRIVE}/0000000000.png --model tiny");
    // No camera is given, and KITTI's calibration is some folders up.
    let printed = ok(at, &format!("{predict} --out a")).stderr;
    let calibration = Path::new("2026_01_01").join("calib_cam_to_cam.txt");
    assert!(
        printed.contains("--calib") && printed.contains(calibration.to_str().unwrap()),
        "{printed}"
    );
    // Intrinsics of images of twice the size, and of half the size.
    for (intrinsics, out) in [("112,112,95,63", "b"), ("28,28,23.5,15.5", "c")] {
        let printed = ok(
            at,
            &format!("{predict} --intrinsics {intrinsics} --out {out}"),
        )
        .stderr;
        assert!(printed.contains("images of another size"), "{printed}");
    }
    // The image's own intrinsics, and those of an image that was cut at the top.
    for (intrinsics, out) in [("56,56,47,31", "d"), ("56,56,47,8", "e")] {
        let printed = ok(
            at,
            &format!("{predict} --intrinsics {intrinsics} --out {out}"),
        )
        .stderr;
        assert!(!printed.contains("WARN"), "{printed}");
    }
}

/// Of pictures unlike any that the network was trained on, the first is named in a warning; all are predicted.
#[test]
fn an_image_of_extreme_size_gives_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::create_dir(at.join("odd")).unwrap();
    for (name, width, height) in [("a", 1, 1), ("b", 2000, 20), ("c", 320, 96)] {
        let picture = image::RgbImage::new(width, height);
        let path = at.join("odd").join(name).with_extension("png");
        picture.save(path).unwrap();
    }
    let predict = |input: &str, out: &str| {
        let args = format!("predict odd/{input} --model tiny --save npy --out {out}");
        let printed = ok(at, &args).stderr;
        let about =
            |line: &&str| line.contains("WARN") && line.contains("not trained on such images");
        printed.lines().filter(about).count()
    };
    assert_eq!(predict("c.png", "fits"), 0);
    assert_eq!(predict("", "all"), 1);
    assert_eq!(outputs(&at.join("all")).len(), 6);
}

#[test]
fn a_killed_run_can_be_continued() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    prepare(at);
    let predict = format!("predict --model run {DRIVE} {SAVE}");
    ok(at, &format!("{predict} --out whole"));
    let whole = outputs(&at.join("whole"));

    // Killed somewhere in the middle.
    let mut child = start(at, &format!("{predict} --out killed"));
    let done = |folder: &Path| {
        let files = fs::read_dir(folder).into_iter().flatten();
        files
            .filter(|e| {
                e.as_ref()
                    .is_ok_and(|e| e.path().extension() == Some("json".as_ref()))
            })
            .count()
    };
    // The manifest and two sidecars.
    while done(&at.join("killed")) < 3 && child.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(1));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    ok(at, &format!("{predict} --out killed"));
    assert_same(&outputs(&at.join("killed")), &whole);

    // Possible after a kill: outputs without a sidecar, a temporary file, a truncated file.
    let out = at.join("killed");
    fs::remove_file(out.join("0000000004.json")).unwrap();
    fs::write(out.join(".0000000004_depth.npy.71-3.partial"), "half").unwrap();
    fs::write(out.join("0000000007.ply"), "half").unwrap();
    fs::remove_file(out.join("0000000009_depth.png")).unwrap();
    // Possible after a power cut: zeros in an output and a sidecar that were not on the disk yet; half a sidecar.
    let zeros = |name: &str| {
        let file = out.join(name);
        let bytes = fs::metadata(&file).unwrap().len();
        fs::write(&file, vec![0; bytes as usize]).unwrap();
    };
    zeros("0000000011_depth.npy");
    zeros("0000000013.json");
    let sidecar = fs::read(out.join("0000000015.json")).unwrap();
    fs::write(out.join("0000000015.json"), &sidecar[..sidecar.len() / 2]).unwrap();
    // A sidecar of an older program, without checksums of its files.
    let mut older = json(&out.join("0000000017.json"));
    older.as_object_mut().unwrap().remove("file_crc32").unwrap();
    fs::write(out.join("0000000017.json"), older.to_string()).unwrap();
    let again = ok(at, &format!("{predict} --out killed"));
    assert!(
        again.stderr.contains("7 images written"),
        "{}",
        again.stderr
    );
    assert_same(&outputs(&out), &whole);
}

#[test]
#[cfg(unix)]
fn an_interrupt_finishes_the_images_at_work() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    prepare(at);
    for signal in ["INT", "TERM"] {
        stopped_by(at, signal);
    }
}

fn stopped_by(at: &Path, signal: &str) {
    let out = at.join(signal);
    let predict = format!("predict --model run {DRIVE} {SAVE} --out {signal}");
    let mut child = start(at, &predict);
    // The manifest is written before the first image, and after the handler is set.
    let manifest = out.join("predict-1-of-1.manifest.json");
    while !manifest.exists() && child.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(1));
    }
    let pid = child.id().to_string();
    let with = format!("-{signal}");
    let sent = Command::new("kill").args([&with, &pid]).status().unwrap();
    assert!(sent.success());
    let code = child.wait().unwrap().code();
    let done = |state| {
        let manifest = json(&manifest);
        let images = manifest["images"].as_array().unwrap();
        images
            .iter()
            .filter(|image| image["state"] == state)
            .count()
    };
    // The run may have ended before the signal.
    assert_eq!(code, Some(if done("done") == 30 { 0 } else { 130 }));
    let names = outputs(&out);
    assert_eq!(names.len(), done("done") * 4, "{:?}", names.keys());
    ok(at, &predict);
    assert_eq!(done("done"), 30);
    assert_eq!(outputs(&out).len(), 30 * 4);
}

#[test]
fn a_broken_image_is_named_and_the_others_are_done() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    prepare(at);
    let broken = at.join(DRIVE).join("0000000011.png");
    let whole = fs::read(&broken).unwrap();
    fs::write(&broken, &whole[..whole.len() / 2]).unwrap();
    let predict = format!("predict --model run {DRIVE} {SAVE} --out out");
    fails(
        at,
        &predict,
        &[
            "1 of 30 images failed",
            "0000000011.png: the image is truncated",
        ],
    );
    assert_eq!(outputs(&at.join("out")).len(), 29 * 4);
    let manifest = json(&at.join("out/predict-1-of-1.manifest.json"));
    assert_eq!(manifest["images"][11]["state"], "failed");
    assert!(
        manifest["images"][11]["error"]
            .as_str()
            .unwrap()
            .contains("truncated")
    );
    fs::write(&broken, &whole).unwrap();
    let mended = ok(at, &predict);
    assert!(
        mended.stderr.contains("1 image written") && mended.stderr.contains("29 existed already"),
        "{}",
        mended.stderr
    );
}

#[test]
fn existing_outputs_are_kept_only_if_nothing_changed() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    prepare(at);
    let predict = |more: &str| format!("predict --model run {DRIVE} --out out {more}");
    ok(at, &predict("--save npy"));
    fails(at, &predict("--save ply"), &["0000000000.json", "--save"]);
    fails(
        at,
        &predict("--save npy --intrinsics 60,120,47,31"),
        &["another camera (--hfov, --intrinsics, --calib)"],
    );
    fails(at, &predict("--save npy --stretch"), &["--stretch"]);
    ok(at, "train --out run --resume --steps 2");
    fails(at, &predict("--save npy"), &["other weights"]);
    let again = ok(at, &predict("--save npy --overwrite"));
    assert!(
        again.stderr.contains("30 images written"),
        "{}",
        again.stderr
    );

    // Another image at the same path.
    let image = at.join(DRIVE).join("0000000002.png");
    fs::copy(at.join(DRIVE).join("0000000003.png"), &image).unwrap();
    fails(
        at,
        &predict("--save npy"),
        &["0000000002.png has changed since"],
    );
    let again = ok(at, &predict("--save npy --overwrite"));
    assert!(again.stderr.contains("1 image written"), "{}", again.stderr);
    assert_eq!(
        fs::read(at.join("out/0000000002_depth.npy")).unwrap(),
        fs::read(at.join("out/0000000003_depth.npy")).unwrap()
    );

    // Files that this program did not write.
    fs::create_dir(at.join("other")).unwrap();
    fs::write(at.join("other/0000000005_depth.npy"), "mine").unwrap();
    fails(
        at,
        &format!("predict --model run {DRIVE} --out other --save npy"),
        &["0000000005_depth.npy"],
    );
    assert_eq!(
        fs::read(at.join("other/0000000005_depth.npy")).unwrap(),
        b"mine"
    );
}

#[test]
fn the_pictures_of_a_recording_become_a_video() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    prepare(at);
    let predict = "predict --model run sim --save video";
    // Refused before any work: videos of a shard, and videos without ffmpeg.
    let shard = format!("{predict} --out out --shard 1/2");
    fails(at, &shard, &["--save video", "a shard has only some"]);
    let without = Command::new(env!("CARGO_BIN_EXE_deepfusion"))
        .current_dir(at)
        .args(format!("{predict} --out out").split_whitespace())
        .env("PATH", at)
        .output()
        .unwrap();
    let printed = String::from_utf8(without.stderr).unwrap();
    assert!(
        !without.status.success() && printed.contains("ffmpeg is needed to write videos"),
        "{printed}"
    );
    assert!(!at.join("out").exists());
    let there = Command::new("ffmpeg").arg("-version").output();
    if !there.is_ok_and(|o| o.status.success()) {
        eprintln!("skipped: there is no ffmpeg that could write a video");
        return;
    }
    // Shards write the pictures; one more run makes the video.
    for i in 1..=2 {
        let args =
            format!("predict --model run sim --save side-by-side,npy --out out --shard {i}/2");
        ok(at, &args);
    }
    ok(at, "predict --model run sim --save video,npy --out out");
    let video = "2026_01_01_drive_0003_sync_video.mp4";
    let made = outputs(&at.join("out"));
    assert_eq!(made.len(), 30 * 3 + 1, "{:?}", made.keys());
    assert!(made[video].len() > 1000, "{:?}", made.keys());
    // With a known camera, a video is a recording, too: the drive's frames, of which the last is named twice.
    fs::write(at.join("out/intrinsics.txt"), "50,50,48,32").unwrap();
    let inspected = ok(at, &format!("data inspect out/{video}"));
    assert!(
        inspected.stdout.contains("31 frames"),
        "{}",
        inspected.stdout
    );
    // Made again, it is the same; a file that this program did not write is not replaced unasked.
    ok(at, "predict --model run sim --save video,npy --out out");
    fs::create_dir(at.join("other")).unwrap();
    fs::write(at.join("other").join(video), "mine").unwrap();
    fails(
        at,
        &format!("{predict} --out other"),
        &[video, "--overwrite"],
    );
    assert_eq!(fs::read(at.join("other").join(video)).unwrap(), b"mine");
    ok(at, &format!("{predict} --out other --overwrite"));
    assert!(fs::read(at.join("other").join(video)).unwrap().len() > 1000);
}
