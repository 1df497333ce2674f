//! Shading points of a range of pixels.

use bytemuck::{Pod, Zeroable};

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::lights::light_samples;
use crate::passes::visibility::Receiver;
use crate::passes::{Context, GBuffer};

/// Twin of `ReceiversParams` in `shaders/passes/gather/receivers.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct ReceiversParams {
    /// Internal columns.
    pub width: u32,
    /// Internal rows.
    pub height: u32,
    /// First pixel, in tile order.
    pub first: u32,
    /// Sets of sample points, a power of two.
    pub patterns: u32,
    /// The user's seed.
    pub seed: u32,
    /// Unused.
    pub pad0: u32,
    /// Unused.
    pub pad1: u32,
    /// Unused.
    pub pad2: u32,
}

/// Writes `count` receivers from pixel `first` of the tile order on, and counts the active ones.
///
/// # Errors
/// Those of the device.
pub fn record(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    first: usize,
    count: usize,
    receivers: &Buffer<Receiver>,
    active: &Buffer<u32>,
) -> Result<()> {
    let kernel = context.kernel("gather/receivers", "main")?;
    let params = ReceiversParams {
        width: context.view.width,
        height: context.view.height,
        first: first as u32,
        patterns: light_samples::patterns(context),
        seed: context.settings.int("seed"),
        ..ReceiversParams::zeroed()
    };
    context
        .recorder
        .pass("receivers", &kernel)
        .uniform("params", &params)
        .bind("g_position", &gbuffer.position)
        .bind("g_normal", &gbuffer.normal)
        .bind("g_geometric", &gbuffer.geometric)
        .bind("receivers", receivers)
        .bind("active_count", active)
        .dispatch(count)
}
