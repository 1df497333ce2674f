//! What the pixels of open tiles ask of a light.

use super::light_bounds::LightFrame;
use super::list_params::{Asked, ListParams};
use crate::error::Result;
use crate::passes::{Context, TILE_PIXELS};

/// Writes the receivers of the piece's tiles, 64 each, and what they ask.
///
/// # Errors
/// Those of the device.
pub fn record(context: &mut Context<'_, '_>, frame: &LightFrame, piece: &Asked<'_>) -> Result<()> {
    let entry = if piece.light.is_area() { "main" } else { "spot" };
    let kernel = context.kernel("refine/cell_rays", entry)?;
    let params = ListParams::new(context, piece.light, piece.first);
    context
        .recorder
        .pass("cell_rays", &kernel)
        .uniform("params", &params)
        .uniform("frame", frame)
        .bind("g_position", &piece.gbuffer.position)
        .bind("g_normal", &piece.gbuffer.normal)
        .bind("g_geometric", &piece.gbuffer.geometric)
        .bind("lights", context.scene.lights()?)
        .bind("open_tiles", piece.list)
        .bind("receivers", piece.receivers)
        .bind("asked", piece.bits)
        .dispatch(piece.count * TILE_PIXELS as usize)
}
