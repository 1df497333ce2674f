//! The share of a light that each pixel's lobe sees, and what comes of it.

use super::{LobeLight, Piece};
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::{Context, GBuffer};

/// Writes the share of the pixels of a piece of the list.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn shares(
    context: &mut Context<'_, '_>,
    piece: &Piece<'_>,
    occluded: &Buffer<u32>,
    weights: &Buffer<[f32; 4]>,
    share: &Buffer<[f32; 4]>,
) -> Result<()> {
    let kernel = context.kernel("specular/lobe_ratio", "shares")?;
    let gpu = context.recorder.gpu().clone();
    let list = piece.list.range(&gpu, piece.first..piece.first + piece.count)?;
    let pass = context.recorder.pass("lobe_ratio", &kernel).uniform("source", piece.source);
    let pass = pass.uniform("view", &context.view).bind("lobe_list", list).bind("occluded", occluded);
    let pass = pass.bind("lobe_weights", weights).bind("lobe_share", share);
    pass.dispatch_cut(piece.count, 10.0 * f64::from(piece.source.side * piece.source.side))
}

/// Adds a light to the specular radiance; `share` none: nothing hides it.
///
/// # Errors
/// Those of the device.
pub fn record(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    source: &LobeLight,
    [surface, lit]: [&Buffer<[f32; 4]>; 2],
    share: Option<&Buffer<[f32; 4]>>,
    specular: &Buffer<[f32; 4]>,
) -> Result<()> {
    let shadowed = f64::from(u8::from(share.is_some()));
    let overrides = [("SHADOWED", shadowed), ("SIDE", f64::from(source.side))];
    let kernel = context.kernel_with("specular/lobe_ratio", "main", &overrides)?;
    let nothing: Buffer<[f32; 4]> = context.resources.buffer("no_share", 1)?;
    let pass = context.recorder.pass("lobe_ratio", &kernel).uniform("view", &context.view);
    let pass = pass.bind("g_position", &gbuffer.position).bind("g_normal", &gbuffer.normal);
    let pass = pass.bind("g_geometric", &gbuffer.geometric).bind("lobe_surface", surface);
    let pass = pass.bind("lobe_share", share.unwrap_or(&nothing)).bind("lobe_light", lit);
    pass.bind("specular_radiance", specular).dispatch(context.view.pixels())
}
