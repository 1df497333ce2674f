//! The renderer's handle: the interpreter's lock is released while it works.

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use numpy::PyReadonlyArray2;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use super::error::{exception, raise};
use super::frame::PyFrame;
use super::scene::{PySnapshot, matrix};
use super::settings::settings_from_python;
use crate::error::Error;
use crate::gpu::{self, AdapterFacts};
use crate::passes::visibility::trace::Form;
use crate::plan::Plan;
use crate::renderer::Renderer;
use crate::scene::camera::Camera;

/// How often a long render looks for Ctrl-C.
const CHECK_EVERY: Duration = Duration::from_millis(50);

/// A device with everything that is kept between frames.
#[pyclass(frozen, name = "Renderer", module = "miplight._core")]
pub(crate) struct PyRenderer(Arc<Renderer>);

fn facts_to_python<'py>(py: Python<'py>, facts: &AdapterFacts) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("name", &facts.name)?;
    dict.set_item("backend", &facts.backend)?;
    dict.set_item("driver", &facts.driver)?;
    dict.set_item("device_type", facts.device_type)?;
    dict.set_item("software", facts.software())?;
    Ok(dict)
}

fn camera_from_python(py: Python<'_>, camera: &Bound<'_, PyDict>) -> PyResult<Camera> {
    let item = |name: &str| {
        camera.get_item(name)?.ok_or_else(|| super::error::scene_error(py, format!("the camera has no {name:?}")))
    };
    let pose: PyReadonlyArray2<'_, f64> = item("world_from_camera")?.extract()?;
    let camera = Camera {
        world_from_camera: matrix(py, "world_from_camera", &pose)?,
        fx: item("fx")?.extract()?,
        fy: item("fy")?.extract()?,
        cx: item("cx")?.extract()?,
        cy: item("cy")?.extract()?,
        width: item("width")?.extract()?,
        height: item("height")?.extract()?,
    };
    raise(py, camera.check())?;
    Ok(camera)
}

fn plan_to_python<'py>(py: Python<'py>, plan: &Plan) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    let skipped = PyDict::new(py);
    for (name, reason) in &plan.skipped {
        skipped.set_item(name, reason)?;
    }
    dict.set_item("passes", &plan.passes)?;
    dict.set_item("skipped", skipped)?;
    Ok(dict)
}

/// Looks for Ctrl-C now and then; keeps the exception that it found.
struct Interrupt {
    check: Option<Py<PyAny>>,
    state: Mutex<(Instant, Option<PyErr>)>,
}

impl Interrupt {
    fn asked(&self) -> bool {
        let Ok(mut state) = self.state.lock() else { return true };
        if state.1.is_some() {
            return true;
        }
        if state.0.elapsed() < CHECK_EVERY {
            return false;
        }
        state.0 = Instant::now();
        let result = Python::attach(|py| {
            py.check_signals()?;
            match &self.check {
                Some(check) => check.call0(py).map(|_| ()),
                None => Ok(()),
            }
        });
        state.1 = result.err();
        state.1.is_some()
    }
}

#[pymethods]
impl PyRenderer {
    /// adapter: "auto", "gpu", "cpu" or a part of an adapter's name; trace: "auto", "native" or "wgsl".
    ///
    /// Raises DeviceError, or SettingsError for another `trace`.
    #[new]
    #[pyo3(signature = (adapter, trace="auto"))]
    fn new(py: Python<'_>, adapter: &str, trace: &str) -> PyResult<Self> {
        let form = match trace {
            "auto" => None,
            "native" => Some(Form::Native),
            "wgsl" => Some(Form::Wgsl),
            other => {
                let message = format!("trace is {other:?}; allowed: \"auto\", \"native\", \"wgsl\"");
                return Err(exception(py, &Error::Settings(message)));
            }
        };
        Ok(Self(Arc::new(raise(py, py.detach(|| Renderer::new(adapter, form)))?)))
    }

    /// Name, backend, driver, device_type, software, trace ("native" or "wgsl") and limits.
    #[getter]
    fn adapter<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = facts_to_python(py, self.0.adapter())?;
        dict.set_item("trace", self.0.trace_form())?;
        let limits = PyDict::new(py);
        for (name, value) in self.0.limits() {
            limits.set_item(name, value)?;
        }
        dict.set_item("limits", limits)?;
        Ok(dict)
    }

    /// Renders; `check` is called now and then, and what it raises ends the render.
    ///
    /// Raises SceneError, SettingsError, DeviceError, ShaderError, or what `check` raised.
    #[pyo3(signature = (snapshot, camera, settings, keep, check=None))]
    fn render(
        &self,
        py: Python<'_>,
        snapshot: &PySnapshot,
        camera: &Bound<'_, PyDict>,
        settings: &Bound<'_, PyDict>,
        keep: Vec<String>,
        check: Option<Py<PyAny>>,
    ) -> PyResult<PyFrame> {
        let camera = camera_from_python(py, camera)?;
        let settings = settings_from_python(py, settings)?;
        let interrupt = Interrupt { check, state: Mutex::new((Instant::now(), None)) };
        let cancel = || interrupt.asked();
        let result = py.detach(|| self.0.render(&snapshot.0, &camera, &settings, &keep, &cancel));
        if let Some(raised) = interrupt.state.into_inner().ok().and_then(|(_, raised)| raised) {
            return Err(raised);
        }
        let info = result.map_err(|error| exception(py, &error))?;
        let names = self.0.names(&info);
        Ok(PyFrame { renderer: Arc::clone(&self.0), info, names })
    }

    /// The passes that would run and those that would not, with reasons, for a first frame.
    fn plan<'py>(
        &self,
        py: Python<'py>,
        snapshot: &PySnapshot,
        camera: &Bound<'_, PyDict>,
        settings: &Bound<'_, PyDict>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let camera = camera_from_python(py, camera)?;
        let settings = settings_from_python(py, settings)?;
        let plan = raise(py, self.0.plan(&snapshot.0, &camera, &settings))?;
        plan_to_python(py, &plan)
    }

    /// Gives everything on the device back; later use raises DeviceError.
    fn close(&self) {
        self.0.close();
    }
}

/// What this machine has.
#[pyfunction]
pub(super) fn adapters(py: Python<'_>) -> PyResult<Bound<'_, PyList>> {
    let found = py.detach(gpu::adapters);
    let rows: PyResult<Vec<_>> = found.iter().map(|facts| facts_to_python(py, facts)).collect();
    PyList::new(py, rows?)
}
