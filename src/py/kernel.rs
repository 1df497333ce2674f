//! One shader on given data: how the tests compare each pass with its numpy reference.

use std::collections::HashMap;

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::error::raise;
use crate::error::{Error, Result};
use crate::gpu::{BindingKind, Buffer, Gpu, Usage, never};

/// A device that runs single shaders; for tests of shaders, not for rendering.
#[pyclass(frozen, name = "KernelRunner", module = "miplight._core")]
pub(crate) struct PyKernelRunner(Gpu);

type Bytes = Vec<(String, Vec<u8>)>;

fn words(name: &str, bytes: &[u8]) -> Result<Vec<u32>> {
    if !bytes.len().is_multiple_of(4) {
        return Err(Error::Shader(format!("{name:?} has {} bytes, which is no multiple of 4", bytes.len())));
    }
    Ok(bytemuck::pod_collect_to_vec(bytes))
}

type Constants = Vec<(String, f64)>;

fn run(
    gpu: &Gpu,
    (stem, text, entry): (&str, Option<&str>, &str),
    constants: &Constants,
    inputs: &Bytes,
    threads: usize,
    groups: bool,
) -> Result<Bytes> {
    let constants: Vec<(&str, f64)> = constants.iter().map(|(name, value)| (name.as_str(), *value)).collect();
    let kernel = match text {
        Some(text) => gpu.kernel_from_text(stem, text, entry, &constants)?,
        None => gpu.kernel(stem, entry, &constants)?,
    };
    let mut buffers: Vec<(String, Buffer<u32>, bool)> = Vec::new();
    for (name, bytes) in inputs {
        let Some(binding) = kernel.reflection().binding(name) else {
            return Err(Error::Shader(format!("{stem} has no binding {name:?}")));
        };
        let usage = if binding.kind == BindingKind::Uniform { Usage::Uniform } else { Usage::Storage };
        let data = words(name, bytes)?;
        let buffer = gpu.buffer(name, data.len(), usage)?;
        buffer.write(gpu, 0, &data)?;
        buffers.push((name.clone(), buffer, binding.kind == BindingKind::ReadWrite));
    }
    let mut recorder = gpu.record(never())?;
    let mut pass = recorder.pass("test", &kernel);
    for (name, buffer, _) in &buffers {
        pass = pass.bind(name, buffer);
    }
    if groups {
        pass.dispatch_groups(threads)?
    } else {
        pass.dispatch(threads)?
    }
    recorder.finish()?;
    let written = buffers.iter().filter(|(_, _, written)| *written);
    written.map(|(name, buffer, _)| Ok((name.clone(), bytemuck::cast_slice(&gpu.read(buffer)?).to_vec()))).collect()
}

#[pymethods]
impl PyKernelRunner {
    /// adapter as for a renderer; raises DeviceError.
    #[new]
    fn new(py: Python<'_>, adapter: &str) -> PyResult<Self> {
        Ok(Self(raise(py, py.detach(|| Gpu::new(adapter)))?))
    }

    /// Runs `entry` of `shaders/<stem>.wgsl` (or of `text`, which may import those files) on `threads` threads, or
    /// workgroups if `groups`.
    ///
    /// `inputs`: for each binding (n,) uint8, the bytes as the shader sees them. Returns the bytes of the bindings that
    /// the shader may write. `constants` sets override constants. Raises ShaderError or DeviceError.
    #[pyo3(signature = (stem, entry, inputs, threads, groups=false, text=None, constants=None))]
    #[allow(clippy::too_many_arguments, reason = "they are what a shader needs, by keyword")]
    fn run<'py>(
        &self,
        py: Python<'py>,
        stem: &str,
        entry: &str,
        inputs: &Bound<'py, PyDict>,
        threads: usize,
        groups: bool,
        text: Option<&str>,
        constants: Option<HashMap<String, f64>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let constants: Constants = constants.unwrap_or_default().into_iter().collect();
        let mut bytes = Bytes::new();
        for (name, value) in inputs {
            let array: PyReadonlyArray1<'_, u8> = value.extract()?;
            bytes.push((name.extract()?, array.as_array().to_vec()));
        }
        let outputs = raise(py, py.detach(|| run(&self.0, (stem, text, entry), &constants, &bytes, threads, groups)))?;
        let dict = PyDict::new(py);
        for (name, bytes) in outputs {
            let array: Bound<'py, PyArray1<u8>> = bytes.into_pyarray(py);
            dict.set_item(name, array)?;
        }
        Ok(dict)
    }
}
