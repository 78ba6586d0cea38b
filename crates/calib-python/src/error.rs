//! One exception for everything that a library refuses.

use calib_cli::CliError;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;

pyo3::create_exception!(
    calib,
    CalibError,
    PyException,
    "Something that calib refuses: the text is what the program prints after `error:`, with place and remedy.\n\n\
     `exit_code` is the program's exit code (2 usage or profile, 3 data, 4 not observable, 5 not converged, 6 plugin, 7 not written) and\n\
     `id` names the kind of error; both stay the same in later versions."
);

/// The exception of an error.
pub(crate) fn raised(py: Python<'_>, error: impl Into<CliError>) -> PyErr {
    let error = error.into();
    let text = calib_cli::said(&error);
    refused(py, &text, error.id(), error.exit_code() as u8)
}

/// The exception with this text, error id and exit code.
pub(crate) fn refused(py: Python<'_>, text: &str, id: &str, exit_code: u8) -> PyErr {
    let raised = CalibError::new_err(text.to_owned());
    let value = raised.value(py);
    let set = value
        .setattr("exit_code", exit_code)
        .and_then(|()| value.setattr("id", id));
    match set {
        Ok(()) => raised,
        Err(other) => other,
    }
}

/// An argument that is not what a function takes.
pub(crate) fn misused(py: Python<'_>, text: &str) -> PyErr {
    refused(py, text, "usage", 2)
}
