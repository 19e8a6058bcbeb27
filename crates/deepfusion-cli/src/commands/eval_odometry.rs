use std::path::Path;

use deepfusion_data::OpenOptions;
use deepfusion_eval::odometry::{OdometryReport, PoseFile, TrackPair};
use deepfusion_jobs::odometry::{OdometryWarning, tracks, write_track};
use deepfusion_runtime::ModelSource;
use deepfusion_train::PosePredictor;

use super::clocks;
use super::recordings::open_aimed;
use crate::allocator;
use crate::cli::EvalOdometryArgs;
use crate::error::CliError;
use crate::failure::Result;
use crate::model::{self, ModelFacts};
use crate::progress::Progress;
use crate::{devices, output};

/// `deepfusion eval-odometry`.
pub(super) fn run(args: &EvalOdometryArgs) -> Result<()> {
    let (tracks, truth) = match (&args.pred, &args.gt) {
        (Some(predicted), Some(truth)) => {
            let (predicted, truth) = (PoseFile::read(predicted)?, PoseFile::read(truth)?);
            let name = truth.path.display().to_string();
            (vec![predicted.beside(&truth)?], name)
        }
        _ => from_model(args)?,
    };
    let report = OdometryReport::of(&tracks, truth);
    if let Some(out) = &args.out {
        let out = output::run_folder(Some(out), "eval-odometry")?;
        for track in &tracks {
            write_track(&out, track)?;
        }
    }
    if args.json {
        output::print_json(&report)
    } else {
        output::print(&report.to_string())
    }
}

/// The pose network's motions between consecutive frames, chained, with the drives' true paths.
fn from_model(args: &EvalOdometryArgs) -> Result<(Vec<TrackPair>, String)> {
    allocator::keep_memory();
    let model = args.model.as_deref().unwrap_or(Path::new("."));
    let source = model::named(model)?;
    if let ModelSource::Packed { .. } = source {
        let model = source.name();
        return Err(CliError::NoPoseNet { model }.into());
    }
    let predictor = PosePredictor::load(model, args.set.as_deref(), &devices::open(args.device)?)?;
    let mut options = OpenOptions {
        camera: args.camera,
        topics: args.topics.clone(),
        assumed_camera: source.assumed_camera(args.set.as_deref())?,
        ..OpenOptions::default()
    };
    options.camera_ahead_s = clocks::seconds(args.clock_offset, &args.data, &options)?;
    let datasets = open_aimed(&args.data, &options)?;
    let mut progress = Progress::new("predicting motion");
    let mut warn = |warning: OdometryWarning| tracing::warn!("{warning}");
    let found = tracks(&predictor, &datasets, &mut warn, &mut |done, total| {
        progress.set(done, total);
    });
    let (tracks, truth) = found?;
    Ok((tracks, truth.to_owned()))
}
