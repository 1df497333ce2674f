//! Answers ray lists. Two forms with the same answers: WGSL on a GPU, native on a software adapter.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{Affine3A, DMat4};

use super::trace_native::{SampleTable, TraceInstance, TraceScene};
use super::{Hit, Ray, Receiver};
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Recorder};
use crate::passes::lights::light_samples::LightSamples;
use crate::scene::prepare::{Placed, Prepared};

/// Lists are cut so that each is answered in about 0.1 s; between them the recorder asks whether to go on.
static GO_ON: AtomicBool = AtomicBool::new(false);

/// Answers rays in the form that suits the adapter.
pub struct Tracer {
    native: bool,
    scene: TraceScene,
    version: u64,
    placed: Vec<(u64, [f64; 16])>,
}

impl Tracer {
    /// Nothing to hit yet.
    pub fn new(gpu: &Gpu) -> Self {
        Self { native: gpu.software(), scene: TraceScene::new(Vec::new()), version: 0, placed: Vec::new() }
    }

    /// Whether rays are answered on the host.
    pub fn native(&self) -> bool {
        self.native
    }

    /// Another number whenever rays may hit something else.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// Brings the hierarchies up to date; returns what was built.
    ///
    /// # Errors
    /// `Device`.
    pub fn sync(&mut self, _gpu: &Gpu, prepared: &Prepared) -> Result<Vec<&'static str>> {
        let placed: Vec<_> = prepared.placed.iter().map(|p| (p.mesh.id, p.scene_from_object.to_cols_array())).collect();
        if placed == self.placed {
            return Ok(Vec::new());
        }
        let mut built = Vec::new();
        if prepared.placed.iter().any(|p| !p.mesh.has_blas()) {
            built.push("bottom-level BVH");
        }
        let instance = |p: &Placed| TraceInstance::new(affine(p.scene_from_object), Arc::clone(p.mesh.blas()));
        self.scene = TraceScene::new(prepared.placed.iter().map(instance).collect());
        built.push("top-level BVH");
        self.placed = placed;
        self.version += 1;
        Ok(built)
    }

    /// The nearest hit of each of the first `count` rays; returns how many were traced.
    ///
    /// # Errors
    /// `Device`, `Cancelled`.
    pub fn closest(
        &self,
        recorder: &mut Recorder<'_>,
        stage: &str,
        rays: &Buffer<Ray>,
        hits: &Buffer<Hit>,
        count: usize,
    ) -> Result<u64> {
        recorder.host(stage, |gpu, _| {
            let rays = gpu.view(rays, 0..count)?;
            let mut answers = gpu.view_mut(hits, 0..count)?;
            self.scene.closest(&rays, &mut answers, &GO_ON);
            answers.commit(gpu)?;
            Ok(active(&rays))
        })
    }

    /// Bit i % 32 of word i / 32 is set where ray i hits anything.
    ///
    /// # Errors
    /// `Device`, `Cancelled`.
    pub fn any(
        &self,
        recorder: &mut Recorder<'_>,
        stage: &str,
        rays: &Buffer<Ray>,
        occluded: &Buffer<u32>,
        count: usize,
    ) -> Result<u64> {
        recorder.host(stage, |gpu, _| {
            let rays = gpu.view(rays, 0..count)?;
            let mut answers = gpu.view_mut(occluded, 0..count.div_ceil(32))?;
            self.scene.any(&rays, &mut answers, &GO_ON);
            answers.commit(gpu)?;
            Ok(active(&rays))
        })
    }

    /// Which samples of a light each receiver sees.
    ///
    /// # Errors
    /// `Device`, `Cancelled`.
    pub fn shadow(
        &self,
        recorder: &mut Recorder<'_>,
        stage: &str,
        receivers: &Buffer<Receiver>,
        light: &LightSamples,
        visibility: &Buffer<u32>,
        count: usize,
    ) -> Result<u64> {
        let words = light.strata.div_ceil(32) as usize;
        recorder.host(stage, |gpu, _| {
            let points = gpu.view(&light.points, 0..light.points.len())?;
            let receivers = gpu.view(receivers, 0..count)?;
            let mut answers = gpu.view_mut(visibility, 0..count * words)?;
            let table = SampleTable {
                points: &points,
                strata: light.strata,
                light_normal: light.normal.to_array(),
                two_sided: light.two_sided,
                cone_axis: light.normal.to_array(),
                cos_cutoff: light.cos_cutoff,
            };
            let rays = self.scene.shadow(&receivers, &table, &mut answers, &GO_ON);
            answers.commit(gpu)?;
            Ok(rays)
        })
    }

    /// Writes misses, for a scene without anything to hit.
    ///
    /// # Errors
    /// `Device`.
    pub fn miss_all(&self, recorder: &mut Recorder<'_>, hits: &Buffer<Hit>) -> Result<()> {
        hits.write(recorder.gpu(), 0, &vec![Hit::MISS; hits.len()])
    }
}

fn active(rays: &[Ray]) -> u64 {
    rays.iter().filter(|ray| ray.t_max > ray.t_min).count() as u64
}

/// Rounded once, from float64 (N7).
fn affine(m: DMat4) -> Affine3A {
    let [x, y, z, w] = [m.x_axis, m.y_axis, m.z_axis, m.w_axis].map(|c| c.truncate().as_vec3());
    Affine3A::from_cols(x.into(), y.into(), z.into(), w.into())
}
