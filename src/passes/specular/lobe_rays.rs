//! Rays to samples of what each pixel's lobe reaches of a light.

use super::Piece;
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::visibility::Ray;
use crate::passes::{Context, GBuffer};

/// Marks the places of pixels whose lobe meets the light.
///
/// # Errors
/// Those of the device.
pub fn flags(
    context: &mut Context<'_, '_>,
    lit: &Buffer<[f32; 4]>,
    tiles: Option<&Buffer<u32>>,
    flags: &Buffer<u32>,
    share: &Buffer<[f32; 4]>,
) -> Result<()> {
    let known = f64::from(u8::from(tiles.is_some()));
    let kernel = context.kernel_with("specular/lobe_rays", "flags", &[("TILES", known)])?;
    let pass = context.recorder.pass("lobe_rays", &kernel).uniform("view", &context.view);
    let pass = pass.bind("lobe_light", lit).bind("lobe_flags", flags).bind("tile_flags", tiles.unwrap_or(flags));
    pass.bind("lobe_share", share).dispatch(context.view.tiled as usize)
}

/// Leaves the marks of those whose first samples disagree.
///
/// # Errors
/// Those of the device.
pub fn again(context: &mut Context<'_, '_>, flags: &Buffer<u32>, share: &Buffer<[f32; 4]>) -> Result<()> {
    let kernel = context.kernel("specular/lobe_rays", "again")?;
    let pass = context.recorder.pass("lobe_rays", &kernel).uniform("view", &context.view);
    pass.bind("lobe_flags", flags).bind("lobe_share", share).dispatch(context.view.tiled as usize)
}

/// Writes the rays of a piece of the list, those of a pixel together, and what each adds.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    piece: &Piece<'_>,
    rays: &Buffer<Ray>,
    weights: &Buffer<[f32; 4]>,
) -> Result<()> {
    let picture = f64::from(u8::from(piece.source.picture()));
    let kernel = context.kernel_with("specular/lobe_rays", "main", &[("PICTURE", picture)])?;
    let nothing: Buffer<[f32; 4]> = context.resources.buffer("nothing", 1)?;
    let sums = context.scene.light_sums(piece.source.light as usize).unwrap_or(&nothing);
    let gpu = context.recorder.gpu().clone();
    let list = piece.list.range(&gpu, piece.first..piece.first + piece.count)?;
    let pass = context.recorder.pass("lobe_rays", &kernel).uniform("source", piece.source);
    let pass = pass.uniform("view", &context.view).bind("g_position", &gbuffer.position);
    let pass = pass.bind("g_normal", &gbuffer.normal).bind("g_geometric", &gbuffer.geometric);
    let pass = pass.bind("lobe_surface", piece.surface).bind("lobe_list", list).bind("light_sums", sums);
    let pass = pass.bind("rays", rays).bind("lobe_weights", weights);
    pass.dispatch_cut(piece.count * piece.source.side as usize, 100.0 * f64::from(piece.source.side))
}
