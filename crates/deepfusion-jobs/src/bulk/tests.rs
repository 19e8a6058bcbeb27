//! Runs over a few small pictures, through the embedded `tiny`.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::{Duration, SystemTime};

use deepfusion_data::{Dataset, OpenOptions, RgbImage, save_png};
#[cfg(target_os = "linux")]
use deepfusion_hint::Hint;
use deepfusion_motion::ScaleMonitorConfig;
use deepfusion_perception::PerceptionConfig;
use deepfusion_runtime::{DepthEstimator, ModelSource, Precision};

use super::*;
use crate::outputs::{CloudLimits, DepthOutput, DepthOutputs, TargetOutput, without_outputs};
use crate::scene::MotionTracker;
use crate::{Error, Input, Result, TargetFinder, TargetSettings};

const CAMERA: [f64; 4] = [56.0, 56.0, 47.0, 31.0];

fn network() -> (ModelSource, DepthEstimator) {
    let model = ModelSource::named(Path::new("tiny")).unwrap();
    let network = model.load(None).unwrap();
    let estimator = DepthEstimator::fused(network, Precision::F32).unwrap();
    (model, estimator)
}

fn settings(camera: Option<GivenCamera>) -> DepthSettings {
    DepthSettings {
        camera,
        focal_correction: true,
        stretch: false,
        post_process: None,
        scale: ScaleMonitorConfig::default(),
        correct_scale: false,
        set: None,
        topics: Vec::new(),
        precision: Precision::F32,
        device: "cpu".into(),
    }
}

fn outputs() -> DepthOutputs {
    let limits = CloudLimits {
        max_depth_m: 80.0,
        max_sigma: None,
    };
    DepthOutputs::of([DepthOutput::Npy], true, limits)
}

/// Inputs of these names, in a folder with two pictures, `a` and `b`.
fn inputs(folder: &Path, names: &[&str]) -> Vec<Input> {
    let path = |name: &str| folder.join(format!("{name}.png"));
    for name in ["a", "b"] {
        if !path(name).exists() {
            save_png(&RgbImage::new(96, 64), &path(name)).unwrap();
        }
    }
    let input = |name: &&str| Input {
        path: path(name),
        name: (*name).to_owned(),
        frame: None,
    };
    names.iter().map(input).collect()
}

fn folder_for_outputs(folder: &Path) -> PathBuf {
    let out = folder.join("out");
    std::fs::create_dir_all(&out).unwrap();
    out
}

/// Predicts images of a folder; returns the summary and the warnings.
fn depth_of(folder: &Path, names: &[&str]) -> (Summary<Error>, Vec<ImageWarning>) {
    depth_of_all(folder, &inputs(folder, names))
}

fn depth_of_all(folder: &Path, all: &[Input]) -> (Summary<Error>, Vec<ImageWarning>) {
    let (model, mut estimator) = network();
    let given = Mutex::new(Vec::new());
    let warn = |warning: ImageWarning| given.lock().unwrap().push(warning);
    let out = folder_for_outputs(folder);
    let settings = settings(None);
    let job = DepthJob::new(settings, &out, outputs(), &model, &estimator, None, &warn).unwrap();
    let mine: Vec<&Input> = all.iter().collect();
    let begun = job.bulk(Shard::WHOLE, false, false).begin(all, &mine, true);
    let StartedJob {
        manifest,
        sidecars,
        todo,
    } = begun.unwrap();
    let why = |error: &Error| error.to_string();
    let progress = BulkProgress::new(&out, manifest, sidecars, why, |_, _| ());
    predict(&job, &mut estimator, &mine, &todo, &progress, &|| false);
    let summary = progress.finish();
    drop(job);
    (summary, given.into_inner().unwrap())
}

#[test]
fn depth_is_predicted_once_with_one_warning() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (summary, warned) = depth_of(at, &["a", "b", "missing"]);
    assert_eq!((summary.done, summary.total), (2, 3));
    assert!(summary.stopped_by.is_none());
    let failed: Vec<usize> = summary.failures.iter().map(|(i, _)| *i).collect();
    assert_eq!(failed, [2]);
    let assumed = |w: &&ImageWarning| matches!(w, ImageWarning::AssumedCamera { .. });
    assert_eq!(warned.iter().filter(assumed).count(), 1, "{warned:?}");
    let made_at = || {
        let made = std::fs::metadata(at.join("out/a_depth.npy")).unwrap();
        made.modified().unwrap()
    };
    let before = made_at();
    // Finished images are not processed again.
    let (again, warned) = depth_of(at, &["a", "b"]);
    assert_eq!((again.done, again.sidecars.len()), (2, 2));
    assert!(warned.is_empty(), "{warned:?}");
    assert_eq!(made_at(), before);
}

/// Depth of a picture of depth is meaningless, but a saved copy of the image is a valid input.
#[test]
fn outputs_are_not_inputs_in_any_folder() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (model, mut estimator) = network();
    let out = folder_for_outputs(at);
    let forms = [DepthOutput::DepthPng, DepthOutput::Image];
    let save = DepthOutputs::of(forms, true, outputs().limits);
    let job = DepthJob::new(
        settings(None),
        &out,
        save,
        &model,
        &estimator,
        None,
        &|_| (),
    );
    let job = job.unwrap();
    let all = inputs(at, &["a"]);
    let (loaded, prepared) = job.load(&all[0]).unwrap();
    let seen = job.predict(&mut estimator, &prepared).unwrap();
    job.writer.write(&all[0], &loaded, &seen).unwrap();
    let input = |file: &str| Input {
        path: out.join(file),
        name: file.to_owned(),
        frame: None,
    };
    let written = ["a_depth.png", "a_image.jpg"].map(input);
    assert!(written.iter().all(|input| input.path.exists()));
    let left = |folder: &Path| without_outputs(written.to_vec(), folder);
    assert_eq!(left(&at.join("other")), written[1..]);
    assert!(left(&out).is_empty());
}

/// The depth of another camera beside a new sidecar would be taken for that of the new camera.
#[test]
fn overwriting_removes_earlier_outputs() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    depth_of(at, &["a", "b"]);
    let out = at.join("out");
    // Targets found in that depth, and files of another program.
    std::fs::write(out.join("a_targets.json"), r#"{"frame": "a"}"#).unwrap();
    for file in ["a_overlay.png", "a_depth.txt", "c_depth.npy"] {
        std::fs::write(out.join(file), "x").unwrap();
    }
    let (model, mut estimator) = network();
    let save = DepthOutputs::of([DepthOutput::DepthPng], true, outputs().limits);
    let settings = settings(Some(GivenCamera::Numbers(CAMERA)));
    let job = DepthJob::new(settings, &out, save, &model, &estimator, None, &|_| ()).unwrap();
    // The earlier run's output of `b` stays: it is not made again.
    let all = inputs(at, &["a"]);
    let mine: Vec<&Input> = all.iter().collect();
    let begun = job.bulk(Shard::WHOLE, true, false).begin(&all, &mine, true);
    let StartedJob {
        manifest,
        sidecars,
        todo,
    } = begun.unwrap();
    let why = |error: &Error| error.to_string();
    let progress = BulkProgress::new(&out, manifest, sidecars, why, |_, _| ());
    predict(&job, &mut estimator, &mine, &todo, &progress, &|| false);
    assert_eq!(progress.finish().done, 1);
    for (file, stays) in [
        ("a_depth.png", true),
        ("a_depth.npy", false),
        ("a_targets.json", false),
        // No sidecar records that this program drew it.
        ("a_overlay.png", true),
        ("a_depth.txt", true),
        ("c_depth.npy", true),
        ("b_depth.npy", true),
    ] {
        assert_eq!(out.join(file).exists(), stays, "{file}");
    }
}

/// File names are bytes on Unix, but JSON is text.
#[cfg(target_os = "linux")]
#[test]
fn an_image_whose_name_is_not_utf_8_fails_alone() {
    use std::os::unix::ffi::OsStrExt;

    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut all = inputs(at, &["a", "b"]);
    let path = at.join(std::ffi::OsStr::from_bytes(b"b\xff.png"));
    std::fs::rename(at.join("b.png"), &path).unwrap();
    all[1].path = path;
    let (summary, _) = depth_of_all(at, &all);
    assert_eq!((summary.done, summary.total), (1, 2));
    assert!(summary.stopped_by.is_none());
    summary.manifest.unwrap();
    let [(1, error @ Error::NotText { .. })] = summary.failures.as_slice() else {
        panic!("{:?}", summary.failures);
    };
    assert!(
        error.hint().unwrap().contains("rename the image"),
        "{error}"
    );
}

/// Frames of a folder of images whose camera has this focal length.
fn frames(folder: &Path, focal_px: f64) -> Vec<Input> {
    inputs(folder, &["a", "b"]);
    let toml = format!("fps = 10\nintrinsics = [{focal_px}, {focal_px}, 47.5, 31.5]\n");
    std::fs::write(folder.join("dataset.toml"), toml).unwrap();
    let opened = Dataset::open(folder, &OpenOptions::default()).unwrap();
    let dataset = Arc::new(opened.into_iter().next().unwrap());
    let frame = |index: usize| Input {
        path: dataset.frames()[index].image.path().to_owned(),
        name: index.to_string(),
        frame: Some((Arc::clone(&dataset), index)),
    };
    (0..dataset.frames().len()).map(frame).collect()
}

/// A newly calibrated recording has other metres, and the scale monitor starts at the first frame.
#[test]
fn outputs_of_a_recording_stay_only_if_they_would_be_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let drive = at.join("drive");
    std::fs::create_dir_all(&drive).unwrap();
    let out = folder_for_outputs(at);
    let (model, mut estimator) = network();
    for correct_scale in [false, true] {
        let settings = DepthSettings {
            correct_scale,
            ..settings(None)
        };
        let job = DepthJob::new(settings, &out, outputs(), &model, &estimator, None, &|_| ());
        let job = job.unwrap();
        let begun = |all: &[Input], overwrite| {
            let mine: Vec<&Input> = all.iter().collect();
            let bulk = job.bulk(Shard::WHOLE, overwrite, false);
            bulk.begin(all, &mine, true)
        };
        let all = frames(&drive, 60.0);
        let mine: Vec<&Input> = all.iter().collect();
        let StartedJob {
            manifest,
            sidecars,
            todo,
        } = begun(&all, true).unwrap();
        assert_eq!(todo, [0, 1]);
        let why = |error: &Error| error.to_string();
        let progress = BulkProgress::new(&out, manifest, sidecars, why, |_, _| ());
        predict(&job, &mut estimator, &mine, &todo, &progress, &|| false);
        assert_eq!(progress.finish().done, 2);
        assert!(begun(&all, false).unwrap().todo.is_empty());
        let depth = format!("{}_depth.npy", all[1].name);
        std::fs::remove_file(out.join(depth)).unwrap();
        let again: &[usize] = if correct_scale { &[0, 1] } else { &[1] };
        assert_eq!(begun(&all, false).unwrap().todo, again);
        let Err(error) = begun(&frames(&drive, 61.0), false) else {
            panic!("another calibration must be an error");
        };
        assert!(error.to_string().contains("another calibration"), "{error}");
    }
}

/// A run with another number of shards is writing the same images.
#[test]
fn files_that_another_run_is_writing_stay() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (model, estimator) = network();
    let out = folder_for_outputs(at);
    let job = DepthJob::new(
        settings(None),
        &out,
        outputs(),
        &model,
        &estimator,
        None,
        &|_| (),
    );
    let job = job.unwrap();
    let all = inputs(at, &["a", "b"]);
    let mine: Vec<&Input> = all.iter().collect();
    let begin = || {
        let bulk = job.bulk(Shard::WHOLE, false, false);
        bulk.begin(&all, &mine, false).unwrap();
    };
    let partial = |name: &str, age_s: u64| {
        let path = out.join(name);
        let file = std::fs::File::create(&path).unwrap();
        let written = SystemTime::now() - Duration::from_secs(age_s);
        file.set_modified(written).unwrap();
        path
    };
    let new = partial(".a_depth.npy.17-00ab.partial", 0);
    let old = partial(".b_depth.npy.17-00ac.partial", 7200);
    let lock = Lock::take(&out, Shard { index: 1, count: 2 }).unwrap();
    begin();
    assert!(new.exists() && !old.exists());
    drop(lock);
    begin();
    assert!(!new.exists());
}

#[test]
fn each_recording_begins_once() {
    let folder = tempfile::tempdir().unwrap();
    let drives = ["monday", "tuesday"].map(|day| {
        let drive = folder.path().join(day);
        std::fs::create_dir(&drive).unwrap();
        frames(&drive, 60.0)
    });
    let mut motions = MotionTracker::default();
    let inputs = drives.iter().flatten();
    let begins: Vec<bool> = inputs
        .map(|input| motions.next(input).begins_recording)
        .collect();
    assert_eq!(begins, [true, false, true, false]);
}

/// Neither a job nor a frame saves pictures of layers if nothing shows the layers.
#[test]
fn pictures_of_layers_need_a_function_that_shows_them() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (model, mut estimator) = network();
    let out = folder_for_outputs(at);
    let warn = |_: ImageWarning| ();
    let job = |show: Option<ShowLayers>| {
        let save = DepthOutputs::of([DepthOutput::Features], true, outputs().limits);
        DepthJob::new(settings(None), &out, save, &model, &estimator, show, &warn)
    };
    assert!(matches!(job(None), Err(Error::NoLayers)));
    let nothing: ShowLayers = Box::new(|_, _| Vec::new());
    let job = job(Some(nothing)).unwrap();
    let all = inputs(at, &["a"]);
    let (loaded, prepared) = job.load(&all[0]).unwrap();
    let seen = job.predict(&mut estimator, &prepared).unwrap();
    let written = job.writer.write_outputs(&all[0], &loaded, &seen);
    assert!(matches!(written, Err(Error::NoLayers)));
    assert!(!out.join("a_features.png").exists());
}

/// Finds targets in two images and a missing one; `report` is called for each frame that is written.
fn targets_of(
    folder: &Path,
    report: impl FnMut(WrittenTargets<'_>) -> Result<()> + Send,
) -> TargetSummary<Error> {
    drawn_targets_of(folder, &[], report)
}

fn drawn_targets_of(
    folder: &Path,
    draw: &[TargetOutput],
    report: impl FnMut(WrittenTargets<'_>) -> Result<()> + Send,
) -> TargetSummary<Error> {
    let (model, mut estimator) = network();
    let out = folder_for_outputs(folder);
    let settings = settings(Some(GivenCamera::Numbers(CAMERA)));
    let warn = |_: ImageWarning| ();
    let job = DepthJob::new(settings, &out, outputs(), &model, &estimator, None, &warn).unwrap();
    let settings = TargetSettings {
        perception: PerceptionConfig::predicted(),
        instances: None,
        scale: ScaleMonitorConfig::default(),
        correct_scale: false,
        draw: draw.to_vec(),
    };
    let finder = TargetFinder::open(&model, &mut estimator, settings).unwrap();
    let all = inputs(folder, &["a", "missing", "b"]);
    perceive(&job, finder, &all, &|| false, report).unwrap()
}

#[test]
fn targets_are_written_and_reported_in_order() {
    let folder = tempfile::tempdir().unwrap();
    let mut reported = Vec::new();
    let mut lines = String::new();
    let summary = targets_of(folder.path(), |frame| {
        reported.push((frame.done, frame.total));
        lines += frame.line;
        Ok(())
    });
    assert_eq!((summary.done, summary.total), (2, 3));
    assert_eq!(summary.unreadable.len(), 1);
    assert!(summary.stopped_by.is_none() && summary.median_latency_ms().is_some());
    // The missing one was reported before the last.
    assert_eq!(reported.last(), Some(&(3, 3)));
    let names: Vec<bool> = lines.lines().map(|line| line.contains("\"a\"")).collect();
    assert_eq!(names, [true, false]);
    let out = folder.path().join("out");
    let written = std::fs::read_to_string(out.join("targets.jsonl")).unwrap();
    assert_eq!(written, lines);
    for file in ["a.json", "a_depth.npy", "a_targets.json", "b.json"] {
        assert!(out.join(file).is_file(), "{file}");
    }
}

/// Pictures of another run's targets would be taken for those of the new ones.
#[test]
fn overwriting_targets_removes_their_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let out = at.join("out");
    let draw = [TargetOutput::Overlay, TargetOutput::Ply];
    drawn_targets_of(at, &draw, |_| Ok(()));
    assert!(out.join("a_overlay.png").exists() && out.join("a.ply").exists());
    // A mask that the user keeps beside the outputs.
    std::fs::write(out.join("a_segments.png"), "x").unwrap();
    drawn_targets_of(at, &[TargetOutput::Ply], |_| Ok(()));
    for (file, stays) in [
        ("a_targets.json", true),
        ("a_overlay.png", false),
        // The old cloud is removed, the new one stays.
        ("a.ply", true),
        ("a_segments.png", true),
    ] {
        assert_eq!(out.join(file).exists(), stays, "{file}");
    }
    targets_of(at, |_| Ok(()));
    assert!(!out.join("a.ply").exists());
}

#[test]
fn a_run_ends_if_reporting_fails() {
    let folder = tempfile::tempdir().unwrap();
    let summary = targets_of(folder.path(), |_| Err(Error::NoCamera));
    assert!(matches!(summary.stopped_by, Some(Error::NoCamera)));
    assert_eq!(summary.done, 0);
}
