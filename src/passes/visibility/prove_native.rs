//! The native form of `prove`: which tiles see a whole light, and which see none of it, without a ray.
use std::sync::atomic::AtomicBool;

use super::native::{dispatch, prove};
use super::trace_native::TraceScene;
use crate::passes::refine::light_bounds::{LightFrame, TileBounds};

/// Tiles of 8 × 8 pixels and what they show.
#[derive(Clone, Copy, Debug)]
pub struct ProofTiles<'a> {
    /// The light.
    pub frame: &'a LightFrame,
    /// Where the facing pixels of each tile lie in the light's frame.
    pub bounds: &'a [TileBounds],
    /// Rows of the G-buffer: scene-space position and the bound of its error.
    pub position: &'a [[u32; 4]],
    /// Shading normal and what is seen.
    pub normal: &'a [[u32; 4]],
    /// Geometric normal.
    pub geometric: &'a [[u32; 4]],
    /// Columns of the image.
    pub width: u32,
    /// Rows of the image.
    pub height: u32,
}

impl TraceScene {
    /// Sets `LIT` where no segment from the ray origin of a facing pixel to any point of the light can meet a triangle,
    /// and `DARK` where one triangle blocks all of them. `flags` are those of the tiles from `first` on. Both are proofs
    /// up to a rounding; what is not proven is left as it is.
    pub fn prove(&self, tiles: &ProofTiles<'_>, first: usize, flags: &mut [u32], cancel: &AtomicBool) {
        dispatch::prove(self, &prove::Job::new(self, tiles), first, flags, cancel);
    }
}
