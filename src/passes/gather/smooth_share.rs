//! Averages the share over neighbours on the same surface.

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::lights::light_samples::LightSamples;
use crate::passes::refine::list_params::{CELL_PIXELS, ListParams};
use crate::passes::refine::zone::Cells;
use crate::passes::{Context, GBuffer};

/// Smooth shares at the pixels of `count` listed cells: those that asked for themselves, or those that did not.
///
/// # Errors
/// Those of the device.
pub fn record(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    light: &LightSamples,
    cells: &Cells,
    list: (&Buffer<u32>, usize, bool),
    smooth: &Buffer<[f32; 4]>,
) -> Result<()> {
    let (listed_cells, count, traced) = list;
    let kernel = context.kernel("gather/smooth_share", if traced { "pixels" } else { "cells" })?;
    let params = ListParams::new(context, light, 0);
    let pass = context
        .recorder
        .pass("smooth_share", &kernel)
        .uniform("params", &params)
        .bind("g_position", &gbuffer.position)
        .bind("g_geometric", &gbuffer.geometric)
        .bind("listed_cells", listed_cells)
        .bind("cell_state", &cells.state)
        .bind("share", &cells.share)
        .bind("smooth_share", smooth);
    if traced {
        pass.bind("cell_plan", &cells.plan).dispatch(count * CELL_PIXELS)
    } else {
        pass.dispatch(count * CELL_PIXELS)
    }
}
