//! The handle of a rendered frame.

use std::sync::Arc;

use numpy::ndarray::ArrayD;
use numpy::{Element, IntoPyArray};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::error::raise;
use super::settings::settings_to_python;
use crate::frame::{FrameInfo, Image, Pixels};
use crate::renderer::Renderer;

/// A rendered frame; its images stay on the device until they are read.
#[pyclass(frozen, name = "Frame", module = "miplight._core")]
pub(crate) struct PyFrame {
    pub(super) renderer: Arc<Renderer>,
    pub(super) info: FrameInfo,
    pub(super) names: Vec<String>,
}

fn array<T: Element>(py: Python<'_>, shape: &[usize], values: Vec<T>) -> PyResult<Py<PyAny>> {
    let array =
        ArrayD::from_shape_vec(shape, values).map_err(|e| pyo3::exceptions::PyRuntimeError::new_err(e.to_string()))?;
    Ok(array.into_pyarray(py).into_any().unbind())
}

fn to_numpy(py: Python<'_>, image: Image) -> PyResult<Py<PyAny>> {
    let (rows, columns) = (image.height as usize, image.width as usize);
    match image.pixels {
        Pixels::Rgb(values) => array(py, &[rows, columns, 3], values),
        Pixels::Rows(words, values) => array(py, &[rows, columns, words], values),
        Pixels::Scalar(values) => array(py, &[rows, columns], values),
        Pixels::Mask(values) => array(py, &[rows, columns], values),
        Pixels::Bytes(values) => array(py, &[rows, columns], values),
        Pixels::Words(values) => array(py, &[rows, columns], values),
        Pixels::Numbers(shape, values) => array(py, &shape, values),
        Pixels::Cells(shape, values) => array(py, &shape, values),
        Pixels::Places(shape, values) => array(py, &shape, values),
    }
}

#[pymethods]
impl PyFrame {
    /// The resource `name` as an array.
    ///
    /// Raises DeviceError once the renderer rendered again or was closed, SettingsError for an unknown name.
    fn read(&self, py: Python<'_>, name: &str) -> PyResult<Py<PyAny>> {
        let image = raise(py, py.detach(|| self.renderer.read(&self.info, name)))?;
        to_numpy(py, image)
    }

    /// What can be read.
    #[getter]
    fn names(&self) -> Vec<String> {
        self.names.clone()
    }

    /// Columns of the image.
    #[getter]
    fn width(&self) -> u32 {
        self.info.width
    }

    /// Rows of the image.
    #[getter]
    fn height(&self) -> u32 {
        self.info.height
    }

    /// Every setting, resolved.
    #[getter]
    fn settings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        settings_to_python(py, &self.info.settings)
    }

    /// Times in milliseconds, counts, and what was skipped, empty or rebuilt.
    #[getter]
    fn stats<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let stats = &self.info.stats;
        let dict = PyDict::new(py);
        let pairs = |pairs: &[(String, String)]| -> PyResult<Bound<'py, PyDict>> {
            let dict = PyDict::new(py);
            pairs.iter().try_for_each(|(name, reason)| dict.set_item(name, reason))?;
            Ok(dict)
        };
        let stages = PyDict::new(py);
        for (name, ms) in &stats.stages {
            stages.set_item(name, ms)?;
        }
        let levels = PyDict::new(py);
        for (level, nodes, ms) in &stats.levels {
            let row = PyDict::new(py);
            row.set_item("nodes", nodes)?;
            row.set_item("ms", ms)?;
            levels.set_item(level, row)?;
        }
        dict.set_item("levels", levels)?;
        dict.set_item("total_ms", stats.total_ms)?;
        dict.set_item("stages", stages)?;
        dict.set_item("readback_ms", 0.0)?;
        dict.set_item("rays", stats.rays)?;
        dict.set_item("extra_samples", stats.extra_samples)?;
        dict.set_item("light_evaluations", stats.light_evaluations)?;
        dict.set_item("skipped", pairs(&stats.skipped)?)?;
        dict.set_item("empty", pairs(&stats.empty)?)?;
        dict.set_item("rebuilt", &stats.rebuilt)?;
        dict.set_item("adapter", &self.renderer.adapter().name)?;
        dict.set_item("device_bytes", stats.device_bytes)?;
        Ok(dict)
    }
}
