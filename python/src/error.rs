//! The library's errors as Python exceptions.

use std::ffi::CString;

use deepfusion::Hint;
use pyo3::exceptions::{PyException, PyUserWarning};
use pyo3::prelude::*;

pyo3::create_exception!(
    deepfusion,
    DeepFusionError,
    PyException,
    "What went wrong, with the file, frame or field; `hint` says what to do about it."
);

/// Gives the class a `hint` of None, for exceptions without one.
pub(crate) fn set_default_hint(py: Python<'_>) -> PyResult<()> {
    py.get_type::<DeepFusionError>().setattr("hint", py.None())
}

/// An error's message and hint, where the interpreter is not attached.
pub(crate) struct Failure {
    pub message: String,
    pub hint: Option<String>,
}

impl<E: Hint> From<E> for Failure {
    fn from(error: E) -> Self {
        Self {
            message: error.to_string(),
            hint: error.hint(),
        }
    }
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> Self {
        with_hint(failure.message, failure.hint)
    }
}

/// A library's error as an exception: its message, with its hint as `hint` and as a note.
pub(crate) fn raise(error: impl Hint) -> PyErr {
    with_hint(error.to_string(), error.hint())
}

/// Issues a Python warning; returns the exception if warnings are errors.
pub(crate) fn warn(py: Python<'_>, text: &str) -> PyResult<()> {
    let text = CString::new(text.replace('\0', " ")).unwrap_or_default();
    PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 1)
}

/// An exception with this message and hint.
pub(crate) fn with_hint(message: String, hint: Option<String>) -> PyErr {
    let error = DeepFusionError::new_err(message);
    Python::attach(|py| {
        let value = error.value(py);
        // If these fail, the message still remains.
        let _ = value.setattr("hint", hint.clone());
        if let Some(hint) = hint {
            let _ = value.call_method1("add_note", (format!("hint: {hint}"),));
        }
    });
    error
}
