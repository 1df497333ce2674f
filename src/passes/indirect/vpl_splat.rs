//! Irradiance from every virtual light of a list, drawn as points.

use bytemuck::{Pod, Zeroable};

use super::{forms, light_cut};
use crate::error::Result;
use crate::gpu::{Buffer, Target};
use crate::passes::Context;
use crate::passes::lights::virtual_light::VirtualLights;
use crate::passes::visibility::Receiver;

/// Columns of the target.
const WIDTH: u32 = 1024;
/// What a point costs at first guess, nanoseconds.
const POINT_NS: f64 = 150.0;

/// Twin of `VplSplatParams` in `shaders/passes/indirect/vpl_splat.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct VplSplatParams {
    /// Of the target.
    pub width: u32,
    /// Of the target.
    pub height: u32,
    /// Receiver of its first pixel.
    pub first: u32,
    /// How far a virtual light reaches.
    pub reach: f32,
}

/// Irradiance of `count` receivers at the places that their `pixel` says.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(
    context: &mut Context<'_, '_>,
    (receivers, count): (&Buffer<Receiver>, usize),
    lights: &VirtualLights,
    irradiance: &Buffer<[f32; 4]>,
) -> Result<()> {
    let gpu = context.recorder.gpu().clone();
    let rows = (count as u32).div_ceil(WIDTH).max(1);
    let most = gpu.limits().max_texture_dimension_2d;
    let height = rows.min(most);
    let target = Target::new(&gpu, WIDTH, height)?;
    let sums: Buffer<[f32; 4]> = context.resources.buffer("splat_sums", (WIDTH * height) as usize)?;
    let points = gpu.points("passes/indirect/vpl_splat", &forms(context.settings))?;
    let spread = context.kernel("indirect/vpl_splat", "spread")?;
    for first in (0..count).step_by((WIDTH * height) as usize) {
        let piece = (count - first).min((WIDTH * height) as usize);
        let reach = light_cut::reach(context.settings);
        let params = VplSplatParams { width: WIDTH, height, first: first as u32, reach };
        let pass = context.recorder.pass("vpl_splat", &points).uniform("params", &params);
        let pass = pass.bind("receivers", receivers).bind("virtual_lights", &lights.lights);
        pass.draw_cut(&target, piece as u32, 0..lights.count as u32, POINT_NS)?;
        context.recorder.copy_target(&target, &sums)?;
        let pass = context.recorder.pass("vpl_splat", &spread).uniform("params", &params);
        let pass = pass.bind("receivers", receivers).bind("sums", &sums);
        pass.bind("irradiance", irradiance).dispatch(piece)?;
    }
    Ok(())
}
