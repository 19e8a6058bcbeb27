use std::fmt;
use std::path::PathBuf;

/// A calibration made for a network at another step, which is not used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StaleCalibration {
    /// Path of its file.
    pub path: PathBuf,
    /// The step that it was made for, if the file contains it.
    pub found: Option<usize>,
    /// The network's step.
    pub step: usize,
}

impl fmt::Display for StaleCalibration {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let path = self.path.display();
        match self.found {
            Some(found) => write!(
                f,
                "{path}: measured for the network at step {found}, but the network is at step {}",
                self.step
            )?,
            None => write!(f, "{path}: does not say for which step it was measured")?,
        }
        f.write_str("; it is not used (`eval` can measure it again)")
    }
}
