//! Irradiance from the light that passed the cells before each receiver.

use std::f32::consts::PI;

use bytemuck::{Pod, Zeroable};

use super::Passed;
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;
use crate::passes::visibility::Receiver;

/// What a receiver costs at first guess, nanoseconds.
const RECEIVER_NS: f64 = 300.0;

/// Twin of `LookUpParams` in `shaders/passes/lpv/look_up.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct LookUpParams {
    /// Irradiance of a unit of mean that left through a face.
    pub scale: f32,
    /// Unused.
    pub pad0: u32,
    /// Unused.
    pub pad1: u32,
    /// Unused.
    pub pad2: u32,
}

/// Irradiance of `count` receivers at the places that their `pixel` says.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub(super) fn record(
    context: &mut Context<'_, '_>,
    (receivers, count): (&Buffer<Receiver>, usize),
    Passed { placed, passed }: &Passed,
    irradiance: &Buffer<[f32; 4]>,
) -> Result<()> {
    let volume = &placed.volume;
    let area = volume.edge * volume.edge;
    // A mean of 1 is a flux of the square root of 4 pi.
    let scale = (4.0 * PI).sqrt() / area;
    let params = LookUpParams { scale, pad0: 0, pad1: 0, pad2: 0 };
    // One inside of another takes over what it holds, less and less towards its border.
    let nested = f64::from(u8::from(placed.first.is_some()));
    let kernel = context.kernel_with("lpv/look_up", "main", &[("NESTED", nested)])?;
    let pass = context.recorder.pass("look_up", &kernel).uniform("volume", volume).uniform("params", &params);
    let pass = pass.bind("receivers", receivers).bind("passed_lower", &passed[0]).bind("passed_upper", &passed[1]);
    let pass = pass.bind("open", &placed.open).bind("met", &placed.met);
    pass.bind("irradiance", irradiance).dispatch_cut(count, RECEIVER_NS)
}
