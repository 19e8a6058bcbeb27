//! The evaluation of depth without ground truth.

use deepfusion_data::Dataset;
use deepfusion_eval::verdict::Verdict;
use deepfusion_jobs::evaluation::{EvaluationOutcome, UsedCheckpoint};
use deepfusion_jobs::held_out::unseen_by;
use deepfusion_jobs::scene::motion_known;
use deepfusion_jobs::verdict::{Unseen, VerdictOptions, VerdictWarning, verdict, verdict_page};
use deepfusion_model::TrainConfig;
use deepfusion_runtime::{DepthEstimator, ModelSource};

use crate::cli::EvalArgs;
use crate::commands::{command_line, warnings};
use crate::failure::Result;
use crate::progress::{Progress, say};

/// Whether no verdict is wanted: it was declined, ground truth or a split's frames are to be used, or post-processing changes the network's
/// own prediction.
pub(super) fn is_declined(args: &EvalArgs) -> bool {
    args.no_verdict || args.split.is_some() || args.gt.is_some() || args.post_process.is_some()
}

/// The verdict, if a recording contains the camera's motion and the verdict was not declined.
pub(super) fn of_model(
    args: &EvalArgs,
    model: &ModelSource,
    estimator: &mut DepthEstimator,
    datasets: &[Dataset],
) -> Result<Option<Verdict>> {
    if is_declined(args) || !datasets.iter().any(motion_known) {
        return Ok(None);
    }
    let unseen = if args.assume_unseen {
        Unseen::All
    } else {
        unseen_by(model, estimator.config(), datasets)?
    };
    let options = VerdictOptions::new(args.speed_error / 100.0, !args.no_focal_correction);
    let mut progress = Progress::new("evaluating without ground truth");
    let mut found = verdict(
        estimator,
        datasets,
        &unseen,
        &options,
        &mut |done, total| {
            progress.set(done, total);
        },
    )?;
    add_pose_speeds(
        args,
        (model, estimator.config()),
        datasets,
        (&unseen, &options),
        &mut found,
    )?;
    if let Some(warning) = VerdictWarning::of(&found) {
        warnings::warn_once(in_options(&warning));
    }
    Ok(Some(found))
}

/// A warning with the option that overrides it.
fn in_options(warning: &VerdictWarning) -> String {
    match warning {
        VerdictWarning::SeenNotKnown => {
            format!("{warning}; --assume-unseen assumes that it did not")
        }
        other => other.to_string(),
    }
}

/// Adds the vehicle's speed as predicted by the run's PoseNet.
#[cfg(feature = "train")]
fn add_pose_speeds(
    args: &EvalArgs,
    (model, config): (&ModelSource, &TrainConfig),
    datasets: &[Dataset],
    (unseen, options): (&Unseen, &VerdictOptions),
    found: &mut Verdict,
) -> Result<()> {
    use deepfusion_jobs::verdict::{metric_pose_net, pose_speeds_of};

    let Some(run) = metric_pose_net(model, config) else {
        return Ok(());
    };
    let device = crate::devices::open(args.engine.device)?;
    let pose_net = (run, args.engine.set.as_deref());
    match pose_speeds_of(pose_net, &device, datasets, unseen, options)? {
        Ok(speeds) => found.without_truth.pose_speeds = speeds,
        Err(warning) => warnings::warn_once(in_options(&warning)),
    }
    Ok(())
}

/// Without the training framework there is no PoseNet.
#[cfg(not(feature = "train"))]
fn add_pose_speeds(
    _: &EvalArgs,
    _: (&ModelSource, &TrainConfig),
    _: &[Dataset],
    _: (&Unseen, &VerdictOptions),
    _: &mut Verdict,
) -> Result<()> {
    Ok(())
}

/// The outcome of `eval` without ground truth.
pub(super) fn alone(
    args: &EvalArgs,
    model: &ModelSource,
    verdict: Option<Verdict>,
    checkpoint: UsedCheckpoint,
) -> Result<EvaluationOutcome> {
    if let (Some(path), Some(verdict)) = (&args.report, &verdict) {
        verdict_page(model, &args.data, verdict, &command_line::typed_again())?.write(path)?;
        say(&format!("report  {}", path.display()));
    }
    Ok(EvaluationOutcome {
        checkpoint: Some(checkpoint),
        report: None,
        verdict,
    })
}
