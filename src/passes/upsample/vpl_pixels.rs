//! From lists of fragments of virtual lights to pixels.

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::refine::vpl_lists::{Lists, VplListsParams};
use crate::passes::refine::vpl_points;
use crate::passes::{Context, GBuffer};

/// What one virtual light costs a pixel at first guess, nanoseconds.
const PAIR_NS: f64 = 5.0;

/// Adds what the texels of level 1 have left of a batch, at each of their pixels.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn pixels(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    lists: &Lists,
    params: &VplListsParams,
    images: [&Buffer<[f32; 4]>; 2],
) -> Result<()> {
    let places = context.view.tiled as usize;
    for (glossy, image) in [false, true].into_iter().zip(images).take(1 + usize::from(lists.glossy)) {
        let lobes = vpl_points::lobes(context, glossy)?;
        let constants = vpl_points::constants(context, glossy);
        let kernel = context.kernel_with("upsample/vpl_pixels", "pixels", &constants)?;
        let pass = context.recorder.pass("vpl_pixels", &kernel).uniform("params", params);
        let pass = pass.uniform("pyramid", &lists.pyramid).uniform("view", &context.view);
        let pass = pass.bind("g_position", &gbuffer.position).bind("g_normal", &gbuffer.normal);
        let pass = pass.bind("g_geometric", &gbuffer.geometric).bind("g_albedo", &gbuffer.albedo);
        let pass = pass.bind("instance_lobes", &lobes).bind("short_lights", &lists.points.lights);
        let pass = pass.bind("masks", &lists.masks).bind("light", image);
        pass.dispatch_cut(places, PAIR_NS * f64::from(params.count.max(1)))?;
    }
    Ok(())
}

/// Adds what all levels hold.
///
/// # Errors
/// Those of the device.
pub fn levels(context: &mut Context<'_, '_>, lists: &Lists, lowest: u32, images: [&Buffer<[f32; 4]>; 2]) -> Result<()> {
    let kernel = context.kernel("upsample/vpl_pixels", "levels")?;
    let params = VplListsParams { lowest, ..bytemuck::Zeroable::zeroed() };
    for (held, image) in lists.held.iter().zip(images).take(1 + usize::from(lists.glossy)) {
        let pass = context.recorder.pass("vpl_pixels", &kernel).uniform("params", &params);
        let pass = pass.uniform("pyramid", &lists.pyramid).bind("texel_state", &lists.state);
        pass.bind("held", held).bind("light", image).dispatch(context.view.pixels())?;
    }
    Ok(())
}
