//! The table of settings and presets, as Python sees it.

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyList, PyString};

use super::error::raise;
use crate::settings::{Default, Kind, PRESETS, SPECS, Settings, Spec, Value};

fn value_to_python<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    Ok(match value {
        Value::None => py.None().into_bound(py),
        Value::Int(i) => i.into_pyobject(py)?.into_any(),
        Value::Float(f) => f.into_pyobject(py)?.into_any(),
        Value::Text(t) => t.into_pyobject(py)?.into_any(),
    })
}

fn value_from_python(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Value> {
    if value.is_none() {
        return Ok(Value::None);
    }
    if let Ok(flag) = value.cast::<PyBool>() {
        return Ok(Value::Text(if flag.is_true() { "on" } else { "off" }.to_owned()));
    }
    if let Ok(text) = value.cast::<PyString>() {
        return Ok(Value::Text(text.to_string()));
    }
    if let Ok(whole) = value.extract::<i64>() {
        return Ok(Value::Int(whole));
    }
    if let Ok(real) = value.extract::<f64>() {
        return Ok(Value::Float(real));
    }
    Err(PyTypeError::new_err(format!("setting {name} has the value {value}, which is no text and no number")))
}

/// Settings from a dictionary of names and values.
pub(super) fn settings_from_python(py: Python<'_>, values: &Bound<'_, PyDict>) -> PyResult<Settings> {
    let mut changes = Vec::new();
    for (name, value) in values {
        let name: String = name.extract()?;
        let value = value_from_python(&name, &value)?;
        changes.push((name, value));
    }
    raise(py, Settings::new(changes.iter().map(|(n, v)| (n.as_str(), v.clone()))))
}

/// All settings with their values.
pub(super) fn settings_to_python<'py>(py: Python<'py>, settings: &Settings) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    for spec in SPECS {
        if let Some((name, value)) = settings.iter().find(|(name, _)| *name == spec.name) {
            dict.set_item(name, value_to_python(py, value)?)?;
        }
    }
    Ok(dict)
}

fn spec_to_python<'py>(py: Python<'py>, spec: &Spec) -> PyResult<Bound<'py, PyDict>> {
    let row = PyDict::new(py);
    row.set_item("name", spec.name)?;
    row.set_item("default", value_to_python(py, &spec.default.value())?)?;
    row.set_item("nullable", spec.nullable || matches!(spec.default, Default::None))?;
    row.set_item("pending", spec.pending)?;
    row.set_item("unit", spec.unit)?;
    row.set_item("doc", spec.doc)?;
    row.set_item("source", spec.source)?;
    for key in ["choices", "available", "minimum", "maximum"] {
        row.set_item(key, py.None())?;
    }
    row.set_item("exclusive_minimum", false)?;
    row.set_item("multiple_of", 1)?;
    match spec.kind {
        Kind::Choice { choices, available } => {
            row.set_item("kind", if choices == ["off", "on"] { "switch" } else { "choice" })?;
            row.set_item("choices", choices)?;
            row.set_item("available", available)?;
        }
        Kind::Int { min, max, only } => {
            row.set_item("kind", "int")?;
            row.set_item("minimum", min)?;
            row.set_item("maximum", max)?;
            if !only.is_empty() {
                row.set_item("choices", only)?;
                row.set_item("available", only)?;
            }
        }
        Kind::Multiple { min, max, of } => {
            row.set_item("kind", "int")?;
            row.set_item("minimum", min)?;
            row.set_item("maximum", max)?;
            row.set_item("multiple_of", of)?;
        }
        Kind::Float { min, max, exclusive } => {
            row.set_item("kind", "float")?;
            row.set_item("minimum", min)?;
            row.set_item("maximum", max)?;
            row.set_item("exclusive_minimum", exclusive)?;
        }
    }
    Ok(row)
}

/// One dictionary a setting: name, kind, default, choices, available, minimum, maximum, multiple_of, unit, doc, source.
#[pyfunction]
pub(super) fn setting_specs(py: Python<'_>) -> PyResult<Bound<'_, PyList>> {
    let rows: PyResult<Vec<_>> = SPECS.iter().map(|spec| spec_to_python(py, spec)).collect();
    PyList::new(py, rows?)
}

/// For each preset what it changes; None while it is not available.
#[pyfunction]
pub(super) fn presets(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let all = PyDict::new(py);
    for (name, changes) in PRESETS {
        match changes {
            None => all.set_item(name, py.None())?,
            Some(changes) => {
                let row = PyDict::new(py);
                for (setting, value) in *changes {
                    row.set_item(setting, value_to_python(py, &value.value())?)?;
                }
                all.set_item(name, row)?;
            }
        }
    }
    Ok(all)
}

/// Version of the package.
#[pyfunction]
pub(super) fn version() -> &'static str {
    env!("CARGO_PKG_VERSION")
}
