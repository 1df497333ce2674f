//! The visible part of a light at each pixel of the zone.

use std::sync::Arc;

use crate::error::Result;
use crate::gpu::{Buffer, Kernel};
use crate::passes::lights::light_samples::LightSamples;
use crate::passes::refine::list_params::{Asked, CELL_PIXELS, ListParams};
use crate::passes::refine::zone::Cells;
use crate::passes::{Context, GBuffer};

/// Leaves out what a light of one colour does not need.
fn kernel(context: &Context<'_, '_>, light: &LightSamples, entry: &str) -> Result<Arc<Kernel>> {
    let picture = context.prepared.light_textures.contains_key(&(light.light as usize));
    context.kernel_with("gather/share", entry, &[("PICTURE", f64::from(u8::from(picture)))])
}

/// Shares of the pixels that asked for themselves.
///
/// # Errors
/// Those of the device.
pub fn pixels(context: &mut Context<'_, '_>, piece: &Asked<'_>, cells: &Cells) -> Result<()> {
    let kernel = kernel(context, piece.light, "pixels")?;
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
pub fn cells(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    light: &LightSamples,
    cells: &Cells,
    (listed_cells, count): (&Buffer<u32>, usize),
) -> Result<()> {
    let kernel = kernel(context, light, "cells")?;
    let params = ListParams::new(context, light, 0);
    context
        .recorder
        .pass("share", &kernel)
        .uniform("params", &params)
        .bind("g_position", &gbuffer.position)
        .bind("g_normal", &gbuffer.normal)
        .bind("listed_cells", listed_cells)
        .bind("cell_agreed", &cells.agreed)
        .bind("cell_bits", &cells.bits)
        .bind("lights", context.scene.lights()?)
        .bind("light_radiance", &light.radiance)
        .bind("share", &cells.share)
        .dispatch(count * CELL_PIXELS)
}
