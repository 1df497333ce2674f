//! Irradiance of nodes from what their sub-fragments see, and of pixels from what they see.

use super::interleaved;
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;
use crate::passes::lights::light_samples::LightSamples;
use crate::passes::refine::nodes::{Level, Nodes};

/// Adds one light to the nodes of a level; `bits` as [`crate::passes::visibility::sub_bits::SubBits`] left them, and their
/// words a point, or none where everything is seen.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(
    context: &mut Context<'_, '_>,
    nodes: &Nodes,
    level: Level,
    light: &LightSamples,
    bits: Option<(&Buffer<u32>, usize)>,
) -> Result<()> {
    let nothing: Buffer<u32> = context.resources.buffer("no_bits", 2)?;
    let words = bits.map_or(0, |(_, words)| words as u32);
    let params = interleaved::params(context, level, light, words);
    let entry = if level.level == 0 { "pixels" } else { "subs" };
    let kernel = context.kernel_with("gather/sub_gather", entry, &interleaved::overrides(context, light))?;
    let pass = context.recorder.pass("sub_gather", &kernel).uniform("params", &params);
    let pass = pass.bind("node_receivers", &nodes.receivers).bind("bits", bits.map_or(&nothing, |(bits, _)| bits));
    let pass = pass.bind("light_points", &light.points).bind("light_radiance", &light.radiance);
    let pass = if level.level == 0 { pass } else { pass.bind("node_rows", &nodes.rows) };
    let work = 200.0 + 20.0 * f64::from(light.strata * light.classes);
    pass.bind("node_irradiance", &nodes.irradiance).dispatch_cut(level.count, work)
}
