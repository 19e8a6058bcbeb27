//! Saying what was being done when something failed.

use super::{Failure, Result};

/// Results that can say what was being done, and with which file.
pub(crate) trait Context<T> {
    /// Puts `what` before an error.
    ///
    /// # Errors
    /// The same, as a [`Failure`].
    fn context(self, what: impl Into<String>) -> Result<T>;
}

impl<T, E: Into<Failure>> Context<T> for std::result::Result<T, E> {
    fn context(self, what: impl Into<String>) -> Result<T> {
        self.map_err(|error| error.into().context(what))
    }
}
