//! Errors as Python sees them.

use pyo3::create_exception;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

create_exception!(
    tactnet,
    TactnetError,
    PyValueError,
    "What cannot be done, in one line: what was expected and what was found."
);

/// Returns the exception for any of the crates' errors, with its causes.
pub(crate) fn raised(error: impl std::error::Error) -> PyErr {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(inner) = cause {
        let more = inner.to_string();
        if !text.contains(&more) {
            text.push_str(": ");
            text.push_str(&more);
        }
        cause = inner.source();
    }
    TactnetError::new_err(text)
}
