use std::path::Path;

use deepfusion_jobs::averaging::{Kinship, StatisticsSpread, average};
use deepfusion_model::AveragedNetwork;

use crate::cli::AverageArgs;
use crate::failure::Result;
use crate::model::warn_of_hidden;
use crate::output;
use crate::progress::say;

/// What was made, for scripts.
#[derive(serde::Serialize)]
struct Made<'a> {
    checkpoint: &'a Path,
    networks: &'a [AveragedNetwork],
    /// Whether training of all of them started from the same network.
    related: bool,
    statistics: Option<&'a StatisticsSpread>,
}

/// `deepfusion weights average`.
pub(crate) fn run(args: &AverageArgs) -> Result<()> {
    for model in &args.models {
        warn_of_hidden(model);
    }
    let made = average(&args.models, args.shares.as_deref(), &args.out)?;
    for network in &made.networks {
        say(&format!(
            "{:.3} of {}",
            network.share,
            network.path.display()
        ));
    }
    match made.kinship {
        Kinship::Network => {}
        Kinship::FirstWeights => tracing::warn!(
            "these networks have only their random first weights in common (the same seed); the mean of such networks is often worse than each: evaluate it"
        ),
        Kinship::Unknown => tracing::warn!(
            "these networks may not have been trained from the same one; the mean of unrelated networks is useless"
        ),
    }
    if made.lost_uncertainty {
        tracing::warn!("some of these networks predict no uncertainty, so the mean predicts none");
    }
    if let Some(StatisticsSpread {
        layers,
        of,
        left_out,
        ..
    }) = made.statistics
    {
        tracing::warn!(
            "the running statistics of {layers} of {of} batch norms differ; their mean is not exact (the variance is too small by up to {:.2} %): evaluate this network \
             and the others; continuing training from it without frozen_statistics measures the statistics again",
            100.0 * left_out
        );
    }
    if args.json {
        return output::print_json(&Made {
            checkpoint: &made.checkpoint,
            networks: &made.networks,
            related: made.kinship == Kinship::Network,
            statistics: made.statistics.as_ref(),
        });
    }
    output::print(&format!("{}\n", made.checkpoint.display()))
}
