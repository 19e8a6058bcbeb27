//! Which trained network to use: the one of `--model`, or the embedded one.

use std::path::Path;

use deepfusion_eval::PostProcess;
pub(crate) use deepfusion_jobs::ModelFacts;
use deepfusion_model::TrainConfig;
use deepfusion_runtime::{ModelSource, hidden_by_run};

use crate::error::CliError;
use crate::failure::Result;
use crate::progress::say;

/// The network of `--model`; without it the embedded default, whose name is printed.
///
/// # Errors
/// As [`ModelSource::named`]; [`CliError::NoModelGiven`] without `--model` if no network is embedded.
pub(crate) fn chosen(asked: Option<&Path>) -> Result<ModelSource> {
    match asked {
        Some(model) => named(model),
        None => embedded_default()?.ok_or_else(|| CliError::NoModelGiven.into()),
    }
}

/// The network of a path or a name; warns if a run hides an embedded network of that name.
///
/// # Errors
/// As [`ModelSource::named`].
pub(crate) fn named(model: &Path) -> Result<ModelSource> {
    warn_of_hidden(model);
    let source = ModelSource::named(model)?;
    // An unreadable calibration is an error only for code that needs it.
    for stale in source.stale_calibrations().unwrap_or_default() {
        tracing::warn!("{stale}");
    }
    Ok(source)
}

/// Warns if a run hides an embedded network of that name.
pub(crate) fn warn_of_hidden(model: &Path) {
    if let Some(hidden) = hidden_by_run(model) {
        tracing::warn!("{hidden}");
    }
}

/// The network that is used without `--model`, whose name is printed; none if this build embeds none.
///
/// # Errors
/// As [`ModelSource::embedded_default`].
pub(crate) fn embedded_default() -> Result<Option<ModelSource>> {
    let source = ModelSource::embedded_default()?;
    if let Some(ModelSource::Packed { network, .. }) = &source {
        say(&format!(
            "no --model given: using the embedded network `{}` of {}",
            network.card.name, network.card.date
        ));
    }
    Ok(source)
}

/// Warns if several input sizes are asked of a run that was trained at one: the result may then be worse than a single prediction.
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
            "--post-process {}: the run was trained only at {}x{} and may be worse at other sizes; compare `eval` with and without it",
            how.map_or("", PostProcess::name),
            config.size.width,
            config.size.height
        );
    }
}
