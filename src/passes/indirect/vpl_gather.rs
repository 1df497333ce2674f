//! Irradiance from every virtual light of a list.

use bytemuck::{Pod, Zeroable};

use super::{forms, light_cut};
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;
use crate::passes::lights::virtual_light::{Rsm, VirtualLights};
use crate::passes::visibility::Receiver;

/// What one virtual light costs a receiver at first guess, nanoseconds.
const PAIR_NS: f64 = 7.0;

/// Twin of `VplGatherParams` in `shaders/passes/indirect/vpl_gather.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct VplGatherParams {
    /// Virtual lights.
    pub count: u32,
    /// How far each reaches.
    pub reach: f32,
    /// Unused.
    pub pad0: u32,
    /// Unused.
    pub pad1: u32,
}

/// Irradiance of `count` receivers at the places that their `pixel` says.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(
    context: &mut Context<'_, '_>,
    (receivers, count): (&Buffer<Receiver>, usize),
    rsm: &Rsm,
    lights: &VirtualLights,
    irradiance: &Buffer<[f32; 4]>,
) -> Result<()> {
    let params =
        VplGatherParams { count: lights.count as u32, reach: light_cut::reach(context.settings), pad0: 0, pad1: 0 };
    let kernel = context.kernel_with("indirect/vpl_gather", "main", &forms(context.settings))?;
    let pass = context.recorder.pass("vpl_gather", &kernel).uniform("params", &params);
    let pass = pass.bind("receivers", receivers).bind("maps", &rsm.table);
    let pass = pass.bind("virtual_lights", &lights.lights).bind("irradiance", irradiance);
    pass.dispatch_cut(count, PAIR_NS * lights.count.max(1) as f64)
}
