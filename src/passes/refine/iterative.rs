//! Refinement by a list: what is rough is split in four, until nothing is.

use super::compact;
use super::one_pass::Metrics;
use super::pyramid::Texels;
use crate::error::Result;
use crate::gpu::{Buffer, Usage};
use crate::passes::Context;

/// Bit of the flags of a list; twin of `LIT` in `shaders/common/fragment.wgsl`.
const LIT: u32 = 1;

/// Marks the rough texels among those that are reached from the coarsest level; the host waits for no list.
///
/// # Errors
/// Those of the device.
pub fn record(context: &mut Context<'_, '_>, texels: &Texels, metrics: &Metrics, state: &Buffer<u32>) -> Result<()> {
    let pyramid = texels.pyramid;
    let last = pyramid.finest + 1;
    let most = pyramid.levels[last.min(pyramid.coarsest) as usize][3] as usize;
    let listed: Buffer<u32> = context.resources.buffer("iterative_listed", most)?;
    let list: Buffer<u32> = context.resources.buffer("iterative_list", most)?;
    // Read by the shader and as arguments of its dispatch, which one buffer may not be at once.
    let arguments = context.resources.buffer_for("iterative_arguments", 4, Usage::Indirect)?;
    let count: Buffer<u32> = context.resources.buffer("iterative_count", 4)?;
    let begin = context.kernel("refine/iterative", "begin")?;
    let pass = context.recorder.pass("iterative", &begin).uniform("pyramid", &pyramid);
    let pass = pass.bind("texel_state", state).bind("listed", &listed);
    pass.dispatch(pyramid.levels[pyramid.coarsest as usize][3] as usize)?;
    let split = metrics.kernel(context, "refine/iterative", "split", &[])?;
    for level in (last..=pyramid.coarsest).rev() {
        let items = pyramid.levels[level as usize][3] as usize;
        compact::record(context, "iterative", &listed, items, LIT, LIT, &list, &arguments)?;
        context.recorder.copy(&arguments, &count, 4)?;
        context.recorder.clear(&listed)?;
        let pass = context.recorder.pass("iterative", &split).uniform("pyramid", &pyramid.at(level));
        let pass = pass.uniform("params", &metrics.params).uniform("view", &context.view).bind("texel_state", state);
        let pass = pass.bind("means", &texels.means).bind("ranges", &texels.ranges).bind("spreads", &texels.spreads);
        let pass = pass.bind("listed", &listed).bind("list", &list).bind("arguments", &count);
        pass.dispatch_indirect(&arguments, 0)?;
    }
    Ok(())
}
