//! Irradiance from every virtual light of a list.

use bytemuck::{Pod, Zeroable};

use super::parts::{self, Parts};
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
    /// Virtual light of this part.
    pub first: u32,
    /// One past its last.
    pub end: u32,
    /// How far each reaches.
    pub reach: f32,
    /// Number of the part.
    pub part: u32,
    /// Parts of the list.
    pub parts: u32,
    /// Unused.
    pub pad0: u32,
    /// Unused.
    pub pad1: u32,
    /// Unused.
    pub pad2: u32,
}

/// Irradiance of `count` receivers at the places that their `pixel` says; what each part of the list has of it.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(
    context: &mut Context<'_, '_>,
    (receivers, count): (&Buffer<Receiver>, usize),
    rsm: &Rsm,
    lights: &VirtualLights,
    irradiance: &Buffer<[f32; 4]>,
) -> Result<Parts> {
    let reach = light_cut::reach(context.settings);
    let parts = Parts::new(context, count, lights.count)?;
    let kernel = context.kernel_with("indirect/vpl_gather", "main", &forms(context.settings))?;
    for (part, range) in parts::ranges(lights.count).enumerate() {
        let (first, end, part) = (range.start as u32, range.end as u32, part as u32);
        let params = VplGatherParams { first, end, reach, part, parts: parts.count as u32, ..Zeroable::zeroed() };
        let pass = context.recorder.pass("vpl_gather", &kernel).uniform("params", &params);
        let pass = pass.bind("receivers", receivers).bind("maps", &rsm.table).bind("parts", &parts.values);
        let pass = pass.bind("virtual_lights", &lights.lights).bind("irradiance", irradiance);
        pass.dispatch_cut(count, PAIR_NS * range.len().max(1) as f64)?;
    }
    Ok(parts)
}
