//! Errors of the readers inside what a check reports.

use deepfusion_hint::Hint;
use std::error::Error;
use std::fmt;
use std::sync::Arc;

/// An error of a reader that can be cloned with the report of a check. Two are equal if their messages are equal.
#[derive(Debug)]
pub struct SharedError<E>(Arc<E>);

impl<E> SharedError<E> {
    /// The error itself.
    #[must_use]
    pub fn error(&self) -> &E {
        &self.0
    }
}

impl<E> From<E> for SharedError<E> {
    fn from(error: E) -> Self {
        Self(Arc::new(error))
    }
}

impl<E> Clone for SharedError<E> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<E: fmt::Display> PartialEq for SharedError<E> {
    fn eq(&self, other: &Self) -> bool {
        self.0.to_string() == other.0.to_string()
    }
}

impl<E: fmt::Display> fmt::Display for SharedError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&*self.0, f)
    }
}

impl<E: Error> Error for SharedError<E> {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.0.source()
    }
}

impl<E: Hint> Hint for SharedError<E> {
    fn hint(&self) -> Option<String> {
        self.0.hint()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_data::Error as DataError;
    use std::io::{Error as SystemError, ErrorKind};
    use std::path::Path;

    #[test]
    fn errors_with_equal_messages_are_equal() {
        let error = |name: &str| {
            let denied = SystemError::from(ErrorKind::PermissionDenied);
            SharedError::from(DataError::file(Path::new(name), denied))
        };
        let one = error("a.png");
        assert_eq!(one, error("a.png"));
        assert_ne!(one, error("b.png"));
        assert_eq!(one.to_string(), one.clone().error().to_string());
        assert!(one.source().is_some());
    }
}
