//! The tree over the texels of all maps.

use bytemuck::{Pod, Zeroable};

use super::virtual_light::{Rsm, Tree, level_first};
use crate::error::Result;
use crate::passes::Context;

/// Twin of `RsmTreeParams` in `shaders/passes/lights/rsm_tree.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct RsmTreeParams {
    /// Maps.
    pub maps: u32,
    /// Level that is made.
    pub level: u32,
    /// Level of the texels.
    pub finest: u32,
    /// Unused.
    pub pad: u32,
}

/// Makes all levels from the texels up to one node a map.
///
/// # Errors
/// Those of the device.
pub fn record(context: &mut Context<'_, '_>, rsm: &Rsm) -> Result<Tree> {
    let (maps, finest) = (rsm.maps.len(), rsm.finest());
    let count = level_first(finest + 1, maps).max(1);
    let tree = Tree {
        nodes: context.resources.buffer("vpl_tree", count)?,
        ranges: context.resources.buffer("vpl_tree_ranges", 2 * count)?,
    };
    let params = RsmTreeParams { maps: maps as u32, level: finest, finest, pad: 0 };
    let kernel = context.kernel("lights/rsm_tree", "leaves")?;
    let pass = context.recorder.pass("rsm_tree", &kernel).uniform("params", &params);
    let pass = pass.bind("maps", &rsm.table);
    let pass = pass.bind("rsm_texels", &rsm.texels).bind("nodes", &tree.nodes).bind("ranges", &tree.ranges);
    pass.dispatch(maps << (2 * finest))?;
    let kernel = context.kernel("lights/rsm_tree", "reduce")?;
    for level in (0..finest).rev() {
        let params = RsmTreeParams { level, ..params };
        let pass = context.recorder.pass("rsm_tree", &kernel).uniform("params", &params);
        pass.bind("nodes", &tree.nodes).bind("ranges", &tree.ranges).dispatch(maps << (2 * level))?;
    }
    Ok(tree)
}
