//! Calibration of a network for int8: the ranges of its convolutions' inputs.

use std::path::Path;
use std::sync::Arc;

use deepfusion_hint::Hint;
use deepfusion_infer::InputRanges;
use serde::{Deserialize, Serialize};

use crate::{Error, TomlProblem};

/// Name of the file in a run's folder.
const FILE: &str = "int8.toml";

/// The input ranges that int8 divides into 255 steps, for one checkpoint of a network.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Int8Calibration {
    /// The step of the calibrated checkpoint; after further training the ranges differ.
    pub step: usize,
    /// Number of images used for calibration.
    pub images: usize,
    /// Mean |ln(d / d₀)| of the depth d in int8 and d₀ in f32, over some of these images.
    pub deviation: f64,
    /// For each convolution that is computed in int8, by its name: the input range whose 255 steps lose least
    /// ([`deepfusion_infer::SeenInputs::ranges`]).
    pub ranges: InputRanges,
}

/// Why a calibration cannot be read.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationProblem {
    /// The file cannot be read, or is not text.
    #[error("{0}")]
    Unread(#[source] Arc<std::io::Error>),
    /// Not a valid calibration in TOML.
    #[error("{0}")]
    NotOne(#[source] TomlProblem),
}

impl From<toml::de::Error> for CalibrationProblem {
    fn from(error: toml::de::Error) -> Self {
        Self::NotOne(error.into())
    }
}

/// A calibration that cannot be read. It only matters if int8 is requested.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{origin}: {reason}")]
#[non_exhaustive]
pub struct UnreadableCalibration {
    /// Path of the file, or name of the network.
    pub origin: String,
    /// Why it cannot be read.
    #[source]
    pub reason: CalibrationProblem,
}

impl Hint for UnreadableCalibration {
    fn hint(&self) -> Option<String> {
        Some("calibrate the network again".into())
    }
}

impl Int8Calibration {
    /// Reads the calibration from a card's table; `name` is used in error messages.
    ///
    /// # Errors
    /// A table that is not a calibration.
    pub fn from_table(name: &str, table: toml::Table) -> Result<Self, UnreadableCalibration> {
        table
            .try_into()
            .map_err(|e: toml::de::Error| UnreadableCalibration {
                origin: name.to_owned(),
                reason: e.into(),
            })
    }

    /// The calibration of a run at this step; `None` if the run was not calibrated, or at another step.
    ///
    /// # Errors
    /// A file that is not a calibration, or cannot be read.
    pub fn of_run(folder: &Path, step: usize) -> Result<Option<Self>, UnreadableCalibration> {
        let path = folder.join(FILE);
        let unreadable = |reason: CalibrationProblem| UnreadableCalibration {
            origin: path.display().to_string(),
            reason,
        };
        let text = match std::fs::read_to_string(&path) {
            Ok(text) => text,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(unreadable(CalibrationProblem::Unread(e.into()))),
        };
        let found: Self = toml::from_str(&text).map_err(|e| unreadable(e.into()))?;
        Ok(Some(found).filter(|found| found.step == step))
    }

    /// Writes the calibration into a run's folder; returns the file's path.
    ///
    /// # Errors
    /// [`Error::NotToml`] if a value has no TOML form, [`Error::Io`].
    pub fn write(&self, folder: &Path) -> Result<std::path::PathBuf, Error> {
        let path = folder.join(FILE);
        let table = toml::to_string(self).map_err(|source| Error::NotToml {
            path: path.clone(),
            source,
        })?;
        let text = format!(
            "# The range of what each convolution reads, for inference in int8. Written by `weights calibrate`.\n{table}"
        );
        deepfusion_fs::write(&path, text).map_err(|e| Error::io(&path, "write", e))?;
        Ok(path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_calibration_is_read_back_for_its_own_step_only() {
        let run = tempfile::tempdir().unwrap();
        assert_eq!(Int8Calibration::of_run(run.path(), 7).unwrap(), None);
        let ranges = [("encoder.layer1.0.conv1".to_owned(), [-0.5, 3.25])].into();
        let calibration = Int8Calibration {
            step: 7,
            images: 32,
            deviation: 0.0125,
            ranges,
        };
        let path = calibration.write(run.path()).unwrap();
        let read = |step| Int8Calibration::of_run(run.path(), step).unwrap();
        assert_eq!(read(7), Some(calibration.clone()));
        assert_eq!(read(8), None);
        let again =
            Int8Calibration::from_table("card", toml::Table::try_from(&calibration).unwrap());
        assert_eq!(again.unwrap(), calibration);
        std::fs::write(&path, "step = 'seven'").unwrap();
        let error = Int8Calibration::of_run(run.path(), 7).unwrap_err();
        assert!(error.to_string().contains("int8.toml"), "{error}");
    }
}
