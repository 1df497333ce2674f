//! The visible part of a light at each pixel of the zone.

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;
use crate::passes::refine::list_params::{Asked, CELL_PIXELS, ListParams};
use crate::passes::refine::zone::Cells;

/// Shares of the pixels that asked for themselves.
///
/// # Errors
/// Those of the device.
pub fn pixels(
    context: &mut Context<'_, '_>,
    piece: &Asked<'_>,
    cells: &Cells,
    radiance_tiles: &Buffer<[f32; 4]>,
) -> Result<()> {
    let kernel = context.kernel("gather/share", "pixels")?;
    let params = ListParams::new(context, piece.light, piece.first);
    context
        .recorder
        .pass("share", &kernel)
        .uniform("params", &params)
        .bind("receivers", piece.receivers)
        .bind("visible", piece.bits)
        .bind("listed_cells", piece.list)
        .bind("cell_agreed", &cells.agreed)
        .bind("cell_plan", &cells.plan)
        .bind("lights", context.scene.lights()?)
        .bind("radiance_tiles", radiance_tiles)
        .bind("share", &cells.share)
        .dispatch(piece.count * CELL_PIXELS)
}

/// Shares of the pixels that go by their cells' answers.
///
/// # Errors
/// Those of the device.
pub fn cells(
    context: &mut Context<'_, '_>,
    piece: &Asked<'_>,
    cells: &Cells,
    radiance_tiles: &Buffer<[f32; 4]>,
) -> Result<()> {
    let kernel = context.kernel("gather/share", "cells")?;
    let params = ListParams::new(context, piece.light, piece.first);
    context
        .recorder
        .pass("share", &kernel)
        .uniform("params", &params)
        .bind("g_position", &piece.gbuffer.position)
        .bind("g_normal", &piece.gbuffer.normal)
        .bind("listed_cells", piece.list)
        .bind("cell_agreed", &cells.agreed)
        .bind("cell_bits", &cells.bits)
        .bind("lights", context.scene.lights()?)
        .bind("radiance_tiles", radiance_tiles)
        .bind("share", &cells.share)
        .dispatch(piece.count * CELL_PIXELS)
}
