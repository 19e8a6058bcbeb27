//! What there is to say of a network beside what it predicts.

use std::path::{Path, PathBuf};

use deepfusion_eval::compare::{MetricScale, sha256_of_file};
use deepfusion_eval::{IntervalFactors, PostProcess};
use deepfusion_runtime::{ModelSource, Precision};
use sha2::{Digest, Sha256};

use crate::evaluation::confidence::Confidence;
use crate::{Error, Result, StaleCalibration, intervals};

/// The last part of a path, for people: a folder given as `.` by its own name.
#[must_use]
pub fn name_of(path: &Path) -> String {
    let whole = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let name = whole.file_name().unwrap_or(whole.as_os_str());
    name.to_string_lossy().into_owned()
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

    /// SHA-256 of configuration, weights, the factors of the intervals and, in int8, the calibration for it: all that what it predicts
    /// depends on.
    ///
    /// # Errors
    /// Where they cannot be read.
    fn content_sha256(&self, precision: Precision) -> Result<String>;

    /// The factors of the intervals of a network that says how sure it is: those found for it, else it is taken at its word.
    ///
    /// # Errors
    /// For a file or a card that holds none.
    fn interval_factors(&self) -> Result<IntervalFactors>;

    /// What is kept beside a run and was found for another step of its network: it is not used.
    ///
    /// # Errors
    /// For a file that cannot be read.
    fn stale_calibrations(&self) -> Result<Vec<StaleCalibration>>;

    /// What evaluations that the run's folder keeps say of this checkpoint's metres, with the metres of a data set, for a network that
    /// has learned for `steps`. A packed network keeps none.
    ///
    /// # Errors
    /// As [`Self::sha256`].
    fn scale(
        &self,
        set: Option<&str>,
        focal_correction: bool,
        post_process: Option<PostProcess>,
        steps: usize,
    ) -> Result<MetricScale>;
}

impl ModelFacts for ModelSource {
    fn name(&self) -> String {
        match self {
            Self::Run { folder, .. } => name_of(folder.path()),
            Self::Packed { network, .. } => network.card.name.clone(),
        }
    }

    fn sha256(&self) -> Result<String> {
        Ok(match self {
            Self::Run { folder, kind, .. } => sha256_of_file(&folder.checkpoint_path(*kind))?,
            Self::Packed { network, .. } => network.card.sha256.clone(),
        })
    }

    fn content_sha256(&self, precision: Precision) -> Result<String> {
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
        if precision == Precision::Int8
            && let Some(calibration) = self.int8()
        {
            hash.update(toml::to_string(&calibration)?);
        }
        Ok(format!("{:x}", hash.finalize()))
    }

    fn interval_factors(&self) -> Result<IntervalFactors> {
        let found = match self {
            Self::Run { folder, kind, .. } => {
                intervals::read(folder.path(), folder.read_state(*kind)?.step)?
            }
            Self::Packed { network, .. } => {
                let named = || PathBuf::from(&network.card.name);
                let table = network.card.uncertainty.clone();
                let factors: Result<Option<IntervalFactors>, _> =
                    table.map(toml::Table::try_into).transpose();
                let factors = factors.map_err(|source| Error::Kept {
                    path: named(),
                    source,
                })?;
                let checked = |factors| intervals::validated(factors, &named());
                factors.map(checked).transpose()?
            }
        };
        Ok(found.unwrap_or_else(IntervalFactors::uncalibrated))
    }

    fn stale_calibrations(&self) -> Result<Vec<StaleCalibration>> {
        let Self::Run { folder, kind, .. } = self else {
            return Ok(Vec::new());
        };
        let (run, step) = (folder.path(), folder.read_state(*kind)?.step);
        let both = [intervals::stale(run, step)?, Confidence::stale(run, step)?];
        Ok(both.into_iter().flatten().collect())
    }

    fn scale(
        &self,
        set: Option<&str>,
        focal_correction: bool,
        post_process: Option<PostProcess>,
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
            post_process,
            steps,
        ))
    }
}
