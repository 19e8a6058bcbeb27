//! `deepfusion eval-targets`: 3D targets against labelled boxes.

use std::sync::Arc;

use deepfusion_data::{Dataset, OpenOptions, save_png};
use deepfusion_jobs::evaluation::augmentation;
use deepfusion_jobs::labelled::{
    DepthSource, EvaluatedFrame, PredictedDepth, TargetEvaluation, is_folder_of,
};
use deepfusion_jobs::perception_settings;
use deepfusion_render::box_overlay;

use super::warnings;
use crate::cli::{EvalTargetsArgs, TargetDepth};
use crate::failure::Result;
use crate::model::{self, ModelFacts};
use crate::progress::Progress;
use crate::{engine, output};

/// `deepfusion eval-targets`.
pub(super) fn run(args: &EvalTargetsArgs) -> Result<()> {
    let source = source(args)?;
    let config = perception_settings(args.config.as_deref(), source.settings())?;
    let out = match &args.out {
        Some(out) => Some(output::run_folder(Some(out), "eval-targets")?),
        None => None,
    };
    // Saves the image with the targets drawn on it, if `--out` is given.
    let save = |frame: &EvaluatedFrame| -> Result<()> {
        if let Some(out) = &out {
            let picture = box_overlay(&(frame.image)()?, &frame.camera, frame.targets);
            save_png(&picture, &out.join(&frame.name))?;
        }
        Ok(())
    };
    let mut progress = Progress::new("frames");
    let mut evaluation = TargetEvaluation::new(source, config);
    for path in &args.data {
        if is_folder_of(path) {
            evaluation.object_frames(path, &mut |frame| save(&frame))?;
            continue;
        }
        let datasets = Dataset::open(path, &OpenOptions::default())?;
        warnings::print(&datasets);
        for dataset in datasets {
            evaluation.drive(&Arc::new(dataset), &mut |frame| {
                let (done, total) = frame.progress;
                progress.set(done, total);
                save(&frame)
            })?;
        }
    }
    let report = evaluation.report(args.post_process);
    if args.json {
        output::print_json(&report)
    } else {
        output::print(&report.to_string())
    }
}

fn source(args: &EvalTargetsArgs) -> Result<DepthSource> {
    Ok(match (args.depth, &args.model) {
        (None, Some(model)) => {
            let model = model::named(model)?;
            let estimator = engine::load(&model, &args.engine)?;
            model::warn_of_one_size(&model, estimator.config(), args.post_process);
            DepthSource::Network(Box::new(PredictedDepth {
                intervals: model.interval_factors()?,
                preparer: estimator.augmented(augmentation(args.post_process))?,
                estimator,
            }))
        }
        (Some(TargetDepth::Lidar), _) => DepthSource::Lidar,
        // The command line requires one of the two.
        (Some(TargetDepth::Truth), _) | (None, None) => DepthSource::Truth,
    })
}
