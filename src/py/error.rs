//! From the crate's errors to the exception classes of `miplight.errors`.

use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;

use crate::error::Error;

static CLASSES: [PyOnceLock<Py<PyType>>; 4] = [const { PyOnceLock::new() }; 4];
const NAMES: [&str; 4] = ["SceneError", "SettingsError", "DeviceError", "ShaderError"];

/// The Python exception of an error.
pub(crate) fn exception(py: Python<'_>, error: &Error) -> PyErr {
    let kind = match error {
        Error::Scene(_) => 0,
        Error::Settings(_) => 1,
        Error::Device(_) => 2,
        Error::Shader(_) => 3,
        Error::Cancelled => return PyKeyboardInterrupt::new_err(error.to_string()),
    };
    match CLASSES[kind].import(py, "miplight.errors", NAMES[kind]) {
        Ok(class) => PyErr::from_type(class.clone(), error.to_string()),
        Err(import_failed) => import_failed,
    }
}

/// `result` with its error as an exception.
pub(crate) fn raise<T>(py: Python<'_>, result: crate::error::Result<T>) -> PyResult<T> {
    result.map_err(|error| exception(py, &error))
}

/// A `SceneError` about a value that came through the border.
pub(crate) fn scene_error(py: Python<'_>, message: String) -> PyErr {
    exception(py, &Error::Scene(message))
}
