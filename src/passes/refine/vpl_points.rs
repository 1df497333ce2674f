//! What lists of virtual lights need before they are refined: shading points, and what a difference may be.

use bytemuck::{Pod, Zeroable};

use super::pyramid::Pyramid;
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::indirect::light_cut::reach;
use crate::passes::indirect::{mixed, parts};
use crate::passes::lights::virtual_light::VirtualLights;
use crate::passes::{Context, GBuffer};

/// What one virtual light costs a texel at first guess, nanoseconds.
const PAIR_NS: f64 = 7.0;

/// Twin of `ShadedPoint` in `shaders/common/shaded_point.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct ShadedPoint {
    /// Where light arrives.
    pub origin: [f32; 3],
    /// Of the lobe.
    pub exponent: f32,
    /// Unit.
    pub normal_shade: [f32; 3],
    /// Of what the lobe reflects.
    pub red: f32,
    /// Unit.
    pub normal_geo: [f32; 3],
    /// Of what the lobe reflects.
    pub green: f32,
    /// Unit: the middle of the lobe.
    pub mirror: [f32; 3],
    /// Of what the lobe reflects.
    pub blue: f32,
}

/// Twin of `ShortLight` in `shaders/common/shaded_point.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct ShortLight {
    /// Position and area.
    pub place: [f32; 4],
    /// Normal and radius.
    pub facing: [f32; 4],
    /// Reflected, and what a difference may be.
    pub flux: [f32; 4],
}

/// Twin of `VplPointsParams` in `shaders/passes/refine/vpl_points.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct VplPointsParams {
    /// Virtual lights.
    pub lights: u32,
    /// How far each reaches.
    pub reach: f32,
    /// Difference over the mean irradiance; negative: any.
    pub threshold: f32,
    /// Virtual light of this part.
    pub first: u32,
    /// One past its last.
    pub end: u32,
    /// Unused.
    pub pad0: u32,
    /// Unused.
    pub pad1: u32,
    /// Unused.
    pub pad2: u32,
}

/// Shading points and virtual lights.
#[derive(Debug, Clone)]
pub struct Points {
    /// Of the texels from level 1 on.
    pub points: Buffer<ShadedPoint>,
    /// All of them.
    pub lights: Buffer<ShortLight>,
}

/// Exponents and reflectances of lobes, a row an instance; of a scene without any an empty one.
///
/// # Errors
/// Those of the device.
pub fn lobes(context: &mut Context<'_, '_>, glossy: bool) -> Result<Buffer<[f32; 4]>> {
    if glossy { context.scene.lobes().cloned() } else { context.resources.buffer("no_lobes", 1) }
}

/// Values of the override constants of all passes of these lists.
pub fn constants(context: &Context<'_, '_>, glossy: bool) -> [(&'static str, f64); 3] {
    let disc = !context.settings.is("form_factor", "point");
    [("DISC", disc.into()), ("GLOSSY", glossy.into()), mixed(context.settings)]
}

/// The points of all texels of `pyramid` that are lit in `state`.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    (pyramid, state): (&Pyramid, &Buffer<u32>),
    virtual_lights: &VirtualLights,
    glossy: bool,
) -> Result<Points> {
    let (texels, count) = (pyramid.texels_above(), virtual_lights.count);
    let coarsest = pyramid.levels[pyramid.coarsest as usize][3] as usize;
    let threshold = context.settings.float("illumination_threshold").map_or(-1.0, |t| t as f32);
    let params =
        VplPointsParams { lights: count as u32, reach: reach(context.settings), threshold, ..Zeroable::zeroed() };
    let points = context.resources.buffer("vpl_points", texels)?;
    let lights = context.resources.buffer("short_lights", count.max(1))?;
    let estimates: Buffer<[f32; 2]> = context.resources.buffer("vpl_estimates", coarsest)?;
    let mean: Buffer<f32> = context.resources.buffer("vpl_mean", 1)?;
    let (lobes, constants) = (lobes(context, glossy)?, constants(context, glossy));
    let kernel = |entry| context.kernel_with("refine/vpl_points", entry, &constants);
    let [middles, estimate, averaged, table] =
        [kernel("middles")?, kernel("estimate")?, kernel("mean")?, kernel("table")?];
    let pass = context.recorder.pass("vpl_points", &middles).uniform("pyramid", pyramid);
    let pass = pass.uniform("view", &context.view).bind("g_position", &gbuffer.position);
    let pass = pass.bind("g_normal", &gbuffer.normal).bind("g_geometric", &gbuffer.geometric);
    let pass = pass.bind("g_albedo", &gbuffer.albedo).bind("instance_lobes", &lobes);
    pass.bind("texel_state", state).bind("points", &points).dispatch(texels)?;
    for part in parts::ranges(count) {
        let params = VplPointsParams { first: part.start as u32, end: part.end as u32, ..params };
        let pass = context.recorder.pass("vpl_points", &estimate).uniform("params", &params);
        let pass = pass.uniform("pyramid", pyramid).bind("points", &points).bind("texel_state", state);
        let pass = pass.bind("estimates", &estimates).bind("virtual_lights", &virtual_lights.lights);
        pass.dispatch_cut(coarsest, PAIR_NS * part.len().max(1) as f64)?;
    }
    let pass = context.recorder.pass("vpl_points", &averaged).uniform("pyramid", pyramid);
    pass.bind("estimates", &estimates).bind("mean_irradiance", &mean).dispatch_groups(1)?;
    let pass = context.recorder.pass("vpl_points", &table).uniform("params", &params);
    let pass = pass.bind("virtual_lights", &virtual_lights.lights).bind("mean_irradiance", &mean);
    pass.bind("short_lights", &lights).dispatch(count)?;
    Ok(Points { points, lights })
}
