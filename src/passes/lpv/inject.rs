//! What surface samples reflect, left in the cells before them.

use bytemuck::{Pod, Zeroable};
use glam::IVec3;

use super::points::Placed;
use super::{Flow, most};
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;

/// Twin of `InjectParams` in `shaders/passes/lpv/inject.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct InjectParams {
    /// Way that surfaces face whose light it is; 0: all.
    pub side: [f32; 3],
    /// Largest net flow, as a share.
    pub most: f32,
}

/// Fills `flow` with what the points reflect: all of it, or the part of surfaces that face one way.
///
/// # Errors
/// Those of the device.
pub(super) fn record(
    context: &mut Context<'_, '_>,
    placed: &Placed,
    radiosity: &Buffer<[f32; 4]>,
    side: IVec3,
    flow: &Flow,
) -> Result<()> {
    context.recorder.clear(flow)?;
    if placed.occupied == 0 {
        return Ok(());
    }
    let shared = f64::from(u8::from(context.settings.is("lpv_injection", "paper")));
    let params = InjectParams { side: side.as_vec3().to_array(), most: most(context.settings) };
    let kernel = context.kernel_with("lpv/inject", "main", &[("SHARED", shared)])?;
    let pass = context.recorder.pass("inject", &kernel).uniform("volume", &placed.volume).uniform("params", &params);
    let pass = pass.bind("cells", &placed.cells).bind("points", &placed.points);
    pass.bind("radiosity", radiosity).bind("flow", flow).dispatch(placed.occupied)
}
