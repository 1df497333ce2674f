//! The tree over the texels of reflective shadow maps [NSW09 Sec. 3.5].

use bytemuck::{Pod, Zeroable};

use super::virtual_light::{Rsm, Tree, level_first};
use super::vpl_clusters;
use crate::error::Result;
use crate::passes::Context;

/// Twin of `RsmTreeParams` in `shaders/passes/lights/rsm_tree.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct RsmTreeParams {
    /// The level that is made.
    pub level: u32,
    /// That of texels.
    pub finest: u32,
    /// How many maps there are.
    pub maps: u32,
    /// From this level on nodes are virtual lights, above it clusters of them.
    pub single: u32,
}

/// Builds the tree, from texels up to whole maps.
///
/// # Errors
/// Those of the device.
pub fn record(context: &mut Context<'_, '_>, rsm: &Rsm) -> Result<Tree> {
    let (finest, maps) = (rsm.finest(), rsm.maps.len());
    let all = level_first(finest + 1, maps);
    let tree = Tree {
        nodes: context.resources.buffer("rsm_nodes", all)?,
        ranges: context.resources.buffer("rsm_ranges", 2 * all)?,
    };
    let single = vpl_clusters::finest(context.settings, rsm);
    let leaves = context.kernel("lights/rsm_tree", "leaves")?;
    let reduce = context.kernel("lights/rsm_tree", "reduce")?;
    for level in (0..=finest).rev() {
        let params = RsmTreeParams { level, finest, maps: maps as u32, single };
        let kernel = if level == finest { &leaves } else { &reduce };
        let mut pass = context.recorder.pass("rsm_tree", kernel).uniform("params", &params);
        if level == finest {
            pass = pass.bind("maps", &rsm.table).bind("rsm_texels", &rsm.texels);
        }
        pass.bind("nodes", &tree.nodes).bind("ranges", &tree.ranges).dispatch(maps << (2 * level))?;
    }
    Ok(tree)
}
