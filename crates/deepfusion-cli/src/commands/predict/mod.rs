//! `deepfusion predict`: images to metric depth, in bulk.

mod inspection;
mod live;
mod made_with;

use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::Once;

use deepfusion_data::{OpenOptions, calibration_near};
use deepfusion_geometry::Intrinsics;
use deepfusion_hint::count_of;
use deepfusion_jobs::bulk::pipeline::{self, Threads};
use deepfusion_jobs::bulk::{
    BulkJob, BulkProgress, CameraFrom, CameraSource, ImageLoader, LoadedImage, Lock, PoorFit,
    StartedJob, Summary, commit, looks_of_another_size, queue, write_videos,
};
use deepfusion_jobs::evaluation::augmentation;
use deepfusion_jobs::outputs::{DepthOutput, DepthOutputs, DepthWriter, SeenDepth, is_output};
use deepfusion_jobs::scene::{DepthWatch, unwatched};
use deepfusion_jobs::{Error, Input};
use deepfusion_runtime::ModelSource;
use deepfusion_runtime::{DepthEstimator, PreparedImage};
use deepfusion_video::{Address, LiveFrame, can_write_video};

use super::live as sources;
use super::warnings;
use crate::cli::{CameraIntrinsics, PredictArgs, PredictionArgs, Shard};
use crate::error::CliError;
use crate::failure::Result;
use crate::model::{self, ModelFacts};
use crate::progress::{Progress, say};
use crate::{engine, interrupt, output};

/// What is the same for all images of a run.
pub(super) struct Job<'a> {
    args: &'a PredictionArgs,
    /// Reads each.
    pub loader: ImageLoader,
    /// Where features are to be saved.
    inspector: Option<inspection::Inspector>,
    /// Warns once of cameras that nobody gave.
    camera_warning: Once,
    /// Warns once of a camera that looks like that of images of another size.
    size_warning: Once,
    /// Warns once of an image that the network learned from nothing like.
    fit_warning: Once,
    /// Writes what is kept of each.
    pub writer: DepthWriter<'a>,
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
    let camera_known = !matches!(job.loader.camera, CameraSource::Unknown);
    if args.cloud() && !(camera_known || all.iter().all(|input| input.frame.is_some())) {
        return Err(Error::NoCamera.into());
    }
    output::make_folder(out)?;
    interrupt::catch("stopping after the images at work; the same command goes on from there");
    let _lock = Lock::take(out, *shard)?;
    let StartedJob {
        manifest,
        sidecars,
        todo,
    } = job.bulk(args).begin(&all, &mine, args.json)?;
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
        let written = write_videos(out, &all, DepthOutput::SideBySide.ending());
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
    let infer = |(i, loaded, prepared): (usize, LoadedImage, PreparedImage)| {
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
    let write = move |i: usize, (loaded, seen): (LoadedImage, Result<SeenDepth>)| {
        match seen.and_then(|seen| Ok(job.writer.write_outputs(mine[todo[i]], &loaded, &seen)?)) {
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
        outputs: DepthOutputs,
        model: &'a ModelSource,
        estimator: &DepthEstimator,
    ) -> Result<Self> {
        if outputs.need_uncertainty() && !estimator.knows_uncertainty() {
            return Err(Error::NoUncertainty.into());
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
        let features = outputs.save().contains(&DepthOutput::Features);
        let preparer = estimator.augmented(augmentation(args.post_process))?;
        let writer = DepthWriter {
            folder: &args.out,
            made_with: made_with::made_with(args, &outputs, model, estimator, &camera)?,
            outputs,
            intervals: model.interval_factors()?,
            scale: model.scale(
                set,
                !args.no_focal_correction,
                args.post_process,
                estimator.step,
            )?,
            model,
            step: estimator.step,
        };
        let inspector = if features {
            Some(inspection::open(&model.load(set)?, args.engine.device)?)
        } else {
            None
        };
        Ok(Self {
            args,
            loader: ImageLoader {
                camera,
                camera_learned: learned,
                preparer,
                focal_correction: !args.no_focal_correction,
                crop: !args.stretch,
            },
            inspector,
            camera_warning: Once::new(),
            size_warning: Once::new(),
            fit_warning: Once::new(),
            writer,
        })
    }

    /// What there is of the job in its folder.
    fn bulk<'b>(&'b self, command: &PredictArgs) -> BulkJob<'b> {
        // Of a frame of a film more is kept than of a photograph: whatever it may be.
        let save = self.writer.outputs.of_image(false).into_iter();
        BulkJob {
            folder: &self.args.out,
            endings: save.map(DepthOutput::ending).collect(),
            made_with: &self.writer.made_with,
            overwrite: self.args.overwrite,
            shard: command.shard,
            videos: command.video(),
        }
    }

    /// Reads an image, and warns where its camera may not be its own, or its size and shape are far from what the network takes.
    pub(super) fn load(&self, input: &Input) -> Result<(LoadedImage, PreparedImage)> {
        let (loaded, prepared) = self.loader.load(input)?;
        match loaded.camera_from {
            CameraFrom::Assumed => self
                .camera_warning
                .call_once(|| warn_of_assumed_camera(input)),
            CameraFrom::Given => {
                let camera = loaded.camera.as_ref();
                if let Some(k) = camera.filter(|k| looks_of_another_size(k)) {
                    let warn = || warn_of_another_size(&input.path, k);
                    self.size_warning.call_once(warn);
                }
            }
            CameraFrom::Learned => self.camera_warning.call_once(warn_of_learned_camera),
            _ => {}
        }
        self.warn_of_poor_fit(&input.path, &prepared);
        Ok((loaded, prepared))
    }

    /// Takes a live source's frame, and warns where its size and shape are far from what the network takes.
    pub(super) fn load_live(
        &self,
        input: &Input,
        frame: LiveFrame,
    ) -> Result<(LoadedImage, PreparedImage)> {
        let (loaded, prepared) = self.loader.load_live(frame)?;
        self.warn_of_poor_fit(&input.path, &prepared);
        Ok((loaded, prepared))
    }

    /// Warns of the first image that is far from what the network takes.
    fn warn_of_poor_fit(&self, image: &Path, prepared: &PreparedImage) {
        if let Some(fit) = PoorFit::of(&self.loader.preparer, prepared) {
            let warn =
                || tracing::warn!("{}: {fit} (others like it are not named)", image.display());
            self.fit_warning.call_once(warn);
        }
    }

    /// What the network says about an image, and what its layers do where that is asked for.
    pub(super) fn see(
        &self,
        estimator: &mut DepthEstimator,
        prepared: &PreparedImage,
    ) -> Result<SeenDepth> {
        Ok(SeenDepth {
            prediction: estimator.infer(prepared)?,
            layers: match (&self.inspector, prepared.largest()) {
                (Some(inspector), Some(view)) => inspector.inspect(&view.input, view.size),
                _ => Vec::new(),
            },
            scale: None,
        })
    }
}
