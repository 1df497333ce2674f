//! From hits to what the other passes know of a pixel.

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::visibility::Hit;
use crate::passes::{Context, GBuffer, View};

/// The G-buffer's place in memory; its contents are those of the last frame until `record` runs.
///
/// # Errors
/// `Device` when the image is larger than the adapter allows.
pub fn buffers(context: &mut Context<'_, '_>) -> Result<GBuffer> {
    let pixels = context.view.pixels();
    let mut row = |name: &str| context.resources.buffer(name, pixels);
    Ok(GBuffer {
        position: row("g_position")?,
        normal: row("g_normal")?,
        geometric: row("g_geometric")?,
        albedo: row("g_albedo")?,
    })
}

/// Fills the G-buffer from the hits of `count` primary rays from place `first` of the tile order on.
///
/// # Errors
/// Those of the device.
pub fn record(
    context: &mut Context<'_, '_>,
    hits: &Buffer<Hit>,
    gbuffer: &GBuffer,
    first: usize,
    count: usize,
) -> Result<()> {
    let view = View { first: first as u32, ..context.view };
    let features = context.prepared.features();
    let kernel = context.kernel_with("geometry/gbuffer", "main", &[("FEATURES", features.into())])?;
    let scene = context.scene;
    context
        .recorder
        .pass("gbuffer", &kernel)
        .uniform("view", &view)
        .bind("hits", hits)
        .bind("geometry", scene.geometry()?)
        .bind("instances", scene.instances()?)
        .bind("texels", scene.texels()?)
        .bind("g_position", &gbuffer.position)
        .bind("g_normal", &gbuffer.normal)
        .bind("g_geometric", &gbuffer.geometric)
        .bind("g_albedo", &gbuffer.albedo)
        .dispatch_cut(count, 100.0)
}
