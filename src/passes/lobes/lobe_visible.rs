//! How much of each place in a fragment's lobe is seen.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};

use super::Work;
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;
use crate::passes::visibility::Hit;
use crate::passes::visibility::occlusion::Occlusion;

/// Twin of `LobeVisibleParams` in `shaders/passes/lobes/lobe_visible.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct LobeVisibleParams {
    /// Fragment of the first item.
    pub first: u32,
    /// Places in a lobe.
    pub places: u32,
    /// Along each axis.
    pub side: u32,
    /// Unused.
    pub pad: u32,
}

fn params(work: &Work<'_>) -> LobeVisibleParams {
    LobeVisibleParams { first: work.first as u32, places: work.places() as u32, side: work.source.side, pad: 0 }
}

/// Asks for the light's own samples, where many lie in the lobe.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub(super) fn samples(
    context: &mut Context<'_, '_>,
    work: &Work<'_>,
    occlusion: &Occlusion,
    range: Range<usize>,
) -> Result<()> {
    // Receivers and bits are bound by the same range: those of this piece are moved to the front.
    let own = context.resources.buffer("lobe_piece", work.count)?;
    context.recorder.copy_from(work.receivers, range, &own)?;
    let light = work.light.shadow_light();
    occlusion.ask(context, "lobe_shadow", &own, &light, work.asked, 0..work.count, true)
}

/// Each place by its ray alone.
///
/// # Errors
/// Those of the device.
pub(super) fn bits(context: &mut Context<'_, '_>, work: &Work<'_>, occluded: &Buffer<u32>) -> Result<()> {
    let kernel = context.kernel("lobes/lobe_visible", "bits")?;
    let pass = context.recorder.pass("lobe_visible", &kernel).bind("occluded", occluded);
    pass.bind("lobe_seen", work.seen).dispatch(work.count * work.places())
}

/// Keeps the distances that the rays of a piece went.
///
/// # Errors
/// Those of the device.
pub(super) fn distances(
    context: &mut Context<'_, '_>,
    work: &Work<'_>,
    hits: &Buffer<Hit>,
    distances: &Buffer<f32>,
) -> Result<()> {
    let kernel = context.kernel("lobes/lobe_visible", "distances")?;
    let pass = context.recorder.pass("lobe_visible", &kernel).uniform("params", &params(work));
    pass.bind("hits", hits).bind("lobe_distances", distances).dispatch(work.count * work.places())
}

/// Each place by the distances of the fragments around.
///
/// # Errors
/// Those of the device.
pub(super) fn variance(context: &mut Context<'_, '_>, work: &Work<'_>, distances: &Buffer<f32>) -> Result<()> {
    let fragments = &work.listed.fragments;
    let kernel = context.kernel("lobes/lobe_visible", "variance")?;
    let pass = context.recorder.pass("lobe_visible", &kernel).uniform("params", &params(work));
    let pass = pass.uniform("pyramid", &fragments.texels.pyramid).bind("receivers", work.receivers);
    let pass = pass.bind("fragment_list", &work.listed.list).bind("fragment_flags", &work.listed.flags);
    let pass = pass.bind("fragment_at", &fragments.at).bind("lobe_distances", distances);
    pass.bind("lobe_seen", work.seen).dispatch(work.count * work.places())
}
