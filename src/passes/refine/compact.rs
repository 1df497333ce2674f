//! Stable compaction: the list of items whose flags match, and the arguments of an indirect dispatch over it.

use bytemuck::{Pod, Zeroable};

use crate::error::{Error, Result};
use crate::gpu::{Buffer, Recorder, Resources};
use crate::passes::Context;

/// Items of a block, which one workgroup counts.
const BLOCK: usize = 2048;
/// Up to so many blocks `scatter` adds up those before its own, and needs no `scan`.
const FEW_BLOCKS: usize = 64;

/// Twin of `CompactParams` in `shaders/passes/refine/compact.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct CompactParams {
    /// Length of the list of flags.
    pub items: u32,
    /// Bits that are looked at.
    pub mask: u32,
    /// What they have to be.
    pub value: u32,
    /// 1: the blocks' totals were scanned.
    pub scanned: u32,
}

/// Writes to `list`, in order, every index i < `items` with `flags[i] & mask == value`; to `arguments`
/// (`Usage::Indirect`, four words) the workgroups of 64 threads along x, y and z, and the count.
///
/// # Errors
/// Those of the device; `Shader` when `list` could not hold all items.
#[allow(clippy::too_many_arguments, reason = "they are the sentence that describes a selection")]
pub fn record(
    context: &mut Context<'_, '_>,
    stage: &str,
    flags: &Buffer<u32>,
    items: usize,
    mask: u32,
    value: u32,
    list: &Buffer<u32>,
    arguments: &Buffer<u32>,
) -> Result<()> {
    let params = CompactParams { items: items as u32, mask, value, scanned: 0 };
    record_with(context.recorder, context.resources, stage, params, flags, list, arguments)
}

/// As [`record`], outside of a frame; `params.scanned` is set here.
///
/// # Errors
/// As [`record`].
pub fn record_with(
    recorder: &mut Recorder<'_>,
    resources: &mut Resources,
    stage: &str,
    mut params: CompactParams,
    flags: &Buffer<u32>,
    list: &Buffer<u32>,
    arguments: &Buffer<u32>,
) -> Result<()> {
    let items = params.items as usize;
    if flags.len() < items || list.len() < items || arguments.len() < 4 {
        return Err(Error::Shader(format!(
            "pass {stage:?} compacts {items} items; {flags:?}, {list:?} or {arguments:?} is too short"
        )));
    }
    let kernel = |entry| recorder.gpu().kernel("passes/refine/compact", entry, &[]);
    if items <= BLOCK {
        let whole = kernel("whole")?;
        let pass = recorder.pass(stage, &whole).uniform("params", &params).bind("flags", flags);
        return pass.bind("list", list).bind("arguments", arguments).dispatch_groups(1);
    }
    let (count, scan, scatter) = (kernel("count")?, kernel("scan")?, kernel("scatter")?);
    let (words, blocks) = (items.div_ceil(32), items.div_ceil(BLOCK));
    let chosen: Buffer<[u32; 2]> = resources.buffer("compact_chosen", words)?;
    let totals: Buffer<u32> = resources.buffer("compact_totals", blocks)?;
    params.scanned = u32::from(blocks > FEW_BLOCKS);
    let pass = recorder.pass(stage, &count).uniform("params", &params).bind("flags", flags);
    pass.bind("chosen", &chosen).bind("totals", &totals).dispatch(words)?;
    if params.scanned != 0 {
        recorder.pass(stage, &scan).uniform("params", &params).bind("totals", &totals).dispatch_groups(1)?;
    }
    let pass = recorder.pass(stage, &scatter).uniform("params", &params).bind("chosen", &chosen);
    pass.bind("totals", &totals).bind("list", list).bind("arguments", arguments).dispatch(words)
}
