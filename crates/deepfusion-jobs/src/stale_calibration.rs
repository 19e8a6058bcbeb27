use std::fmt;
use std::path::PathBuf;

/// What was found for a network at one step, beside that of another: it is not used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StaleCalibration {
    /// The file.
    pub path: PathBuf,
    /// The step that it was found for, where it says so.
    pub found: Option<usize>,
    /// That of the network.
    pub step: usize,
}

impl fmt::Display for StaleCalibration {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let path = self.path.display();
        match self.found {
            Some(found) => write!(
                f,
                "{path}: found for the network of step {found}, not for this of step {}",
                self.step
            )?,
            None => write!(f, "{path}: does not say for which step it was found")?,
        }
        f.write_str("; it is not used, and can be found anew by `eval`")
    }
}
