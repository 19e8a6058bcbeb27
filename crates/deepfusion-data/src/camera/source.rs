//! Where a camera's calibration comes from.

use std::fmt;
use std::path::{Path, PathBuf};

/// Where a camera's calibration comes from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum CalibrationSource {
    /// The caller ([`crate::OpenOptions::intrinsics`], [`crate::OpenOptions::hfov_deg`]).
    Given,
    /// A file with this path.
    File(PathBuf),
}

impl From<PathBuf> for CalibrationSource {
    fn from(file: PathBuf) -> Self {
        Self::File(file)
    }
}

impl From<&Path> for CalibrationSource {
    fn from(file: &Path) -> Self {
        Self::File(file.to_owned())
    }
}

impl fmt::Display for CalibrationSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Given => f.write_str("given intrinsics"),
            Self::File(file) => write!(f, "{}", file.display()),
        }
    }
}
