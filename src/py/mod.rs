//! The Python border: convert, check, release the lock, map errors. No rendering logic.

mod error;
mod frame;
mod kernel;
mod renderer;
mod scene;
mod settings;

use pyo3::prelude::*;

/// Core of miplight: scene handles, settings table and renderer. Use the classes of `miplight` instead.
#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<scene::PyMesh>()?;
    module.add_class::<scene::PyTexture>()?;
    module.add_class::<scene::PyInstance>()?;
    module.add_class::<scene::PyAreaLight>()?;
    module.add_class::<scene::PySpotLight>()?;
    module.add_class::<scene::PySnapshot>()?;
    module.add_class::<renderer::PyRenderer>()?;
    module.add_class::<frame::PyFrame>()?;
    module.add_class::<kernel::PyKernelRunner>()?;
    module.add_function(wrap_pyfunction!(renderer::adapters, module)?)?;
    module.add_function(wrap_pyfunction!(settings::setting_specs, module)?)?;
    module.add_function(wrap_pyfunction!(settings::presets, module)?)?;
    module.add_function(wrap_pyfunction!(settings::version, module)?)?;
    Ok(())
}
