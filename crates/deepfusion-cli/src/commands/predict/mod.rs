//! `deepfusion predict`: images to metric depth, in bulk.

pub(super) mod camera;
mod committer;
mod features;
pub(super) mod inputs;
mod inspection;
mod ledger;
mod live;
mod manifest;
mod outputs;
mod resume;
pub(super) mod sidecar;
mod video;
mod watcher;

use std::sync::Once;

use deepfusion_data::{RgbImage, load_photo};
use deepfusion_eval::IntervalFactors;
use deepfusion_eval::compare::MetricScale;
use deepfusion_geometry::Intrinsics;
use deepfusion_runtime::LayerMaps;
use deepfusion_runtime::ModelSource;
use deepfusion_runtime::{DepthEstimator, Prediction, PreparedImage, Preparer};
use deepfusion_video::LiveFrame;
use rayon::prelude::*;

use self::camera::{CameraSource, Taken};
use self::inputs::Input;
use self::ledger::Ledger;
use self::manifest::{Lock, Manifest};
use self::sidecar::{FileMark, MadeWith, Sidecar};
use self::watcher::Watcher;
use super::live as sources;
use super::live::LiveMark;
use super::perceive::pictures;
use super::scene::{Scale, ScaleWatch};
use super::uncertainty;
use crate::cli::{Outputs, PredictArgs, PredictionArgs, Save, Shard};
use crate::engine;
use crate::error::CliError;
use crate::failure::{Context, Result};
use crate::model::{self, ModelFacts};
use crate::pipeline::{self, Threads};
use crate::progress::say;
use crate::{interrupt, output};

/// What is the same for all images of a run.
pub(super) struct Job<'a> {
    args: &'a PredictionArgs,
    model: &'a ModelSource,
    outputs: Outputs,
    camera: CameraSource,
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
    tell_assumed: Once,
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
    pub scale: Option<Scale>,
}

/// `deepfusion predict`.
pub fn run(args: &PredictArgs) -> Result<()> {
    let PredictArgs {
        prediction, shard, ..
    } = args;
    let out = &prediction.out;
    video::check(args)?;
    let model = model::chosen(prediction.model.as_deref())?;
    if let Some(address) = sources::source(&prediction.inputs, &prediction.live)? {
        return live::run(args, &model, &address);
    }
    let all = inputs::find(&prediction.inputs, &prediction.open_options())?;
    ScaleWatch::check(prediction, None, &all)?;
    if prediction.correct_scale && *shard != Shard::WHOLE {
        return Err(CliError::CorrectShard.into());
    }
    let mine: Vec<&Input> = shard.part_of(&all).collect();
    let mut estimator = engine::load(&model, &prediction.engine)?;
    let job = Job::new(prediction, args.outputs(), &model, &estimator)?;
    let camera_known = !matches!(job.camera, CameraSource::Unknown);
    if args.save.iter().any(|save| save.is_cloud())
        && !(camera_known || all.iter().all(|input| input.frame.is_some()))
    {
        return Err(CliError::NoCamera.into());
    }
    std::fs::create_dir_all(out).map_err(|e| deepfusion_data::Error::file(out, e))?;
    interrupt::catch("stopping after the images at work; the same command goes on from there");
    let _lock = Lock::take(out, *shard)?;
    let (ledger, todo) = begin(&job, args, &all, &mine)?;
    predict(&job, &mut estimator, &mine, &todo, &ledger);
    let summary = ledger.finish()?;
    let there = mine.len() - todo.len();
    say(&format!(
        "{} images written to {}{}",
        summary.done - there,
        out.display(),
        if there > 0 {
            format!(", {there} were there already")
        } else {
            String::new()
        }
    ));
    if args.json {
        output::print_json(&summary.sidecars)?;
    }
    summary.outcome?;
    if args.video() {
        video::write(out, &all)
    } else {
        Ok(())
    }
}

/// Warns of a camera that nobody gave.
fn tell_assumed() {
    tracing::warn!(
        "no intrinsics given, and none in the image's EXIF: the training camera's field of view is assumed, so the metres are \
         only as right as that is (camera_known: false; give --intrinsics or --calib)"
    );
}

/// Looks at what is there and writes the manifest; gives the images that are left to do, by their place in `mine`.
fn begin<'a>(
    job: &Job<'a>,
    command: &PredictArgs,
    all: &[Input],
    mine: &[&Input],
) -> Result<(Ledger<'a>, Vec<usize>)> {
    let args = job.args;
    let mut manifest = Manifest::new(command.shard, all, mine, job.made_with.clone());
    let before = Manifest::all(&args.out)?;
    if !args.overwrite {
        manifest.check_against(&before, &args.out)?;
        if command.video() {
            video::make_room(&args.out, all, &manifest, &before)?;
        }
    }
    resume::remove_partial_files(job, mine)?;
    let begun = manifest.begun(&before);
    let mut todo = Vec::new();
    let mut sidecars = vec![None; if command.json { mine.len() } else { 0 }];
    // Whatever is there is read, to see that it still is what was written.
    let found: Vec<Result<Option<Sidecar>>> = mine
        .par_iter()
        .map(|input| {
            let known = begun.contains(&(input.path.as_path(), input.name.as_str()));
            resume::finished(job, input, known)
        })
        .collect();
    for (i, found) in found.into_iter().enumerate() {
        match found? {
            None => todo.push(i),
            Some(sidecar) => {
                manifest.images[i].state = manifest::State::Done;
                if let Some(place) = sidecars.get_mut(i) {
                    *place = Some(sidecar);
                }
            }
        }
    }
    manifest.write(&args.out)?;
    // Again, now that ours can be seen: of two shards of different jobs started at once, one notices.
    let path = manifest.path(&args.out);
    let others = Manifest::all(&args.out)?;
    if !args.overwrite
        && let Err(error) = manifest.check_against(&others, &args.out)
    {
        std::fs::remove_file(&path).map_err(|e| deepfusion_data::Error::file(&path, e))?;
        return Err(error.into());
    }
    Ok((Ledger::new(&args.out, manifest, sidecars), todo))
}

fn predict(
    job: &Job,
    estimator: &mut DepthEstimator,
    mine: &[&Input],
    todo: &[usize],
    ledger: &Ledger,
) {
    let load = |i: usize| {
        let loaded = job.load(mine[todo[i]]);
        let loaded = loaded.map_err(|e| ledger.failed(todo[i], e)).ok();
        loaded.map(|(loaded, prepared)| (i, loaded, prepared))
    };
    let mut watcher = Watcher::of(job.args);
    let infer = |(i, loaded, prepared): (usize, Loaded, PreparedImage)| {
        let seen = job.see(estimator, &prepared).map(|mut seen| {
            seen.scale = watcher.look(mine[todo[i]], &loaded, &mut seen.prediction);
            seen
        });
        (loaded, seen)
    };
    let (to_disk, written) = committer::queue();
    let write = move |i: usize, (loaded, seen): (Loaded, Result<Seen>)| {
        match seen.and_then(|seen| job.write_outputs(mine[todo[i]], &loaded, &seen)) {
            // Fails only where the other thread has panicked, which ends the program below.
            Ok(sidecar) => drop(to_disk.send((todo[i], sidecar))),
            Err(error) => ledger.stop(error),
        }
    };
    let stop = || interrupt::asked() || ledger.stopped();
    let threads = Threads::for_this_machine();
    std::thread::scope(|scope| {
        scope.spawn(|| committer::commit(ledger, mine, &written));
        pipeline::run(todo.len(), threads, &stop, &load, infer, &write);
        // The committer ends with the last image written.
        drop(write);
    });
}

impl<'a> Job<'a> {
    /// The work that the arguments ask of a network.
    pub fn new(
        args: &'a PredictionArgs,
        outputs: Outputs,
        model: &'a ModelSource,
        estimator: &DepthEstimator,
    ) -> Result<Self> {
        let wants_sigma = outputs.save.contains(&Save::Sigma) || outputs.max_sigma.is_some();
        if wants_sigma && !estimator.knows_uncertainty() {
            return Err(CliError::NoUncertainty.into());
        }
        let camera = CameraSource::new(args, estimator.training_camera())?;
        let set = args.engine.set.as_deref();
        Ok(Self {
            args,
            model,
            made_with: MadeWith::new(args, &outputs, model, estimator, &camera)?,
            camera,
            preparer: estimator.preparer(),
            step: estimator.step,
            intervals: model.interval_factors()?,
            tell_assumed: Once::new(),
            scale: model.scale(set, !args.no_focal_correction, estimator.step)?,
            inspector: if outputs.save.contains(&Save::Features) {
                Some(inspection::open(&model.load(set)?, args.engine.device)?)
            } else {
                None
            },
            outputs,
        })
    }

    /// Reads an image and makes it the network's input.
    pub fn load(&self, input: &Input) -> Result<(Loaded, PreparedImage)> {
        // Before it is read: a change in between is then noticed by the next run.
        let mark = FileMark::of(&input.path)?;
        let taken = match &input.frame {
            Some((dataset, index)) => Taken {
                image: dataset.load_image(*index)?,
                camera: Some(dataset.intrinsics(*index)),
                from: "recording",
            },
            None => {
                let photo = load_photo(&input.path)?;
                let seen = self.camera.see(photo.image, photo.intrinsics);
                seen.with_context(|| input.path.display().to_string())?
            }
        };
        if taken.from == "assumed" {
            self.tell_assumed.call_once(tell_assumed);
        }
        Ok(self.prepare(mark, taken))
    }

    /// Makes a live source's frame the network's input.
    pub fn load_live(&self, frame: LiveFrame) -> Result<(Loaded, PreparedImage)> {
        let mark = FileMark::of_frame(&frame);
        let taken = self.camera.see(frame.image, None)?;
        Ok(self.prepare(mark, taken))
    }

    fn prepare(&self, mark: FileMark, taken: Taken) -> (Loaded, PreparedImage) {
        let Taken {
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
    pub fn see(&self, estimator: &mut DepthEstimator, prepared: &PreparedImage) -> Result<Seen> {
        Ok(Seen {
            prediction: estimator.infer(prepared)?,
            layers: match &self.inspector {
                Some(inspector) => inspector.inspect(&prepared.input, prepared.size),
                None => Vec::new(),
            },
            scale: None,
        })
    }

    /// Writes an image's outputs, then its sidecar, without waiting for the disk.
    pub fn write(&self, input: &Input, loaded: &Loaded, seen: &Seen) -> Result<Sidecar> {
        let sidecar = self.write_outputs(input, loaded, seen)?;
        sidecar.write_unsynced(&self.args.out, &input.name)?;
        Ok(sidecar)
    }

    /// Writes an image's outputs without waiting for the disk, and gives the sidecar that is to be written once they are on it.
    fn write_outputs(&self, input: &Input, loaded: &Loaded, seen: &Seen) -> Result<Sidecar> {
        let (args, image, prediction) = (self.args, &loaded.image, &seen.prediction);
        let depth = prediction.depth();
        let has_sigma = |save: &Save| *save == Save::Sigma || save.is_cloud();
        let sigma = if self.outputs.save.iter().any(has_sigma) {
            uncertainty::sigma(prediction, &depth, &self.intervals)
        } else {
            None
        };
        let mut files = Vec::new();
        for save in &self.outputs.save {
            let file = outputs::file_name(&input.name, *save);
            let path = args.out.join(&file);
            let maps = outputs::Maps {
                prediction,
                depth: &depth,
                layers: &seen.layers,
                sigma: sigma.as_ref(),
            };
            let limits = (self.outputs.max_depth_m, self.outputs.max_sigma);
            outputs::write(*save, limits, image, loaded.camera.as_ref(), &maps, &path)?;
            files.push(file);
        }
        if loaded.live.is_some() {
            // It is nowhere else, and depth is little without it.
            let file = format!("{}_image.jpg", input.name);
            let path = args.out.join(&file);
            pictures::save_jpeg(image, &path)?;
            files.push(file);
        }
        let known = depth.data.iter().copied().filter(|d| *d > 0.0);
        let ends = |[low, high]: [f32; 2], d: f32| [low.min(d), high.max(d)];
        let camera_word = loaded.camera_from;
        let mut sidecar = Sidecar {
            image: input.path.clone(),
            image_file: loaded.mark,
            size: [image.width(), image.height()],
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
            files: Vec::new(),
            file_bytes: Vec::new(),
            file_crc32: Vec::new(),
            live: loaded.live,
            made_with: self.made_with.clone(),
        };
        for file in files {
            sidecar.add(&args.out, file)?;
        }
        Ok(sidecar)
    }
}
