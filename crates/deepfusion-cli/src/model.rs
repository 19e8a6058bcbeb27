//! Which trained network is meant: `--model`, or the one that the program carries; and what the command line says of it.

use std::path::Path;

use deepfusion_eval::IntervalFactors;
use deepfusion_eval::compare::{MetricScale, sha256_of_file};
use deepfusion_runtime::ModelSource;
use sha2::{Digest, Sha256};

use crate::commands::uncertainty;
use crate::error::CliError;
use crate::failure::{Context, Result};
use crate::output;
use crate::progress::say;

/// What `--model` says; without it the network that the program carries, which is printed.
///
/// # Errors
/// As [`ModelSource::named`]; [`CliError::NoModelGiven`] without `--model` where no network is embedded.
pub fn chosen(asked: Option<&Path>) -> Result<ModelSource> {
    match asked {
        Some(model) => Ok(ModelSource::named(model)?),
        None => embedded_default()?.ok_or_else(|| CliError::NoModelGiven.into()),
    }
}

/// The network that is meant without `--model`, which is printed; none where this build has none.
///
/// # Errors
/// As [`ModelSource::embedded_default`].
pub fn embedded_default() -> Result<Option<ModelSource>> {
    let source = ModelSource::embedded_default()?;
    if let Some(ModelSource::Packed { network, .. }) = &source {
        say(&format!(
            "no --model: the embedded network `{}` of {} is used",
            network.card.name, network.card.date
        ));
    }
    Ok(source)
}

/// What else there is to say of a network.
pub trait ModelFacts {
    /// Its name, for people.
    fn name(&self) -> String;

    /// SHA-256 of the weights' file, in hexadecimal.
    ///
    /// # Errors
    /// Where it cannot be read.
    fn sha256(&self) -> Result<String>;

    /// SHA-256 of configuration, weights and the factors of the intervals: all that what it predicts depends on.
    ///
    /// # Errors
    /// Where they cannot be read.
    fn content_sha256(&self) -> Result<String>;

    /// The factors of the intervals of a network that says how sure it is: those found for it, else it is taken at its word.
    ///
    /// # Errors
    /// For a file or a card that holds none.
    fn interval_factors(&self) -> Result<IntervalFactors>;

    /// What evaluations that the run's folder keeps say of this checkpoint's metres, with the metres of a data set, for a network that
    /// has learned for `steps`. A packed network keeps none.
    ///
    /// # Errors
    /// As [`Self::sha256`].
    fn scale(&self, set: Option<&str>, focal_correction: bool, steps: usize)
    -> Result<MetricScale>;
}

impl ModelFacts for ModelSource {
    fn name(&self) -> String {
        match self {
            Self::Run { folder, .. } => output::name_of(folder.path()),
            Self::Packed { network, .. } => network.card.name.clone(),
        }
    }

    fn sha256(&self) -> Result<String> {
        Ok(match self {
            Self::Run { folder, kind, .. } => sha256_of_file(&folder.checkpoint_path(*kind))?,
            Self::Packed { network, .. } => network.card.sha256.clone(),
        })
    }

    fn content_sha256(&self) -> Result<String> {
        let mut hash = Sha256::new();
        match self {
            Self::Run { folder, kind, .. } => {
                for path in [folder.config_path(), folder.checkpoint_path(*kind)] {
                    let failed = |e| deepfusion_data::Error::file(&path, e);
                    // In pieces: a checkpoint may be larger than what predicting takes.
                    let mut file = std::fs::File::open(&path).map_err(failed)?;
                    std::io::copy(&mut file, &mut hash).map_err(failed)?;
                }
            }
            Self::Packed { network, .. } => {
                hash.update(network.card.config.to_string());
                hash.update(&network.card.sha256);
            }
        }
        let factors = self.interval_factors()?;
        if factors.is_calibrated() {
            hash.update(toml::to_string(&factors)?);
        }
        Ok(format!("{:x}", hash.finalize()))
    }

    fn interval_factors(&self) -> Result<IntervalFactors> {
        let found = match self {
            Self::Run { folder, .. } => uncertainty::read(folder.path())?,
            Self::Packed { network, .. } => {
                let table = network.card.uncertainty.clone();
                let factors: Option<IntervalFactors> = table
                    .map(toml::Table::try_into)
                    .transpose()
                    .with_context(|| network.card.name.clone())?;
                if let Some(factors) = &factors {
                    let named = || network.card.name.clone();
                    factors.validate().with_context(named)?;
                }
                factors
            }
        };
        Ok(found.unwrap_or_else(IntervalFactors::uncalibrated))
    }

    fn scale(
        &self,
        set: Option<&str>,
        focal_correction: bool,
        steps: usize,
    ) -> Result<MetricScale> {
        let Some(folder) = self.folder() else {
            return Ok(MetricScale::default());
        };
        let sha256 = self.sha256()?;
        Ok(MetricScale::measured(
            folder,
            &sha256,
            set,
            focal_correction,
            steps,
        ))
    }
}
