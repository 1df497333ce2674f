//! Light of the finest fragments to their pixels, where refinement ended early.

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::refine::nodes::Nodes;
use crate::passes::refine::one_pass::Fragments;
use crate::passes::{Context, GBuffer};

/// Overwrites the irradiance of pixels whose fragment is of the finest level.
///
/// # Errors
/// Those of the device.
pub fn record(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    fragments: &Fragments,
    nodes: &Nodes,
    irradiance: &Buffer<[f32; 4]>,
) -> Result<()> {
    let kernel = context.kernel("upsample/bilateral", "main")?;
    let pass = context.recorder.pass("bilateral", &kernel).uniform("pyramid", &nodes.pyramid);
    let pass = pass.bind("level_map", &fragments.level_map).bind("g_position", &gbuffer.position);
    let pass = pass.bind("g_normal", &gbuffer.normal).bind("g_geometric", &gbuffer.geometric);
    let pass = pass.bind("node_at", &nodes.at).bind("node_receivers", &nodes.receivers);
    let pass = pass.bind("node_irradiance", &nodes.irradiance).bind("direct_irradiance", irradiance);
    pass.dispatch(context.view.pixels())
}
