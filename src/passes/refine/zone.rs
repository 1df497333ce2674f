//! Which cells are lit, which are dark, and which lie in or beside a penumbra.

use super::light_bounds::Tiles;
use super::list_params::{ListParams, TILE_CELLS};
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;
use crate::passes::lights::light_samples::LightSamples;

/// What is known of the cells, for one light.
#[derive(Debug, Clone)]
pub struct Cells {
    /// Cells of all tiles.
    pub count: usize,
    /// Which blocks of strata a cell asked and sees; tile order.
    pub bits: Buffer<u32>,
    /// Where it lies: position and whether its pixels share a surface, then normal; tile order.
    pub surface: Buffer<[f32; 4]>,
    /// None, lit, dark, zone; image order.
    pub state: Buffer<u32>,
    /// Blocks on which the neighbourhood agrees, and to what; tile order.
    pub agreed: Buffer<u32>,
    /// What a cell of the zone does; tile order.
    pub plan: Buffer<u32>,
    /// Visible share of the light at the pixels of the zone; image order.
    pub share: Buffer<[f32; 4]>,
}

impl Cells {
    /// Room for the cells of the image.
    ///
    /// # Errors
    /// `Device`.
    pub fn new(context: &mut Context<'_, '_>, tiles: usize) -> Result<Self> {
        let count = tiles * TILE_CELLS;
        let (width, height) = (context.view.width.div_ceil(2), context.view.height.div_ceil(2));
        Ok(Self {
            count,
            bits: context.resources.buffer("cell_bits", count)?,
            surface: context.resources.buffer("cell_surface", 2 * count)?,
            state: context.resources.buffer("cell_state", width as usize * height as usize)?,
            agreed: context.resources.buffer("cell_agreed", count)?,
            plan: context.resources.buffer("cell_plan", count)?,
            share: context.resources.buffer("share", context.view.pixels())?,
        })
    }
}

/// Writes state, agreement and plan of every cell; of a spot also the shares.
///
/// # Errors
/// Those of the device.
pub fn record(context: &mut Context<'_, '_>, light: &LightSamples, tiles: &Tiles, cells: &Cells) -> Result<()> {
    let entry = if light.is_area() { "main" } else { "spot" };
    let kernel = context.kernel("refine/zone", entry)?;
    let params = ListParams::new(context, light, 0);
    let pass = context
        .recorder
        .pass("zone", &kernel)
        .uniform("params", &params)
        .bind("tile_flags", &tiles.flags)
        .bind("cell_bits", &cells.bits)
        .bind("cell_state", &cells.state);
    if light.is_area() {
        let pass = pass.bind("cell_surface", &cells.surface);
        pass.bind("cell_agreed", &cells.agreed).bind("cell_plan", &cells.plan).dispatch(cells.count)
    } else {
        pass.bind("share", &cells.share).dispatch(cells.count)
    }
}
