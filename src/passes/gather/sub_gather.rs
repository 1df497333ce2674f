//! Irradiance of nodes from what their sub-fragments see, and of pixels from what they see.

use super::interleaved;
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;
use crate::passes::lights::light_samples::LightSamples;
use crate::passes::refine::nodes::{Level, Nodes};
use crate::passes::visibility::Receiver;

/// Shading points that see what they are lit by, and what has been found so far.
#[derive(Debug, Clone, Copy)]
pub struct Lit<'l> {
    /// The points.
    pub receivers: &'l Buffer<Receiver>,
    /// Irradiance, W·m⁻², added to.
    pub irradiance: &'l Buffer<[f32; 4]>,
    /// Which of them; its level is 0 where each sees for itself.
    pub level: Level,
}

impl<'l> Lit<'l> {
    /// The nodes of a level.
    pub fn nodes(nodes: &'l Nodes, level: Level) -> Self {
        Self { receivers: &nodes.receivers, irradiance: &nodes.irradiance, level }
    }
}

/// Adds one light to the nodes of a level, or, without `nodes`, to points that see for themselves; `bits` as
/// [`crate::passes::visibility::sub_bits::SubBits`] left them, and their words a point, or none where everything is seen.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(
    context: &mut Context<'_, '_>,
    lit: Lit<'_>,
    nodes: Option<&Nodes>,
    light: &LightSamples,
    bits: Option<(&Buffer<u32>, usize)>,
) -> Result<()> {
    let nothing: Buffer<u32> = context.resources.buffer("no_bits", 2)?;
    let words = bits.map_or(0, |(_, words)| words as u32);
    let params = interleaved::params(context, lit.level, light, words);
    let entry = if nodes.is_none() { "pixels" } else { "subs" };
    let kernel = context.kernel_with("gather/sub_gather", entry, &interleaved::overrides(context, light))?;
    let pass = context.recorder.pass("sub_gather", &kernel).uniform("params", &params);
    let pass = pass.bind("node_receivers", lit.receivers).bind("bits", bits.map_or(&nothing, |(bits, _)| bits));
    let pass = pass.bind("light_points", &light.points).bind("light_radiance", &light.radiance);
    let pass = nodes.iter().fold(pass, |pass, nodes| pass.bind("node_rows", &nodes.rows));
    let work = 200.0 + 20.0 * f64::from(light.strata * light.classes);
    pass.bind("node_irradiance", lit.irradiance).dispatch_cut(lit.level.count, work)
}
