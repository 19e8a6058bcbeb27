//! Writes files and chooses their names.

use std::collections::HashSet;
use std::path::Path;

use deepfusion_data::Error as DataError;

/// Writes a file atomically.
pub(crate) fn write(path: &Path, bytes: impl AsRef<[u8]>) -> Result<(), DataError> {
    deepfusion_fs::write(path, bytes).map_err(|e| DataError::file(path, e))
}

/// Makes unique names for outputs, also for file systems that do not distinguish `A` from `a`.
#[derive(Debug, Default)]
pub(crate) struct UniqueNames {
    lowercase: HashSet<String>,
}

impl UniqueNames {
    /// This name, or with a number if it is taken: `a`, `a-2`, `a-3`.
    pub(crate) fn take(&mut self, name: &str) -> String {
        self.take_if(name, |_| true)
    }

    /// As [`Self::take`], but only names for which `free` is true; `free` receives them in lower case.
    pub(crate) fn take_if(&mut self, name: &str, free: impl Fn(&str) -> bool) -> String {
        let mut candidate = name.to_owned();
        let mut number = 1;
        loop {
            let lowercase = candidate.to_lowercase();
            if free(&lowercase) && self.lowercase.insert(lowercase) {
                return candidate;
            }
            number += 1;
            candidate = format!("{name}-{number}");
        }
    }
}
