//! What the passes over lists of tiles and cells share.

use bytemuck::{Pod, Zeroable};

use crate::gpu::Buffer;
use crate::passes::lights::light_samples::LightSamples;
use crate::passes::visibility::Receiver;
use crate::passes::{Context, GBuffer};

/// Strata of a light; twin of `STRATA` in `shaders/common/strata.wgsl`.
pub const STRATA: u32 = 256;
/// Words of bits a receiver; twin of `WORDS`.
pub const WORDS: usize = 8;
/// Cells of a tile; twin of `TILE_CELLS` in `shaders/common/cells.wgsl`.
pub const TILE_CELLS: usize = 16;
/// Pixels of a cell.
pub const CELL_PIXELS: usize = 4;

/// Twin of `ListParams` in `shaders/common/list_params.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct ListParams {
    /// Internal columns.
    pub width: u32,
    /// Internal rows.
    pub height: u32,
    /// Which light.
    pub light: u32,
    /// Sets of sample points.
    pub patterns: u32,
    /// The user's seed.
    pub seed: u32,
    /// Entry of the list at which this piece begins.
    pub first: u32,
    /// Blocks of strata along edge u.
    pub blocks_u: u32,
    /// 1: what neighbours agree on is not asked again; 2: of what lies beside it one answer is enough.
    pub reuse: u32,
    /// Two bits a block of strata, see [`LightSamples::boosts`].
    pub boosts: u32,
    /// Unused.
    pub pad0: u32,
    /// Unused.
    pub pad1: u32,
    /// Unused.
    pub pad2: u32,
}

impl ListParams {
    /// For a light, from entry `first` of a list on.
    pub fn new(context: &Context<'_, '_>, light: &LightSamples, first: usize) -> Self {
        let reuse = match context.settings.is("visibility_reuse", "incremental") {
            true => 1 + u32::from(thrifty(context)),
            false => 0,
        };
        Self {
            width: context.view.width,
            height: context.view.height,
            light: light.light,
            patterns: light.patterns,
            seed: context.settings.int("seed"),
            first: first as u32,
            blocks_u: light.strata_u.div_ceil(4),
            reuse,
            boosts: light.boosts,
            pad0: 0,
            pad1: 0,
            pad2: 0,
        }
    }
}

/// With other lights about, each may err more for the same error of their sum; of a picture, its dimmer parts.
pub(super) fn thrifty(context: &Context<'_, '_>) -> bool {
    context.prepared.lights > 1 || !context.prepared.light_textures.is_empty()
}

/// A piece of a list of shading points, and what they ask or see.
pub struct Asked<'l> {
    /// What is seen.
    pub gbuffer: &'l GBuffer,
    /// Whose light.
    pub light: &'l LightSamples,
    /// Tiles or cells.
    pub list: &'l Buffer<u32>,
    /// First entry of the piece.
    pub first: usize,
    /// Entries.
    pub count: usize,
    /// Shading points of the piece.
    pub receivers: &'l Buffer<Receiver>,
    /// Bits of the strata that they ask, and afterwards of those that they see.
    pub bits: &'l Buffer<u32>,
}
