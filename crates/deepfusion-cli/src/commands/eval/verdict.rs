//! What is said of depth without ground truth.

use deepfusion_data::Dataset;
use deepfusion_eval::verdict::{NoCertificate, Verdict};
use deepfusion_jobs::evaluation::UsedCheckpoint;
use deepfusion_jobs::held_out::unseen_by;
use deepfusion_jobs::scene::motion_known;
use deepfusion_jobs::verdict::{Unseen, VerdictOptions, verdict};
use deepfusion_model::TrainConfig;
use deepfusion_render::HtmlReport;
use deepfusion_runtime::{DepthEstimator, ModelSource};

use super::EvalOutcome;
use crate::cli::EvalArgs;
use crate::commands::{run_report, warnings};
use crate::failure::Result;
use crate::model::ModelFacts;
use crate::output;
use crate::progress::{Progress, say};

/// Whether no verdict is wanted: it was declined, a split asks for its frames alone, or what is post-processed is no longer what the network
/// says.
pub(super) fn is_declined(args: &EvalArgs) -> bool {
    args.no_verdict || args.split.is_some() || args.gt.is_some() || args.post_process.is_some()
}

/// The verdict, where the recordings say how the camera moved and it was not declined.
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
    let mut progress = Progress::new("judging without ground truth");
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
    if found.no_certificate == Some(NoCertificate::SeenNotKnown) {
        let warning = "whether training saw these frames is not known, so there is no scale certificate; --assume-unseen takes it that \
                       it did not";
        warnings::warn_once(warning.to_owned());
    }
    Ok(Some(found))
}

/// What the run's PoseNet makes of the vehicle's speed.
#[cfg(feature = "train")]
fn add_pose_speeds(
    args: &EvalArgs,
    (model, config): (&ModelSource, &TrainConfig),
    datasets: &[Dataset],
    (unseen, options): (&Unseen, &VerdictOptions),
    found: &mut Verdict,
) -> Result<()> {
    use deepfusion_jobs::verdict::{pose_net_is_metric, pose_speeds};
    use deepfusion_train::PosePredictor;

    let ModelSource::Run { given, .. } = model else {
        return Ok(());
    };
    if !pose_net_is_metric(config) {
        return Ok(());
    }
    let device = crate::devices::open(args.engine.device)?;
    match PosePredictor::load(given, args.engine.set.as_deref(), &device) {
        Ok(predictor) => {
            found.without_truth.pose_speeds = pose_speeds(&predictor, datasets, unseen, options)?;
        }
        // Depth is judged all the same.
        Err(why) => {
            warnings::warn_once(format!(
                "PoseNet is not compared with the vehicle's speed: {why}"
            ));
        }
    }
    Ok(())
}

/// Without training's framework there is no PoseNet.
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

/// What `eval` finds where there is no ground truth.
pub(super) fn alone(
    args: &EvalArgs,
    model: &ModelSource,
    verdict: Option<Verdict>,
    checkpoint: UsedCheckpoint,
) -> Result<EvalOutcome> {
    if let (Some(path), Some(verdict)) = (&args.report, &verdict) {
        let names: Vec<_> = args.data.iter().map(|p| output::name_of(p)).collect();
        let title = format!("Depth judged without ground truth on {}", names.join(", "));
        let mut page = run_report::verdict(HtmlReport::new(model.name(), title), verdict);
        if let Some(folder) = model.folder() {
            page = run_report::training(page, folder)?;
        }
        let page = page
            .section("How it was measured")
            .command(&run_report::command());
        page.write(path)?;
        say(&format!("report  {}", path.display()));
    }
    Ok(EvalOutcome {
        checkpoint: Some(checkpoint),
        report: None,
        verdict,
    })
}
