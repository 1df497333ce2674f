//! The partition of the image that the fragments of all virtual lights have in common.

use super::vpl_lists::{Lists, VplListsParams};
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::{Context, GBuffer};

/// Takes a batch into the level and the reason of each pixel; the first begins anew.
///
/// # Errors
/// Those of the device.
pub fn record(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    lists: &Lists,
    params: &VplListsParams,
    [levels, reasons]: &[Buffer<u32>; 2],
) -> Result<()> {
    let kernel = context.kernel("refine/vpl_levels", "main")?;
    let pass = context.recorder.pass("vpl_levels", &kernel).uniform("params", params);
    let pass = pass.uniform("pyramid", &lists.pyramid).bind("g_normal", &gbuffer.normal);
    let pass = pass.bind("texel_state", &lists.state).bind("masks", &lists.masks);
    pass.bind("level_map", levels).bind("reason_map", reasons).dispatch(context.view.pixels())
}
