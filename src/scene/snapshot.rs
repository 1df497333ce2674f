//! A scene as it is when a render begins: shared geometry, placed; lights; where its middle is.

use std::sync::Arc;

use glam::{DMat4, DVec3, Vec3};

use super::light::{AreaLight, SpotLight};
use super::material::Texture;
use super::mesh::Mesh;
use crate::error::{Error, Result};

/// A mesh placed in the world with its material.
#[derive(Debug, Clone)]
pub struct Instance {
    /// The user's name for it.
    pub name: String,
    /// Shared geometry.
    pub mesh: Arc<Mesh>,
    /// Any affine, invertible transform.
    pub world_from_object: DMat4,
    /// Interpolate the vertex normals.
    pub smooth: bool,
    /// Linear RGB in [0, 1]; multiplies the texture and the vertex colours.
    pub albedo: Vec3,
    /// Base colour, by the mesh's texture coordinates.
    pub texture: Option<Arc<Texture>>,
    /// Use the mesh's vertex colours.
    pub vertex_colors: bool,
    /// Specular reflectance, linear RGB in [0, 1], and the exponent of its Phong lobe.
    pub lobe: [f32; 4],
}

impl Instance {
    /// Whether it reflects anything but diffusely.
    pub fn is_specular(&self) -> bool {
        self.lobe[..3].iter().any(|&channel| channel > 0.0)
    }

    fn check(&self) -> Result<()> {
        let m = self.world_from_object;
        let last_row_fine = m.row(3) == glam::DVec4::W;
        let determinant = m.determinant();
        if !m.is_finite() || !last_row_fine || determinant == 0.0 || !determinant.is_finite() {
            return Err(Error::Scene(format!(
                "transform of mesh {:?} is {m}; it must be finite and invertible with the last row 0 0 0 1",
                self.name
            )));
        }
        if self.texture.is_some() && self.mesh.uvs.is_none() {
            return Err(Error::Scene(format!("mesh {:?} has a texture but no uvs", self.name)));
        }
        Ok(())
    }

    /// World-space box of the kept triangles, by the box's corners.
    pub fn world_bounds(&self) -> [DVec3; 2] {
        let [lo, hi] = self.mesh.bounds;
        let mut bounds = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        for corner in 0..8u32 {
            let pick = |axis: u32, a: f64, b: f64| if corner >> axis & 1 == 0 { a } else { b };
            let p = DVec3::new(pick(0, lo.x, hi.x), pick(1, lo.y, hi.y), pick(2, lo.z, hi.z));
            let q = self.world_from_object.transform_point3(p);
            bounds = [bounds[0].min(q), bounds[1].max(q)];
        }
        bounds
    }
}

/// Everything that a render needs to know of a scene.
#[derive(Debug, Clone, Default)]
pub struct Snapshot {
    /// Placed meshes.
    pub instances: Vec<Instance>,
    /// Parallelogram lights.
    pub area_lights: Vec<AreaLight>,
    /// Spot lights.
    pub spot_lights: Vec<SpotLight>,
}

impl Snapshot {
    /// # Errors
    /// `Scene`, naming the mesh or light that cannot be rendered.
    pub fn check(&self) -> Result<()> {
        self.instances.iter().try_for_each(Instance::check)?;
        self.area_lights.iter().try_for_each(AreaLight::check)?;
        self.spot_lights.iter().try_for_each(SpotLight::check)
    }

    /// What scene space is relative to: the middle of the meshes, or of the lights where there are none (N7). Moving a
    /// light does not move it, so that nothing else has to follow.
    pub fn anchor(&self) -> DVec3 {
        let join = |a: [DVec3; 2], b: [DVec3; 2]| [a[0].min(b[0]), a[1].max(b[1])];
        let meshes = self.instances.iter().map(Instance::world_bounds).reduce(join);
        let lights = || self.area_lights.iter().map(|l| [l.corner, l.corner]).reduce(join);
        meshes.or_else(lights).map_or(DVec3::ZERO, |[lo, hi]| (lo + hi) * 0.5)
    }

    /// How many lights of both kinds.
    pub fn light_count(&self) -> usize {
        self.area_lights.len() + self.spot_lights.len()
    }
}
