//! Irradiance from the light that passed the cells before each receiver.

use bytemuck::{Pod, Zeroable};

use super::Flow;
use super::points::Placed;
use super::propagate::PropagateParams;
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
    /// Irradiance of a unit of the mean.
    pub mean: f32,
    /// Irradiance of a unit of net flow against the normal.
    pub along: f32,
    /// Unused.
    pub pad0: u32,
    /// Unused.
    pub pad1: u32,
}

/// Irradiance of `count` receivers at the places that their `pixel` says.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub(super) fn record(
    context: &mut Context<'_, '_>,
    (receivers, count): (&Buffer<Receiver>, usize),
    (total, placed): (&Flow, &Placed),
    irradiance: &Buffer<[f32; 4]>,
) -> Result<()> {
    let volume = &placed.volume;
    let area = volume.edge * volume.edge;
    let [mean, along] = PropagateParams::new(context.settings).irradiance().map(|unit| unit / area);
    let params = LookUpParams { mean, along, pad0: 0, pad1: 0 };
    let kernel = context.kernel("lpv/look_up", "main")?;
    let pass = context.recorder.pass("look_up", &kernel).uniform("volume", volume).uniform("params", &params);
    let pass =
        pass.bind("receivers", receivers).bind("total", total).bind("open", &placed.open).bind("met", &placed.met);
    pass.bind("irradiance", irradiance).dispatch_cut(count, RECEIVER_NS)
}
