//! From hits to what the other passes know of a pixel.

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::visibility::Hit;
use crate::passes::{Context, GBuffer};

/// The G-buffer's place in memory; its contents are those of the last frame until `record` runs.
///
/// # Errors
/// `Device` when the image is larger than the adapter allows.
pub fn buffers(context: &mut Context<'_, '_>) -> Result<GBuffer> {
    let pixels = context.view.pixels as usize;
    let mut row = |name: &str| context.resources.buffer(name, pixels);
    Ok(GBuffer {
        position: row("g_position")?,
        normal: row("g_normal")?,
        geometric: row("g_geometric")?,
        albedo: row("g_albedo")?,
    })
}

/// Fills the G-buffer from the hits of the primary rays.
///
/// # Errors
/// Those of the device.
pub fn record(context: &mut Context<'_, '_>, hits: &Buffer<Hit>, gbuffer: &GBuffer) -> Result<()> {
    let kernel = context.kernel("geometry/gbuffer", "main")?;
    let scene = context.scene;
    context
        .recorder
        .pass("gbuffer", &kernel)
        .uniform("view", &context.view)
        .bind("hits", hits)
        .bind("geometry", scene.geometry()?)
        .bind("instances", scene.instances()?)
        .bind("texels", scene.texels()?)
        .bind("g_position", &gbuffer.position)
        .bind("g_normal", &gbuffer.normal)
        .bind("g_geometric", &gbuffer.geometric)
        .bind("g_albedo", &gbuffer.albedo)
        .dispatch_cut(context.view.tiled as usize, 100.0)
}
