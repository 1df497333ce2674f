//! Which tiles see a whole light, and which none of it, as far as that can be proven without a ray. In two forms, as
//! `trace`.
use bytemuck::{Pod, Zeroable};

use super::prove_native::ProofTiles;
use super::trace::{GO_ON, Tracer, pieces};
use super::trace_wgsl::WgslTrace;
use crate::error::Result;
use crate::gpu::{Buffer, Recorder};
use crate::passes::refine::light_bounds::{LightFrame, TileBounds};
use crate::passes::{GBuffer, TILE_PIXELS, View};

/// Twin of `ProveParams` in `shaders/passes/visibility/prove.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct ProveParams {
    /// Internal columns.
    pub width: u32,
    /// Internal rows.
    pub height: u32,
    /// Unused.
    pub pad0: u32,
    /// Unused.
    pub pad1: u32,
}

/// First piece, tiles: some milliseconds.
const FIRST_TILES: usize = 2048;
/// First guess of the cost of a tile on the device, in rays.
const RAYS_A_TILE: f64 = 16.0;

impl Tracer {
    /// Sets `LIT` in the flags of tiles where no segment from the ray origin of a facing pixel to any point of the light
    /// can meet a triangle, and `DARK` where one triangle blocks all of them. Tiles without `FACING`, with `MIXED_SIDES`
    /// or with a proof are left as they are, and those of which nothing can be proven cheaply.
    ///
    /// # Errors
    /// `Device`, `Cancelled`.
    #[allow(clippy::too_many_arguments, reason = "what a pass needs of a frame")]
    pub fn prove(
        &self,
        recorder: &mut Recorder<'_>,
        stage: &str,
        frame: &LightFrame,
        bounds: &Buffer<TileBounds>,
        tile_flags: &Buffer<u32>,
        gbuffer: &GBuffer,
        view: &View,
    ) -> Result<()> {
        let count = (view.tiled / TILE_PIXELS) as usize;
        if let Some(wgsl) = &self.wgsl {
            return record(wgsl, recorder, stage, frame, bounds, tile_flags, gbuffer, view);
        }
        recorder.host(stage, |gpu, cancel| {
            let pixels = 0..view.pixels();
            let bounds = gpu.view(bounds, 0..count)?;
            let position = gpu.view(&gbuffer.position, pixels.clone())?;
            let normal = gpu.view(&gbuffer.normal, pixels.clone())?;
            let geometric = gpu.view(&gbuffer.geometric, pixels)?;
            // Mapped memory is there as it is; a copy has to be fetched.
            let before = if tile_flags.mappable() { None } else { Some(gpu.view(tile_flags, 0..count)?) };
            let mut flags = gpu.view_mut(tile_flags, 0..count)?;
            if let Some(before) = before {
                flags.copy_from_slice(&before);
            }
            let tiles = ProofTiles {
                frame,
                bounds: &bounds,
                position: &position,
                normal: &normal,
                geometric: &geometric,
                width: view.width,
                height: view.height,
            };
            pieces(cancel, count, FIRST_TILES, 64, |part| {
                self.scene.prove(&tiles, part.start, &mut flags[part], &GO_ON);
            })?;
            flags.commit(gpu)
        })
    }
}

/// The WGSL form.
#[allow(clippy::too_many_arguments, reason = "those of `Tracer::prove`")]
fn record(
    wgsl: &WgslTrace,
    recorder: &mut Recorder<'_>,
    stage: &str,
    frame: &LightFrame,
    bounds: &Buffer<TileBounds>,
    tile_flags: &Buffer<u32>,
    gbuffer: &GBuffer,
    view: &View,
) -> Result<()> {
    let kernel = recorder.gpu().kernel("passes/visibility/prove", "main", &[])?;
    let params = ProveParams { width: view.width, height: view.height, pad0: 0, pad1: 0 };
    wgsl.trees(recorder, stage, &kernel)?
        .uniform("params", &params)
        .uniform("frame", frame)
        .bind("tile_bounds", bounds)
        .bind("tile_flags", tile_flags)
        .bind("g_position", &gbuffer.position)
        .bind("g_geometric", &gbuffer.geometric)
        .dispatch_cut(view.tiled as usize, RAYS_A_TILE / f64::from(TILE_PIXELS) * wgsl.ns_per_ray)
}
