use std::path::Path;

use deepfusion_data::OpenOptions;
use deepfusion_eval::odometry::{
    OdometryReport, PoseFile, TrackPair, from_first, kitti_text, tum_text,
};
use deepfusion_geometry::Se3;
use deepfusion_jobs::odometry::tracks;
use deepfusion_render::TopView;
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

/// The pose network's motions between consecutive frames, chained, beside the drives' true paths.
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
    let mut progress = Progress::new("following");
    let found = tracks(&predictor, &datasets, &mut |done, total| {
        progress.set(done, total);
    });
    let (tracks, truth) = found?;
    Ok((tracks, truth.to_owned()))
}

/// Both paths in the world of their first pose, and their picture.
fn write_track(out: &Path, track: &TrackPair) -> Result<()> {
    let (truth, predicted) = (from_first(&track.truth), from_first(&track.predicted));
    for (what, poses) in [("truth", &truth), ("predicted", &predicted)] {
        let file = |kind: &str| out.join(format!("{}_{what}.{kind}", track.name));
        output::write(&file("txt"), kitti_text(poses))?;
        if track.times_s.len() == poses.len() {
            output::write(&file("tum"), tum_text(poses, &track.times_s))?;
        }
    }
    // From above: the first camera's x to the right, its z ahead.
    let seen = |poses: &[Se3]| -> Vec<[f64; 2]> {
        let place = |p: &Se3| [p.translation().x, p.translation().z];
        poses.iter().map(place).collect()
    };
    let title = format!("{}: {:.0} m from above", track.name, track.distance_m());
    let svg = TopView::new(title)
        .path("truth", seen(&truth))
        .path("predicted, unscaled", seen(&predicted))
        .to_svg();
    output::write(&out.join(format!("{}.svg", track.name)), svg)
}
