//! What the pixels in a penumbra ask of a light for themselves.

use super::list_params::{Asked, CELL_PIXELS, ListParams};
use super::zone::Cells;
use crate::error::Result;
use crate::passes::Context;

/// Writes the receivers of the piece's cells, four each, and what they ask.
///
/// # Errors
/// Those of the device.
pub fn record(context: &mut Context<'_, '_>, piece: &Asked<'_>, cells: &Cells) -> Result<()> {
    let kernel = context.kernel("refine/zone_rays", "main")?;
    let params = ListParams::new(context, piece.light, piece.first);
    context
        .recorder
        .pass("zone_rays", &kernel)
        .uniform("params", &params)
        .bind("g_position", &piece.gbuffer.position)
        .bind("g_normal", &piece.gbuffer.normal)
        .bind("g_geometric", &piece.gbuffer.geometric)
        .bind("traced_cells", piece.list)
        .bind("cell_agreed", &cells.agreed)
        .bind("cell_plan", &cells.plan)
        .bind("receivers", piece.receivers)
        .bind("asked", piece.bits)
        .dispatch(piece.count * CELL_PIXELS)
}
