//! Clusters of virtual lights: one cut through the tree for all fragments.

use bytemuck::{Pod, Zeroable};

use super::virtual_light::{Rsm, Tree, VirtualLights, cut_levels, level_first};
use crate::error::Result;
use crate::gpu::{Buffer, Usage};
use crate::passes::Context;
use crate::passes::refine::compact;

/// Twin of `VplClustersParams` in `shaders/passes/lights/vpl_clusters.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct VplClustersParams {
    /// Maps.
    pub maps: u32,
    /// Level of the largest clusters.
    pub coarsest: u32,
    /// Level of the smallest.
    pub finest: u32,
    /// 0 plane, 1 range.
    pub metric: u32,
    /// Negative: never refuses.
    pub depth_threshold: f32,
    /// Negative: never refuses.
    pub normal_threshold: f32,
    /// Number of the first node of the coarsest level.
    pub first: u32,
    /// Unused.
    pub pad: u32,
}

/// The packed list of the clusters of all maps, large ones first.
///
/// # Errors
/// Those of the device.
pub fn record(context: &mut Context<'_, '_>, rsm: &Rsm, tree: &Tree) -> Result<VirtualLights> {
    let settings = context.settings;
    let [coarsest, finest] = cut_levels(settings, rsm);
    let threshold = |name: &str| settings.float(name).map_or(-1.0, |t| t as f32);
    let first = level_first(coarsest, rsm.maps.len());
    let params = VplClustersParams {
        maps: rsm.maps.len() as u32,
        coarsest,
        finest,
        metric: u32::from(settings.is("cluster_metric", "range")),
        depth_threshold: threshold("cluster_depth_threshold"),
        normal_threshold: threshold("cluster_normal_threshold"),
        first: first as u32,
        pad: 0,
    };
    let items = level_first(finest + 1, rsm.maps.len()) - first;
    let flags: Buffer<u32> = context.resources.buffer("clusters_marked", items.max(1))?;
    let chosen: Buffer<u32> = context.resources.buffer("clusters_chosen", items.max(1))?;
    let arguments = context.resources.buffer_for("clusters_arguments", 4, Usage::Indirect)?;
    let kernel = context.kernel("lights/vpl_clusters", "mark")?;
    let pass = context.recorder.pass("vpl_clusters", &kernel).uniform("params", &params);
    let pass = pass.bind("nodes", &tree.nodes).bind("ranges", &tree.ranges);
    pass.bind("in_cut", &flags).dispatch(items)?;
    compact::record(context, "vpl_clusters", &flags, items, 1, 1, &chosen, &arguments)?;
    let count = context.recorder.fetch(&[&arguments])?[0][3] as usize;
    let lights = context.resources.buffer("virtual_lights", count.max(1))?;
    let kernel = context.kernel("lights/vpl_clusters", "pack")?;
    let pass = context.recorder.pass("vpl_clusters", &kernel).uniform("params", &params);
    pass.bind("nodes", &tree.nodes).bind("chosen", &chosen).bind("virtual_lights", &lights).dispatch(count)?;
    Ok(VirtualLights { lights, count })
}
