//! What surface samples reflect, left in the cells before them.

use bytemuck::{Pod, Zeroable};

use super::points::Placed;
use super::{Flow, most};
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;

/// Twin of `InjectParams` in `shaders/passes/lpv/inject.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct InjectParams {
    /// Largest net flow, as a share.
    pub most: f32,
    /// Unused.
    pub pad0: u32,
    /// Unused.
    pub pad1: u32,
    /// Unused.
    pub pad2: u32,
}

/// Fills `flow` with what the points reflect.
///
/// # Errors
/// Those of the device.
pub(super) fn record(
    context: &mut Context<'_, '_>,
    placed: &Placed,
    radiosity: &Buffer<[f32; 4]>,
    flow: &Flow,
) -> Result<()> {
    context.recorder.clear(flow)?;
    if placed.occupied == 0 {
        return Ok(());
    }
    let shared = f64::from(u8::from(context.settings.is("lpv_injection", "paper")));
    let params = InjectParams { most: most(context.settings), ..InjectParams::zeroed() };
    let kernel = context.kernel_with("lpv/inject", "main", &[("SHARED", shared)])?;
    let pass = context.recorder.pass("inject", &kernel).uniform("volume", &placed.volume).uniform("params", &params);
    let pass = pass.bind("cells", &placed.cells).bind("points", &placed.points);
    pass.bind("radiosity", radiosity).bind("flow", flow).dispatch(placed.occupied)
}
