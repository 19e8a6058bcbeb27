//! Which trained network is meant: `--model`, or the one that the program carries.

use std::path::Path;

use deepfusion_eval::PostProcess;
pub(crate) use deepfusion_jobs::ModelFacts;
use deepfusion_model::TrainConfig;
use deepfusion_runtime::{ModelSource, hidden_by_run};

use crate::error::CliError;
use crate::failure::Result;
use crate::progress::say;

/// What `--model` says; without it the network that the program carries, which is printed.
///
/// # Errors
/// As [`ModelSource::named`]; [`CliError::NoModelGiven`] without `--model` where no network is embedded.
pub(crate) fn chosen(asked: Option<&Path>) -> Result<ModelSource> {
    match asked {
        Some(model) => named(model),
        None => embedded_default()?.ok_or_else(|| CliError::NoModelGiven.into()),
    }
}

/// The network of a path or a name; warns where that could mean an embedded network as well as the run that is taken.
///
/// # Errors
/// As [`ModelSource::named`].
pub(crate) fn named(model: &Path) -> Result<ModelSource> {
    warn_of_hidden(model);
    let source = ModelSource::named(model)?;
    // What cannot be read is an error of whoever needs it.
    for stale in source.stale_calibrations().unwrap_or_default() {
        tracing::warn!("{stale}");
    }
    Ok(source)
}

/// Warns where a name could mean an embedded network as well as the run that is taken.
pub(crate) fn warn_of_hidden(model: &Path) {
    if let Some(hidden) = hidden_by_run(model) {
        tracing::warn!("{hidden}");
    }
}

/// The network that is meant without `--model`, which is printed; none where this build has none.
///
/// # Errors
/// As [`ModelSource::embedded_default`].
pub(crate) fn embedded_default() -> Result<Option<ModelSource>> {
    let source = ModelSource::embedded_default()?;
    if let Some(ModelSource::Packed { network, .. }) = &source {
        say(&format!(
            "no --model: the embedded network `{}` of {} is used",
            network.card.name, network.card.date
        ));
    }
    Ok(source)
}

/// Warns where several input sizes are asked of a run that learned at one: it may then be worse than by one prediction.
pub(crate) fn warn_of_one_size(
    model: &ModelSource,
    config: &TrainConfig,
    how: Option<PostProcess>,
) {
    let several = matches!(
        how,
        Some(PostProcess::MultiScale | PostProcess::MultiScaleFlip)
    );
    let learned = &config.augmentation;
    let at_one = learned.sizes.is_empty() && learned.video_sizes.is_empty();
    if several && model.folder().is_some() && at_one {
        tracing::warn!(
            "--post-process {}: the run learned at {}x{} alone, and may be worse at other sizes; `eval` with and without it says",
            how.map_or("", PostProcess::name),
            config.size.width,
            config.size.height
        );
    }
}
