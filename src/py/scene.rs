//! Scene handles: immutable geometry and textures, and the snapshot that a render takes.

use std::sync::Arc;

use glam::{DMat4, DVec3, Vec2, Vec3};
use numpy::{PyArray2, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods, ToPyArray, ndarray::arr2};
use pyo3::Borrowed;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::error::{raise, scene_error};
use crate::scene::light::{AreaLight, Radiance, SpotLight};
use crate::scene::material::Texture;
use crate::scene::mesh::{Mesh, MeshInput};
use crate::scene::snapshot::{Instance, Snapshot};

/// Immutable triangle geometry with its bottom-level BVH.
#[pyclass(frozen, name = "Mesh", module = "miplight._core")]
pub(crate) struct PyMesh {
    name: String,
    mesh: Arc<Mesh>,
}

type Rows64<'py> = PyReadonlyArray2<'py, f64>;
type Rows32<'py> = PyReadonlyArray2<'py, f32>;

/// The rows of a C-contiguous (n, N) array.
fn rows<T: numpy::Element + Copy, const N: usize>(
    py: Python<'_>,
    what: &str,
    array: &PyReadonlyArray2<'_, T>,
) -> PyResult<Vec<[T; N]>> {
    if array.shape()[1] != N {
        let shape = (array.shape()[0], array.shape()[1]);
        return Err(scene_error(py, format!("{what} has the shape {shape:?}; it must be (n, {N})")));
    }
    let view = array.as_array();
    Ok(view.rows().into_iter().map(|row| std::array::from_fn(|i| row[i])).collect())
}

fn vec3s(py: Python<'_>, what: &str, array: Option<&Rows32<'_>>) -> PyResult<Option<Vec<Vec3>>> {
    array.map(|a| Ok(rows::<f32, 3>(py, what, a)?.into_iter().map(Vec3::from).collect())).transpose()
}

#[pymethods]
impl PyMesh {
    /// Checks and rebases geometry; positions (V, 3) float64, triangles (F, 3) uint32, normals (V, 3), uvs (V, 2) and
    /// colors (V, 3) float32.
    ///
    /// Raises SceneError when a shape is wrong, an index is out of range, or no triangle with an area is left.
    #[new]
    #[pyo3(signature = (positions, triangles, normals=None, uvs=None, colors=None, name=String::new()))]
    fn new(
        py: Python<'_>,
        positions: Rows64<'_>,
        triangles: PyReadonlyArray2<'_, u32>,
        normals: Option<Rows32<'_>>,
        uvs: Option<Rows32<'_>>,
        colors: Option<Rows32<'_>>,
        name: String,
    ) -> PyResult<Self> {
        let input = MeshInput {
            positions: rows::<f64, 3>(py, "positions", &positions)?.into_iter().map(DVec3::from).collect(),
            triangles: rows::<u32, 3>(py, "triangles", &triangles)?,
            normals: vec3s(py, "normals", normals.as_ref())?,
            uvs: match &uvs {
                Some(array) => Some(rows::<f32, 2>(py, "uvs", array)?.into_iter().map(Vec2::from).collect()),
                None => None,
            },
            colors: vec3s(py, "colors", colors.as_ref())?,
        };
        let mesh = raise(py, py.detach(|| Mesh::new(&name, input)))?;
        Ok(Self { name, mesh: Arc::new(mesh) })
    }

    /// The same triangles with vertices (V, 3) float64 elsewhere; raises SceneError as the constructor does.
    #[pyo3(signature = (positions, normals=None))]
    fn with_positions(&self, py: Python<'_>, positions: Rows64<'_>, normals: Option<Rows32<'_>>) -> PyResult<Self> {
        let positions = rows::<f64, 3>(py, "positions", &positions)?.into_iter().map(DVec3::from).collect();
        let normals = vec3s(py, "normals", normals.as_ref())?;
        let mesh = raise(py, py.detach(|| self.mesh.with_positions(&self.name, positions, normals)))?;
        Ok(Self { name: self.name.clone(), mesh: Arc::new(mesh) })
    }

    /// A number that no other mesh of this process has.
    #[getter]
    fn id(&self) -> u64 {
        self.mesh.id
    }

    /// (2, 3) float64: smallest and largest corner of the kept triangles, in the mesh's own space.
    #[getter]
    fn bounds<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        arr2(&self.mesh.bounds.map(|corner| corner.to_array())).to_pyarray(py)
    }

    /// How many triangles were kept, and how many dropped as degenerate or not finite.
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let report = PyDict::new(py);
        report.set_item("triangles", self.mesh.report.triangles)?;
        report.set_item("degenerate", self.mesh.report.degenerate)?;
        report.set_item("not_finite", self.mesh.report.not_finite)?;
        Ok(report)
    }
}

/// Immutable linear RGB picture, row 0 at the top.
#[pyclass(frozen, name = "Texture", module = "miplight._core")]
pub(crate) struct PyTexture(Arc<Texture>);

#[pymethods]
impl PyTexture {
    /// texels (h, w, 3) float32, finite and 0 or more; raises SceneError.
    #[new]
    fn new(py: Python<'_>, texels: PyReadonlyArray3<'_, f32>) -> PyResult<Self> {
        let &[height, width, channels] = texels.shape() else {
            return Err(scene_error(py, "texels must be (h, w, 3)".to_owned()));
        };
        let fits = u32::try_from(width).ok().zip(u32::try_from(height).ok());
        let Some((columns, rows)) = fits.filter(|_| channels == 3) else {
            let shape = (height, width, channels);
            return Err(scene_error(py, format!("texels have the shape {shape:?}; it must be (h, w, 3)")));
        };
        let values: Vec<f32> = texels.as_array().iter().copied().collect();
        let texels = values.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
        Ok(Self(Arc::new(raise(py, Texture::new(columns, rows, texels))?)))
    }

    /// A number that no other texture of this process has.
    #[getter]
    fn id(&self) -> u64 {
        self.0.id
    }

    /// Rows and columns.
    #[getter]
    fn shape(&self) -> (u32, u32) {
        (self.0.height, self.0.width)
    }
}

/// A mesh placed in the world with its material.
#[pyclass(frozen, name = "Instance", module = "miplight._core")]
pub(crate) struct PyInstance(Instance);

pub(super) fn matrix(py: Python<'_>, what: &str, array: &Rows64<'_>) -> PyResult<DMat4> {
    if array.shape() != [4, 4] {
        return Err(scene_error(py, format!("{what} has the shape {:?}; it must be (4, 4)", array.shape())));
    }
    let view = array.as_array();
    Ok(DMat4::from_cols_array(&std::array::from_fn(|i| view[[i % 4, i / 4]])))
}

#[pymethods]
impl PyInstance {
    /// world_from_object (4, 4) float64; albedo three numbers in [0, 1], times the texture, times the vertex colours;
    /// lobe the specular reflectance and the exponent of a Phong lobe.
    #[new]
    #[pyo3(signature = (name, mesh, world_from_object, smooth, albedo, texture, vertex_colors, lobe))]
    #[allow(clippy::too_many_arguments, reason = "they are the fields of the instance, by keyword")]
    fn new(
        py: Python<'_>,
        name: String,
        mesh: &PyMesh,
        world_from_object: Rows64<'_>,
        smooth: bool,
        albedo: Triple,
        texture: Option<&PyTexture>,
        vertex_colors: bool,
        lobe: [f32; 4],
    ) -> PyResult<Self> {
        Ok(Self(Instance {
            name,
            mesh: Arc::clone(&mesh.mesh),
            world_from_object: matrix(py, "world_from_object", &world_from_object)?,
            smooth,
            albedo: albedo.0.as_vec3(),
            texture: texture.map(|t| Arc::clone(&t.0)),
            vertex_colors,
            lobe,
        }))
    }
}

/// Three numbers from any iterable: tuple, list or array.
struct Triple(DVec3);

impl<'py> FromPyObject<'_, 'py> for Triple {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let numbers: Vec<f64> = object.try_iter()?.map(|x| x?.extract()).collect::<PyResult<_>>()?;
        match numbers[..] {
            [x, y, z] => Ok(Self(DVec3::new(x, y, z))),
            _ => Err(scene_error(object.py(), format!("{numbers:?} has {} numbers where 3 are needed", numbers.len()))),
        }
    }
}

/// What `radiance` may be.
#[derive(FromPyObject)]
enum RadianceArgument<'py> {
    Texture(PyRef<'py, PyTexture>),
    Constant(Triple),
}

/// A parallelogram light.
#[pyclass(frozen, name = "AreaLight", module = "miplight._core")]
pub(crate) struct PyAreaLight(AreaLight);

#[pymethods]
impl PyAreaLight {
    /// corner, edge_u, edge_v in scene units; radiance three numbers (W/sr/m^2) or a Texture.
    #[new]
    #[allow(clippy::too_many_arguments, reason = "they are the fields of the light, by keyword")]
    fn new(
        name: String,
        corner: Triple,
        edge_u: Triple,
        edge_v: Triple,
        radiance: RadianceArgument<'_>,
        two_sided: bool,
        visible: bool,
        linear_filter: bool,
    ) -> Self {
        let radiance = match radiance {
            RadianceArgument::Texture(texture) => Radiance::Textured(Arc::clone(&texture.0)),
            RadianceArgument::Constant(c) => Radiance::Constant(c.0.as_vec3()),
        };
        let [corner, edge_u, edge_v] = [corner.0, edge_u.0, edge_v.0];
        Self(AreaLight { name, corner, edge_u, edge_v, radiance, two_sided, visible, linear_filter })
    }
}

/// A point light with a hard cone.
#[pyclass(frozen, name = "SpotLight", module = "miplight._core")]
pub(crate) struct PySpotLight(SpotLight);

#[pymethods]
impl PySpotLight {
    /// position and target in scene units; intensity three numbers (W/sr); cutoff_degrees in (0, 80].
    #[new]
    fn new(name: String, position: Triple, target: Triple, intensity: Triple, cutoff_degrees: f64) -> Self {
        let [position, target] = [position.0, target.0];
        Self(SpotLight { name, position, target, intensity: intensity.0.as_vec3(), cutoff_degrees })
    }
}

/// A scene as it is when a render begins.
#[pyclass(frozen, name = "Snapshot", module = "miplight._core")]
pub(crate) struct PySnapshot(pub(super) Snapshot);

#[pymethods]
impl PySnapshot {
    /// Raises SceneError, naming the mesh or light that cannot be rendered.
    #[new]
    fn new(
        py: Python<'_>,
        instances: Vec<PyRef<'_, PyInstance>>,
        area_lights: Vec<PyRef<'_, PyAreaLight>>,
        spot_lights: Vec<PyRef<'_, PySpotLight>>,
    ) -> PyResult<Self> {
        let snapshot = Snapshot {
            instances: instances.iter().map(|i| i.0.clone()).collect(),
            area_lights: area_lights.iter().map(|l| l.0.clone()).collect(),
            spot_lights: spot_lights.iter().map(|l| l.0.clone()).collect(),
        };
        raise(py, snapshot.check())?;
        Ok(Self(snapshot))
    }
}
