//! `deepfusion predict`: images to metric depth, in bulk.

mod features;
mod inspection;
mod live;
mod made_with;
mod outputs;

use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::Once;

use clap::ValueEnum;
use deepfusion_data::{OpenOptions, RgbImage, calibration_near, load_photo};
use deepfusion_eval::IntervalFactors;
use deepfusion_eval::compare::MetricScale;
use deepfusion_geometry::Intrinsics;
use deepfusion_hint::count_of;
use deepfusion_jobs::bulk::pipeline::{self, Threads};
use deepfusion_jobs::bulk::{
    BulkJob, BulkProgress, CameraSource, Lock, PinholeImage, StartedJob, Summary, add_output,
    commit, queue, sidecar_path, write_unsynced, write_videos,
};
use deepfusion_jobs::evaluation::augmentation;
use deepfusion_jobs::scene::{DepthWatch, unwatched};
use deepfusion_jobs::{Input, intervals};
use deepfusion_records::{FileMark, LiveMark, MadeWith, PredictionRecord, ScaleRecord, Sidecar};
use deepfusion_runtime::LayerMaps;
use deepfusion_runtime::ModelSource;
use deepfusion_runtime::{DepthEstimator, Prediction, PreparedImage, Preparer};
use deepfusion_video::LiveFrame;
use deepfusion_video::{Address, can_write_video};

use super::live as sources;
use super::warnings;
use crate::cli::{CameraIntrinsics, Outputs, PredictArgs, PredictionArgs, Save, Shard};
use crate::error::CliError;
use crate::failure::{Context, Result};
use crate::model::{self, ModelFacts};
use crate::progress::{Progress, say};
use crate::{engine, interrupt, jobs, output};

/// What the names of pictures end with that are written of targets alone.
pub(super) const TARGET_PICTURES: [&str; 3] = ["_overlay.png", "_birds_eye.png", "_segments.png"];

/// What is the same for all images of a run.
pub(super) struct Job<'a> {
    args: &'a PredictionArgs,
    model: &'a ModelSource,
    outputs: Outputs,
    camera: CameraSource,
    /// Whether the network's run learned its camera.
    learned: bool,
    preparer: Preparer,
    made_with: MadeWith,
    step: usize,
    /// What was measured of the checkpoint's metres.
    scale: MetricScale,
    /// Where features are to be saved.
    inspector: Option<inspection::Inspector>,
    /// How the intervals are stretched that the network says.
    intervals: IntervalFactors,
    /// Warns once of cameras that nobody gave.
    camera_warning: Once,
    /// Warns once of a camera that looks like that of images of another size.
    size_warning: Once,
}

/// An image on its way through the network.
pub(super) struct Loaded {
    mark: FileMark,
    pub image: RgbImage,
    pub camera: Option<Intrinsics>,
    /// Where that comes from, in a word.
    camera_from: &'static str,
    /// Of a live source's frame.
    pub live: Option<LiveMark>,
}

/// What the network says about an image.
pub(super) struct Seen {
    pub prediction: Prediction,
    /// Empty where nobody asked for features.
    pub layers: Vec<LayerMaps>,
    /// Whether the metres hold, where that is watched.
    pub scale: Option<ScaleRecord>,
}

/// `deepfusion predict`.
pub(super) fn run(args: &PredictArgs) -> Result<()> {
    let PredictArgs {
        prediction, shard, ..
    } = args;
    let out = &prediction.out;
    check_videos(args)?;
    let model = model::chosen(prediction.model.as_deref())?;
    if let Some(address) = sources::source(&prediction.inputs, &prediction.live)? {
        return live::run(args, &model, &address);
    }
    let all = find_inputs(prediction, &model)?;
    check_watched(prediction, None, &all)?;
    if prediction.correct_scale && *shard != Shard::WHOLE {
        return Err(CliError::CorrectShard.into());
    }
    let mine: Vec<&Input> = shard.part_of(&all).collect();
    let mut estimator = engine::load(&model, &prediction.engine)?;
    let job = Job::new(prediction, args.outputs(), &model, &estimator)?;
    let camera_known = !matches!(job.camera, CameraSource::Unknown);
    if args.cloud() && !(camera_known || all.iter().all(|input| input.frame.is_some())) {
        return Err(CliError::NoCamera.into());
    }
    output::make_folder(out)?;
    interrupt::catch("stopping after the images at work; the same command goes on from there");
    let _lock = Lock::take(out, *shard)?;
    let begun = job.bulk(args).begin(&all, &mine, args.json);
    let StartedJob {
        manifest,
        sidecars,
        todo,
    } = begun.map_err(jobs::in_words)?;
    let mut shown = Progress::new("predicting");
    let watcher = |done, total| shown.set(done, total);
    let progress = BulkProgress::new(out, manifest, sidecars, watcher);
    predict(&job, &mut estimator, &mine, &todo, &progress);
    let mut summary = progress.finish();
    drop(shown);
    let sidecars = std::mem::take(&mut summary.sidecars);
    let (there, done) = (mine.len() - todo.len(), summary.done);
    // A full disk is reported once, as the reason for stopping.
    let outcome = outcome(summary)?;
    if outcome.is_ok() || done > there {
        say(&format!(
            "{} written to {}{}",
            count_of(done - there, "image"),
            out.display(),
            if there > 0 {
                format!(", {there} were there already")
            } else {
                String::new()
            }
        ));
    }
    if args.json {
        output::print_json(&sidecars)?;
    }
    outcome?;
    if args.video() {
        let written = write_videos(out, &all, outputs::ending(Save::SideBySide));
        print_videos(&written?);
    }
    Ok(())
}

/// Whether all images of a run are done, as an error for who started it; an error at once where the manifest could not be written.
fn outcome(summary: Summary<crate::failure::Failure>) -> Result<Result<()>> {
    let Summary {
        done,
        total,
        mut failures,
        stopped_by,
        manifest,
        ..
    } = summary;
    let failed = failures.len();
    if let Some(error) = stopped_by {
        return Ok(Err(error));
    }
    if failed == 1 && total == 1 {
        return Ok(Err(failures.remove(0).1));
    }
    if failed > 0 {
        let error = CliError::SomeFailed {
            hint: failures.iter().find_map(|(_, error)| error.hint()),
            failures: failures.iter().map(|(_, error)| error.one_line()).collect(),
            total,
            interrupted: interrupt::asked() && done + failed < total,
            resumes: true,
        };
        return Ok(Err(error.into()));
    }
    if done < total {
        let resumes = true;
        return Ok(Err(CliError::Interrupted {
            done,
            total,
            resumes,
        }
        .into()));
    }
    manifest?;
    Ok(Ok(()))
}

/// The images that the arguments mean; warnings of recordings among them are printed.
pub(super) fn find_inputs(args: &PredictionArgs, model: &ModelSource) -> Result<Vec<Input>> {
    let options = OpenOptions {
        assumed_camera: model.assumed_camera(args.engine.set.as_deref())?,
        ..args.open_options()
    };
    let mut found = deepfusion_jobs::find_inputs(&args.inputs, &options, warnings::print)?;
    // Where the outputs lie among the images: depth of a picture of depth means nothing.
    if let Ok(out) = args.out.canonicalize() {
        let images = found.len();
        found.retain(|input| input.frame.is_some() || !is_output(&out, &input.path));
        if found.is_empty() && images > 0 {
            let input = args.inputs.join(" ");
            return Err(CliError::OutputsAlone { input }.into());
        }
    }
    Ok(found)
}

/// Whether a picture lies in the folder of the outputs, given without links, and is one of them: the sidecar of an image lists it, or
/// targets were written beside it.
fn is_output(out: &Path, picture: &Path) -> bool {
    let name = picture.file_name().and_then(|name| name.to_str());
    let folder = picture.parent().map(|folder| {
        // A bare name lies in the current folder.
        if folder == Path::new("") {
            Path::new(".")
        } else {
            folder
        }
    });
    let folder = folder.and_then(|folder| folder.canonicalize().ok());
    let Some(name) = name.filter(|_| folder.as_deref() == Some(out)) else {
        return false;
    };
    let of_an_image = |save: &Save| {
        let image = name.strip_suffix(outputs::ending(*save));
        let listed = |sidecar: Sidecar| sidecar.files.iter().any(|file| file == name);
        image.is_some_and(|image| {
            let text = std::fs::read(sidecar_path(out, image)).unwrap_or_default();
            serde_json::from_slice(&text).is_ok_and(listed)
        })
    };
    let of_targets = |ending: &&str| {
        let image = name.strip_suffix(*ending);
        image.is_some_and(|image| out.join(format!("{image}_targets.json")).exists())
    };
    Save::value_variants().iter().any(of_an_image) || TARGET_PICTURES.iter().any(of_targets)
}

/// Whether an image is a file of its own, which whoever looks at its depth can open.
fn has_file(input: &Input) -> bool {
    let frame = input.frame.as_ref();
    frame.is_none_or(|(dataset, index)| dataset.frames()[*index].image.file().is_some())
}

/// That the scale monitor's options are not given where it would never look: they would change nothing, silently.
///
/// # Errors
/// [`CliError::Unwatched`].
pub(super) fn check_watched(
    args: &PredictionArgs,
    source: Option<&Address>,
    inputs: &[Input],
) -> Result<(), CliError> {
    let option = match args {
        args if args.correct_scale => "--correct-scale",
        args if args.camera_height.is_some() => "--camera-height",
        _ => return Ok(()),
    };
    let unwatched_for = |input: &dyn Display, why: &dyn Display| CliError::Unwatched {
        option,
        input: input.to_string(),
        why: why.to_string(),
    };
    if let Some(address) = source {
        return Err(unwatched_for(
            address,
            &"a live source has no measured motion",
        ));
    }
    match unwatched(inputs) {
        Some((input, why)) => Err(unwatched_for(&input, &why)),
        None => Ok(()),
    }
}

/// Says that the metres have changed.
pub(super) fn warn_of_drift(frame: &str, ratio: f64) {
    tracing::warn!(
        "{frame}: the scale has drifted: by the road, metres are {ratio:.2} times their initial size. Were the images zoomed, the camera \
         moved, or is the speed wrong? (scale_monitor in each frame's JSON; --correct-scale brings depth back)"
    );
}

/// Whether videos can be written in the end, to know before the work begins.
fn check_videos(args: &PredictArgs) -> Result<()> {
    if !args.video() {
        return Ok(());
    }
    if args.shard != Shard::WHOLE {
        return Err(CliError::VideoShard.into());
    }
    Ok(can_write_video(&args.prediction.out)?)
}

/// Says which videos were written, and how many frames each has.
fn print_videos(videos: &[(PathBuf, usize)]) {
    for (path, frames) in videos {
        say(&format!(
            "{}: {}",
            path.display(),
            count_of(*frames, "frame")
        ));
    }
}

/// Warns of a camera that nobody gave.
fn warn_of_assumed_camera(input: &Input) {
    // Recordings know where theirs would lie.
    let near = input.frame.is_none().then(|| calibration_near(&input.path));
    let remedy = match near.flatten() {
        Some(file) => format!("is this its calibration? --calib {}", file.display()),
        None => "give --intrinsics, --hfov or --calib".into(),
    };
    tracing::warn!(
        "no intrinsics given, and none in the image's EXIF: the training camera's field of view is assumed, so the metres are \
         only as right as that is (camera_known: false; {remedy})"
    );
}

/// How far a principal point may lie from the middle of the image, as a share of its side, in both axes and the same way: numbers of an
/// image half as large again are 0.25 off, those of a cut image in one axis alone.
const MOST_OFF: f64 = 0.2;

/// Whether given numbers look like those of images of another size.
fn is_of_another_size(k: &Intrinsics) -> bool {
    let off = |c: f64, size: u32| c / f64::from(size) - 0.5;
    let (x, y) = (off(k.cx, k.width), off(k.cy, k.height));
    x * y > 0.0 && x.abs().min(y.abs()) > MOST_OFF
}

fn warn_of_another_size(image: &Path, k: &Intrinsics) {
    tracing::warn!(
        "{}: the principal point {:.1}, {:.1} is far from the middle of {}x{}: are the numbers those of images of another size? \
         Metres are then wrong by the ratio of the two sizes",
        image.display(),
        k.cx,
        k.cy,
        k.width,
        k.height
    );
}

/// Warns of a camera that nobody gave, and that training found.
fn warn_of_learned_camera() {
    tracing::warn!(
        "no intrinsics given: the camera that the run learned is taken, so the metres are only as right as that is \
         (camera_known: false; give --intrinsics, --hfov or --calib)"
    );
}

fn predict(
    job: &Job,
    estimator: &mut DepthEstimator,
    mine: &[&Input],
    todo: &[usize],
    progress: &BulkProgress<crate::failure::Failure>,
) {
    let load = |i: usize| {
        let loaded = job.load(mine[todo[i]]);
        let failed = |e: crate::failure::Failure| {
            let why = e.one_line();
            progress.failed(todo[i], e, why);
        };
        let loaded = loaded.map_err(failed).ok();
        loaded.map(|(loaded, prepared)| (i, loaded, prepared))
    };
    let mut watch = DepthWatch::new(job.args.scale_config(), job.args.correct_scale);
    let infer = |(i, loaded, prepared): (usize, Loaded, PreparedImage)| {
        let seen = job.see(estimator, &prepared).map(|mut seen| {
            let (input, image) = (mine[todo[i]], &loaded.image);
            seen.scale = watch.observe(input, image, loaded.camera, &mut seen.prediction);
            if let Some(ratio) = watch.first_drift() {
                warn_of_drift(&input.name, ratio);
            }
            seen
        });
        (loaded, seen)
    };
    let (to_disk, written) = queue();
    let write = move |i: usize, (loaded, seen): (Loaded, Result<Seen>)| {
        match seen.and_then(|seen| job.write_outputs(mine[todo[i]], &loaded, &seen)) {
            // Fails only where the other thread has panicked, which ends the program below.
            Ok(sidecar) => drop(to_disk.send((todo[i], sidecar))),
            Err(error) => progress.stop(error),
        }
    };
    let stop = || interrupt::asked() || progress.stopped();
    let threads = Threads::for_this_machine();
    std::thread::scope(|scope| {
        scope.spawn(|| commit(progress, mine, &written));
        pipeline::run(todo.len(), threads, &stop, &load, infer, &write);
        // The committer ends with the last image written.
        drop(write);
    });
}

impl<'a> Job<'a> {
    /// The work that the arguments ask of a network.
    pub(super) fn new(
        args: &'a PredictionArgs,
        outputs: Outputs,
        model: &'a ModelSource,
        estimator: &DepthEstimator,
    ) -> Result<Self> {
        let says = |save: &Save| matches!(save, Save::Sigma | Save::Confidence);
        let wants_sigma = outputs.save.iter().any(says) || outputs.max_sigma.is_some();
        if wants_sigma && !estimator.knows_uncertainty() {
            return Err(CliError::NoUncertainty.into());
        }
        let given = args.intrinsics.map(CameraIntrinsics::numbers);
        let learned = estimator.config().learned_camera().is_some();
        let camera = match args.hfov {
            Some(degrees) => CameraSource::Hfov(degrees),
            None => {
                let trained = estimator.training_camera();
                match CameraSource::new(given, args.calib.as_deref(), trained)? {
                    CameraSource::Trained(k) if learned => CameraSource::Learned(k),
                    found => found,
                }
            }
        };
        let set = args.engine.set.as_deref();
        model::warn_of_one_size(model, estimator.config(), args.post_process);
        Ok(Self {
            args,
            model,
            made_with: made_with::made_with(args, &outputs, model, estimator, &camera)?,
            camera,
            learned,
            preparer: estimator.augmented(augmentation(args.post_process))?,
            step: estimator.step,
            intervals: model.interval_factors()?,
            camera_warning: Once::new(),
            size_warning: Once::new(),
            scale: model.scale(
                set,
                !args.no_focal_correction,
                args.post_process,
                estimator.step,
            )?,
            inspector: if outputs.save.contains(&Save::Features) {
                Some(inspection::open(&model.load(set)?, args.engine.device)?)
            } else {
                None
            },
            outputs,
        })
    }

    /// What there is of the job in its folder.
    fn bulk<'b>(&'b self, command: &PredictArgs) -> BulkJob<'b> {
        // Of a frame of a film more is kept than of a photograph: whatever it may be.
        let save = self.outputs.of_image(false).into_iter();
        BulkJob {
            folder: &self.args.out,
            endings: save.map(outputs::ending).collect(),
            made_with: &self.made_with,
            overwrite: self.args.overwrite,
            shard: command.shard,
            videos: command.video(),
        }
    }

    /// Everything that [`Self::write`] writes of an image of a file or a recording.
    pub(super) fn paths(&self, input: &Input) -> Vec<PathBuf> {
        let out = &self.args.out;
        let saves = self.outputs.of_image(has_file(input)).into_iter();
        let files = saves.map(|save| out.join(format!("{}{}", input.name, outputs::ending(save))));
        files.chain([sidecar_path(out, &input.name)]).collect()
    }

    /// Reads an image and makes it the network's input.
    pub(super) fn load(&self, input: &Input) -> Result<(Loaded, PreparedImage)> {
        // Before it is read: a change in between is then noticed by the next run.
        let failed = |e| deepfusion_data::Error::file(&input.path, e);
        let mark = FileMark::of(&input.path).map_err(failed)?;
        let taken = match &input.frame {
            Some((dataset, index)) => PinholeImage {
                image: dataset.load_image(*index)?,
                camera: Some(dataset.intrinsics(*index)),
                from: match (dataset.camera_assumed(), self.learned) {
                    (false, _) => "recording",
                    (true, false) => "assumed",
                    (true, true) => "learned",
                },
            },
            None => {
                let photo = load_photo(&input.path)?;
                let seen = self.camera.see(photo.image, photo.intrinsics);
                seen.with_context(|| input.path.display().to_string())?
            }
        };
        match taken.from {
            "assumed" => self
                .camera_warning
                .call_once(|| warn_of_assumed_camera(input)),
            "given" => {
                if let Some(k) = taken.camera.as_ref().filter(|k| is_of_another_size(k)) {
                    let warn = || warn_of_another_size(&input.path, k);
                    self.size_warning.call_once(warn);
                }
            }
            "learned" => self.camera_warning.call_once(warn_of_learned_camera),
            _ => {}
        }
        Ok(self.prepare(mark, taken))
    }

    /// Makes a live source's frame the network's input.
    pub(super) fn load_live(&self, frame: LiveFrame) -> Result<(Loaded, PreparedImage)> {
        let mark = FileMark::of_arrival(frame.image.as_raw().len() as u64, frame.arrived_at);
        let taken = self.camera.see(frame.image, None)?;
        Ok(self.prepare(mark, taken))
    }

    fn prepare(&self, mark: FileMark, taken: PinholeImage) -> (Loaded, PreparedImage) {
        let PinholeImage {
            image,
            camera,
            from,
        } = taken;
        let (correct, crop) = (!self.args.no_focal_correction, !self.args.stretch);
        let prepared = self
            .preparer
            .prepare(&image, camera.as_ref(), correct, crop);
        let loaded = Loaded {
            mark,
            image,
            camera,
            camera_from: from,
            live: None,
        };
        (loaded, prepared)
    }

    /// What the network says about an image, and what its layers do where that is asked for.
    pub(super) fn see(
        &self,
        estimator: &mut DepthEstimator,
        prepared: &PreparedImage,
    ) -> Result<Seen> {
        Ok(Seen {
            prediction: estimator.infer(prepared)?,
            layers: match (&self.inspector, prepared.largest()) {
                (Some(inspector), Some(view)) => inspector.inspect(&view.input, view.size),
                _ => Vec::new(),
            },
            scale: None,
        })
    }

    /// Writes an image's outputs, then its sidecar, without waiting for the disk.
    pub(super) fn write(&self, input: &Input, loaded: &Loaded, seen: &Seen) -> Result<Sidecar> {
        let sidecar = self.write_outputs(input, loaded, seen)?;
        write_unsynced(&sidecar, &self.args.out, &input.name)?;
        Ok(sidecar)
    }

    /// Writes an image's outputs without waiting for the disk, and gives the sidecar that is to be written once they are on it.
    fn write_outputs(&self, input: &Input, loaded: &Loaded, seen: &Seen) -> Result<Sidecar> {
        let (args, image, prediction) = (self.args, &loaded.image, &seen.prediction);
        let depth = prediction.depth();
        let has_sigma =
            |save: &Save| matches!(save, Save::Sigma | Save::Confidence) || save.is_cloud();
        let sigma = if self.outputs.save.iter().any(has_sigma) {
            intervals::sigma(prediction, &depth, &self.intervals)
        } else {
            None
        };
        let is_file = loaded.live.is_none() && has_file(input);
        let mut files = Vec::new();
        for save in self.outputs.of_image(is_file) {
            let file = format!("{}{}", input.name, outputs::ending(save));
            let path = args.out.join(&file);
            let maps = outputs::Maps {
                prediction,
                depth: &depth,
                layers: &seen.layers,
                sigma: sigma.as_ref(),
            };
            let limits = (self.outputs.max_depth_m, self.outputs.max_sigma);
            outputs::write(save, limits, image, loaded.camera.as_ref(), &maps, &path)?;
            files.push(file);
        }
        let known = depth.data.iter().copied().filter(|d| *d > 0.0);
        let ends = |[low, high]: [f32; 2], d: f32| [low.min(d), high.max(d)];
        let camera_word = loaded.camera_from;
        let record = PredictionRecord {
            image: Some(input.path.clone()),
            image_file: Some(loaded.mark),
            size: Some([image.width(), image.height()]),
            unit: "metres along the camera's axis (z)".into(),
            model: self.model.given().to_owned(),
            model_sha256: self.model.packed_sha256().map(str::to_owned),
            checkpoint_step: self.step,
            intrinsics: loaded.camera.map(|k| [k.fx, k.fy, k.cx, k.cy]),
            intrinsics_from: camera_word.into(),
            camera_known: matches!(camera_word, "given" | "recording" | "exif"),
            scale: self.scale,
            focal_factor: prediction.focal_factor,
            window: prediction.window,
            depth_m: known
                .map(|d| [d, d])
                .reduce(|ends_so_far, [d, _]| ends(ends_so_far, d)),
            scale_monitor: seen.scale,
        };
        let mut sidecar = Sidecar {
            prediction: record,
            files: Vec::new(),
            file_bytes: Vec::new(),
            file_crc32: Vec::new(),
            live: loaded.live,
            made_with: self.made_with.clone(),
        };
        for file in files {
            add_output(&mut sidecar, &args.out, file)?;
        }
        Ok(sidecar)
    }
}
