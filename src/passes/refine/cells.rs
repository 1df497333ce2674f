//! The answers of the cell rays, a cell each.

use super::list_params::{Asked, ListParams, TILE_CELLS};
use super::zone::Cells;
use crate::error::Result;
use crate::passes::Context;

/// Writes bits and surfaces of the cells of the piece's tiles.
///
/// # Errors
/// Those of the device.
pub fn record(context: &mut Context<'_, '_>, piece: &Asked<'_>, cells: &Cells) -> Result<()> {
    let entry = if piece.light.is_area() { "main" } else { "spot" };
    let kernel = context.kernel("refine/cells", entry)?;
    let params = ListParams::new(context, piece.light, piece.first);
    let pass = context
        .recorder
        .pass("cells", &kernel)
        .uniform("params", &params)
        .bind("receivers", piece.receivers)
        .bind("visible", piece.bits)
        .bind("open_tiles", piece.list)
        .bind("cell_bits", &cells.bits);
    if piece.light.is_area() {
        pass.bind("cell_surface", &cells.surface)
            .bind("light_points", &piece.light.points)
            .bind("lights", context.scene.lights()?)
            .dispatch(piece.count * TILE_CELLS)
    } else {
        pass.dispatch(piece.count * TILE_CELLS)
    }
}
