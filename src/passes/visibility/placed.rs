//! What the trace may hit, followed from frame to frame: a moved mesh costs a new top level and nothing more.

use std::sync::Arc;

use glam::{Affine3A, DMat4};

use super::trace::Tracer;
use super::trace_native::TraceInstance;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::scene::prepare::{Placed, Prepared};

/// The placed meshes that the trace has.
#[derive(Debug, Default)]
pub struct PlacedScene {
    placed: Option<Vec<(u64, [f64; 16])>>,
    version: u64,
}

impl PlacedScene {
    /// Another number whenever rays may hit something else.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// Brings the hierarchies up to date; returns what was built.
    ///
    /// # Errors
    /// `Device` when all meshes together do not fit.
    pub fn sync(&mut self, tracer: &mut Tracer, gpu: &Gpu, prepared: &Prepared) -> Result<Vec<&'static str>> {
        let placed: Vec<_> = prepared.placed.iter().map(|p| (p.mesh.id, p.scene_from_object.to_cols_array())).collect();
        if self.placed.as_ref() == Some(&placed) {
            return Ok(Vec::new());
        }
        let mut built = Vec::new();
        if prepared.placed.iter().any(|p| !p.mesh.has_blas()) {
            built.push("bottom-level BVH");
        }
        let instance = |p: &Placed| TraceInstance::new(affine(p.scene_from_object), Arc::clone(p.mesh.blas()));
        self.placed = None;
        built.extend(tracer.set_scene(gpu, prepared.placed.iter().map(instance).collect())?);
        built.push("top-level BVH");
        self.placed = Some(placed);
        self.version += 1;
        Ok(built)
    }
}

/// Rounded once, from float64 (N7).
fn affine(m: DMat4) -> Affine3A {
    let [x, y, z, w] = [m.x_axis, m.y_axis, m.z_axis, m.w_axis].map(|c| c.truncate().as_vec3());
    Affine3A::from_cols(x.into(), y.into(), z.into(), w.into())
}
