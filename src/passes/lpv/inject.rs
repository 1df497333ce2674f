//! What surface samples reflect, left in the cells before them.

use bytemuck::{Pod, Zeroable};
use glam::IVec3;

use super::points::Placed;
use super::{Flow, Passed, most};
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

/// Twin of `EnterParams` in `shaders/passes/lpv/inject.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct EnterParams {
    /// Way that light flies in which it enters; 0: all.
    pub side: [f32; 3],
    /// Largest net flow, as a share.
    pub most: f32,
    /// Cells of the volume outside.
    pub outer: [u32; 3],
    /// All of them.
    pub outer_cells: u32,
    /// That with which the volume inside begins.
    pub first: [u32; 3],
    /// Unused.
    pub pad: u32,
}

/// What a cell's channel costs at first guess, nanoseconds.
const ENTER_NS: f64 = 20.0;

/// Adds to `flow` what left the volume outside through the border of this one.
///
/// # Errors
/// Those of the device.
pub(super) fn enter(
    context: &mut Context<'_, '_>,
    placed: &Placed,
    outer: &Passed,
    side: IVec3,
    flow: &Flow,
) -> Result<()> {
    let whole = &outer.placed.volume;
    let params = EnterParams {
        side: side.as_vec3().to_array(),
        most: most(context.settings),
        outer: whole.size,
        outer_cells: whole.cells,
        first: placed.first.unwrap_or_default(),
        pad: 0,
    };
    let kernel = context.kernel("lpv/inject", "enter")?;
    let pass = context.recorder.pass("inject", &kernel).uniform("volume", &placed.volume).uniform("entering", &params);
    let pass = pass.bind("outer_met", &outer.placed.met).bind("flow", flow);
    let pass = pass.bind("outer_lower", &outer.passed[0]).bind("outer_upper", &outer.passed[1]);
    pass.dispatch_cut(3 * placed.volume.cells as usize, ENTER_NS)
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
