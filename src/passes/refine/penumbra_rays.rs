//! One ray for each cell of the zone, towards a place of the light that it does not see.

use super::list_params::ListParams;
use super::zone::Cells;
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::lights::light_samples::LightSamples;
use crate::passes::visibility::Ray;
use crate::passes::{Context, GBuffer};

/// Writes the rays of `count` cells from entry `first` of the list on.
///
/// # Errors
/// Those of the device.
pub fn record(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    light: &LightSamples,
    cells: &Cells,
    list: (&Buffer<u32>, usize, usize),
    rays: &Buffer<Ray>,
) -> Result<()> {
    let (zone_cells, first, count) = list;
    let kernel = context.kernel("refine/penumbra_rays", "main")?;
    let params = ListParams::new(context, light, first);
    context
        .recorder
        .pass("penumbra_rays", &kernel)
        .uniform("params", &params)
        .bind("g_position", &gbuffer.position)
        .bind("g_normal", &gbuffer.normal)
        .bind("g_geometric", &gbuffer.geometric)
        .bind("zone_cells", zone_cells)
        .bind("cell_bits", &cells.bits)
        .bind("light_points", &light.points)
        .bind("rays", rays)
        .dispatch(count)
}
