//! The answers of the cell rays, a cell each.

use super::list_params::{Asked, ListParams, TILE_CELLS};
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;

/// Writes `cell_bits` of the piece's tiles.
///
/// # Errors
/// Those of the device.
pub fn record(context: &mut Context<'_, '_>, piece: &Asked<'_>, cell_bits: &Buffer<u32>) -> Result<()> {
    let entry = if piece.light.is_area() { "main" } else { "spot" };
    let kernel = context.kernel("refine/cells", entry)?;
    let params = ListParams::new(context, piece.light, piece.first);
    context
        .recorder
        .pass("cells", &kernel)
        .uniform("params", &params)
        .bind("receivers", piece.receivers)
        .bind("visible", piece.bits)
        .bind("open_tiles", piece.list)
        .bind("cell_bits", cell_bits)
        .dispatch(piece.count * TILE_CELLS)
}
