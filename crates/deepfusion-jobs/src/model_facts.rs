//! Facts about a network besides its predictions.

use std::path::{Path, PathBuf};

use deepfusion_eval::compare::{MetricScale, sha256_of_file};
use deepfusion_eval::{IntervalFactors, PostProcess};
use deepfusion_runtime::{ModelSource, Precision};
use sha2::{Digest, Sha256};

use crate::evaluation::confidence::Confidence;
use crate::{Error, Result, StaleCalibration, intervals};

/// The last part of a path, for people; for `.`, the folder's own name.
#[must_use]
pub fn name_of(path: &Path) -> String {
    let resolved = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let name = resolved.file_name().unwrap_or(resolved.as_os_str());
    name.to_string_lossy().into_owned()
}

/// Facts about a network besides its predictions.
pub trait ModelFacts {
    /// Its name, for people.
    fn name(&self) -> String;

    /// SHA-256 of the weights' file, in hexadecimal.
    ///
    /// # Errors
    /// A file that cannot be read.
    fn sha256(&self) -> Result<String>;

    /// SHA-256 of everything that its predictions depend on: configuration, weights, interval factors and, for int8, the calibration.
    ///
    /// # Errors
    /// A file that cannot be read.
    fn content_sha256(&self, precision: Precision) -> Result<String>;

    /// The interval factors of a network that predicts uncertainty; if none were measured, its intervals are used unchanged.
    ///
    /// # Errors
    /// A file or a card without factors.
    fn interval_factors(&self) -> Result<IntervalFactors>;

    /// Calibrations beside a run that were made for another step of its network, and are therefore not used.
    ///
    /// # Errors
    /// For a file that cannot be read.
    fn stale_calibrations(&self) -> Result<Vec<StaleCalibration>>;

    /// The scale of this checkpoint's depth according to the evaluations saved beside its run, for the metres of a data set and a network
    /// that was trained for `steps`. A packed network has no saved evaluations.
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
                    // In pieces: a checkpoint may be larger than the memory needed for predicting.
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
                let factors = factors.map_err(|source| Error::NetworkFile {
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
