//! Irradiance of nodes from the samples that they and their neighbours see.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;
use crate::passes::lights::light_samples::{self, LightSamples};
use crate::passes::refine::nodes::{Level, Nodes};

/// Twin of `InterleavedParams` in `shaders/common/light_terms.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct InterleavedParams {
    /// First node of the level.
    pub first: u32,
    /// Samples that a node asks.
    pub strata: u32,
    /// Words of bits a node; 0: everything is seen.
    pub words: u32,
    /// Sets of samples: 1 or 4.
    pub classes: u32,
    /// Of the lit side, or a spot's axis.
    pub normal: [f32; 3],
    /// Of a spot; -2 for an area light.
    pub cos_cutoff: f32,
    /// Of the light; of a spot its position.
    pub corner: [f32; 3],
    /// 1: both sides emit.
    pub two_sided: u32,
    /// From stratum to stratum along edge u.
    pub step_u: [f32; 3],
    /// Samples of a set along a row of the light.
    pub row: u32,
    /// From stratum to stratum along edge v.
    pub step_v: [f32; 3],
    /// Unused.
    pub pad: u32,
}

/// Adds one light to the nodes of a level; `bits` as [`crate::passes::visibility::reuse::Reuse`] left them, or none
/// where everything is seen.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(
    context: &mut Context<'_, '_>,
    nodes: &Nodes,
    level: Level,
    light: &LightSamples,
    bits: Option<&Buffer<u32>>,
) -> Result<()> {
    let nothing: Buffer<u32> = context.resources.buffer("no_bits", 2)?;
    let params = params(context, level, light, bits.map_or(0, |_| light.strata.div_ceil(32)));
    let kernel = context.kernel_with("gather/interleaved", "main", &overrides(context, light))?;
    let pyramid = nodes.pyramid.at(level.level);
    let pass = context.recorder.pass("interleaved", &kernel).uniform("params", &params).uniform("pyramid", &pyramid);
    let pass = pass.bind("node_rows", &nodes.rows).bind("node_at", &nodes.at);
    let pass = pass.bind("node_receivers", &nodes.receivers).bind("node_bits", bits.unwrap_or(&nothing));
    let pass = pass.bind("light_points", &light.points).bind("light_radiance", &light.radiance);
    let work = 400.0 + 20.0 * f64::from(light.strata * light.classes);
    pass.bind("node_irradiance", &nodes.irradiance).dispatch_cut(level.count, work)
}

/// What a light's samples add to the nodes of a level; `words` of bits, 0 where everything is seen.
pub fn params(context: &Context<'_, '_>, level: Level, light: &LightSamples, words: u32) -> InterleavedParams {
    let [corner, step_u, step_v] = strata(context, light);
    InterleavedParams {
        first: level.first as u32,
        strata: light.strata,
        words,
        classes: light.classes,
        normal: light.normal.to_array(),
        cos_cutoff: light.cos_cutoff,
        corner,
        two_sided: light.two_sided.into(),
        step_u,
        row: light.row(),
        step_v,
        pad: 0,
    }
}

/// What is the same for all samples: that they lie in the middles of their strata, and their radiance.
pub fn overrides(context: &Context<'_, '_>, light: &LightSamples) -> [(&'static str, f64); 2] {
    let grid = light.patterns == light.classes && light.classes > 1;
    let constant = !context.prepared.light_textures.contains_key(&(light.light as usize));
    [("GRID", f64::from(u8::from(grid))), ("CONSTANT", f64::from(u8::from(constant)))]
}

/// Corner of a light, and the steps from stratum to stratum; none for a spot.
fn strata(context: &Context<'_, '_>, light: &LightSamples) -> [[f32; 3]; 3] {
    let [corner, edge_u, edge_v] = light_samples::edges(context, light.light as usize).map(Vec3::from);
    if !light.is_area() {
        return [corner.to_array(), [0.0; 3], [0.0; 3]];
    }
    let all = light.strata * light.classes;
    let [along_u, along_v] = [light.strata_u, all / light.strata_u].map(|n| 1.0 / n as f32);
    [corner.to_array(), (edge_u * along_u).to_array(), (edge_v * along_v).to_array()]
}
