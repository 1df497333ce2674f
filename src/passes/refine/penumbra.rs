//! How wide the penumbra is at each cell of the zone, and what the cell does for that reason.

use bytemuck::{Pod, Zeroable};

use super::list_params::thrifty;
use super::zone::Cells;
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::visibility::{Hit, Ray};
use crate::passes::{Context, GBuffer};

/// Penumbra widths, pixels, from which on a cell's own answers suffice, one stratum of each block, four of it; and below
/// which nothing is averaged.
const UNTRACED: f32 = 36.0;
const ONE: f32 = 24.0;
const FOUR: f32 = 0.15;
const NARROW: f32 = 2.0;
const WIDE: f32 = 12.0;
const CALM: f32 = 24.0;
/// By how much the first two are larger where there are several lights or a picture.
const MANY: f32 = 4.0 / 3.0;

/// Twin of `PenumbraParams` in `shaders/passes/refine/penumbra.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct PenumbraParams {
    /// Internal columns.
    pub width: u32,
    /// Internal rows.
    pub height: u32,
    /// Entry of the list at which this piece begins.
    pub first: u32,
    /// Strata that a pixel may ask of a block.
    pub most_subs: u32,
    /// Shorter edge of the light.
    pub light_size: f32,
    /// Width from which on no pixel asks for itself.
    pub untraced: f32,
    /// Width from which on a pixel asks one stratum of a block.
    pub one: f32,
    /// Width from which on it asks four.
    pub four: f32,
    /// Width below which nothing is averaged.
    pub narrow: f32,
    /// Width from which on 5 × 5 pixels are averaged.
    pub wide: f32,
    /// Width from which on a cell in which little changes goes by its own answers.
    pub calm: f32,
    /// Unused.
    pub pad: u32,
}

impl PenumbraParams {
    /// For a light whose shorter edge is `light_size`.
    pub fn new(context: &Context<'_, '_>, light_size: f32, first: usize) -> Self {
        // The more samples a user grants, the fewer pixels do with less.
        let samples = context.settings.int("light_samples");
        let most_subs = match samples {
            256.. => 16,
            64.. => 4,
            _ => 1,
        };
        let (untraced, one, four) = match samples {
            1024.. => (f32::MAX, f32::MAX, f32::MAX),
            _ if thrifty(context) => (UNTRACED * MANY, ONE * MANY, 0.0),
            _ => (UNTRACED, ONE, FOUR),
        };
        // Fragments of level 1 go by their cells' answers.
        let untraced = if context.settings.int("finest_level") > 0 { 0.0 } else { untraced };
        Self {
            width: context.view.width,
            height: context.view.height,
            first: first as u32,
            most_subs,
            light_size,
            untraced,
            one,
            four,
            narrow: NARROW,
            wide: WIDE,
            calm: if thrifty(context) { WIDE } else { CALM },
            ..Self::zeroed()
        }
    }
}

/// Widths of `count` cells from entry `first` of the list on.
///
/// # Errors
/// Those of the device.
pub fn widths(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    params: &PenumbraParams,
    list: (&Buffer<u32>, usize),
    answers: (&Buffer<Ray>, &Buffer<Hit>),
    cell_width: &Buffer<f32>,
) -> Result<()> {
    let kernel = context.kernel("refine/penumbra", "widths")?;
    let view = context.view;
    context
        .recorder
        .pass("penumbra", &kernel)
        .uniform("params", params)
        .uniform("view", &view)
        .bind("rays", answers.0)
        .bind("hits", answers.1)
        .bind("zone_cells", list.0)
        .bind("g_geometric", &gbuffer.geometric)
        .bind("cell_width", cell_width)
        .dispatch(list.1)
}

/// Plans of all cells of the list.
///
/// # Errors
/// Those of the device.
pub fn plans(
    context: &mut Context<'_, '_>,
    params: &PenumbraParams,
    list: (&Buffer<u32>, usize),
    cell_width: &Buffer<f32>,
    cells: &Cells,
) -> Result<()> {
    let kernel = context.kernel("refine/penumbra", "plans")?;
    context
        .recorder
        .pass("penumbra", &kernel)
        .uniform("params", params)
        .bind("zone_cells", list.0)
        .bind("cell_width", cell_width)
        .bind("cell_plan", &cells.plan)
        .dispatch(list.1)
}
