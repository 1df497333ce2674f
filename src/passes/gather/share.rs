//! The visible part of a light at each pixel of the zone.

use std::sync::Arc;

use crate::error::Result;
use crate::gpu::Kernel;
use crate::passes::Context;
use crate::passes::refine::list_params::{Asked, CELL_PIXELS, ListParams};
use crate::passes::refine::zone::Cells;

/// Leaves out what a light of one colour does not need.
fn kernel(context: &Context<'_, '_>, piece: &Asked<'_>, entry: &str) -> Result<Arc<Kernel>> {
    let picture = context.prepared.light_textures.contains_key(&(piece.light.light as usize));
    context.kernel_with("gather/share", entry, &[("PICTURE", f64::from(u8::from(picture)))])
}

/// Shares of the pixels that asked for themselves.
///
/// # Errors
/// Those of the device.
pub fn pixels(context: &mut Context<'_, '_>, piece: &Asked<'_>, cells: &Cells) -> Result<()> {
    let kernel = kernel(context, piece, "pixels")?;
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
        .bind("light_radiance", &piece.light.radiance)
        .bind("share", &cells.share)
        .dispatch(piece.count * CELL_PIXELS)
}

/// Shares of the pixels that go by their cells' answers.
///
/// # Errors
/// Those of the device.
pub fn cells(context: &mut Context<'_, '_>, piece: &Asked<'_>, cells: &Cells) -> Result<()> {
    let kernel = kernel(context, piece, "cells")?;
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
        .bind("light_radiance", &piece.light.radiance)
        .bind("share", &cells.share)
        .dispatch(piece.count * CELL_PIXELS)
}
