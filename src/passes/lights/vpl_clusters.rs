//! Virtual lights of clusters as large as depth and normals allow [NSW09 Sec. 3.4].

use std::ops::RangeInclusive;

use bytemuck::{Pod, Zeroable};

use super::virtual_light::{Rsm, RsmMap, Tree, VirtualLights, level_first};
use crate::error::Result;
use crate::gpu::{Buffer, Usage};
use crate::passes::Context;
use crate::passes::refine::compact;
use crate::settings::Settings;

/// A threshold that nothing exceeds; twin of `RSM_FAR` in `shaders/common/rsm.wgsl`.
const NO_THRESHOLD: f64 = 3.0e38;

/// Twin of `VplClustersParams` in `shaders/passes/lights/vpl_clusters.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct VplClustersParams {
    /// Node of the list.
    pub first: u32,
    /// How many maps there are.
    pub maps: u32,
    /// First map of a spot.
    pub first_spot: u32,
    /// 1: thresholds are for ranges, 0: for the distance to a plane and the difference from the mean normal.
    pub by_range: u32,
    /// Level of the largest clusters of an area light.
    pub coarsest_area: u32,
    /// And of the smallest.
    pub finest_area: u32,
    /// Level of the largest clusters of a spot.
    pub coarsest_spot: u32,
    /// And of the smallest.
    pub finest_spot: u32,
    /// [`NO_THRESHOLD`]: none.
    pub depth_threshold: f32,
    /// [`NO_THRESHOLD`]: none.
    pub normal_threshold: f32,
    /// Unused.
    pub pad0: u32,
    /// Unused.
    pub pad1: u32,
}

/// Levels of clusters in a tree whose texels are level `texels`: from `coarsest` lights a map to `most`. None is larger
/// than a tile.
pub fn levels(coarsest: u32, most: u32, texels: u32, tiles: u32) -> RangeInclusive<u32> {
    // The least k with 4^k at or above a number.
    let up = |lights: u32| (32 - (lights.max(1) - 1).leading_zeros()).div_ceil(2);
    let finest = up(most).min(texels);
    let first = up(coarsest).min(finest).max(tiles.max(1).ilog2());
    first..=finest.max(first)
}

/// Level of the finest clusters of any map.
pub fn finest(settings: &Settings, rsm: &Rsm) -> u32 {
    let [coarsest, most] = ["coarsest_vpls", "vpls"].map(|name| settings.int(name));
    let finest_of = |map: &RsmMap| *levels(coarsest, most, rsm.finest(), map.tiles).end();
    rsm.maps.iter().map(finest_of).max().unwrap_or(0)
}

fn params(context: &Context<'_, '_>, rsm: &Rsm) -> VplClustersParams {
    let settings = context.settings;
    let (coarsest, most) = (settings.int("coarsest_vpls"), settings.int("vpls"));
    let first_spot = rsm.maps.iter().filter(|map| map.kind != 0).count();
    let of_map = |map: usize| rsm.maps.get(map).map(|map| levels(coarsest, most, rsm.finest(), map.tiles));
    // Where there is only one kind, the other's levels are those.
    let (area, spot) = (of_map(0), of_map(first_spot));
    let none = 0..=0;
    let area = area.unwrap_or(none);
    let spot = spot.unwrap_or_else(|| area.clone());
    let threshold = |name: &str| settings.float(name).unwrap_or(NO_THRESHOLD) as f32;
    VplClustersParams {
        first: level_first(*area.start().min(spot.start()), rsm.maps.len()) as u32,
        maps: rsm.maps.len() as u32,
        first_spot: first_spot as u32,
        by_range: u32::from(settings.is("cluster_metric", "range")),
        coarsest_area: *area.start(),
        finest_area: *area.end(),
        coarsest_spot: *spot.start(),
        finest_spot: *spot.end(),
        depth_threshold: threshold("cluster_depth_threshold"),
        normal_threshold: threshold("cluster_normal_threshold"),
        pad0: 0,
        pad1: 0,
    }
}

/// Makes the list: all of its lights have flux.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(context: &mut Context<'_, '_>, rsm: &Rsm, tree: &Tree) -> Result<VirtualLights> {
    let params = params(context, rsm);
    let end = level_first(params.finest_area.max(params.finest_spot) + 1, rsm.maps.len());
    let items = end - params.first as usize;
    if items == 0 {
        return Ok(VirtualLights { lights: context.resources.buffer("vpls", 0)?, count: 0 });
    }
    let states: Buffer<u32> = context.resources.buffer("cluster_states", items)?;
    let chosen: Buffer<u32> = context.resources.buffer("cluster_chosen", items)?;
    let list: Buffer<u32> = context.resources.buffer("cluster_list", items)?;
    let arguments = context.resources.buffer_for("cluster_arguments", 4, Usage::Indirect)?;
    let kernel = |entry| context.kernel("lights/vpl_clusters", entry);
    let (judge, choose, pack) = (kernel("judge")?, kernel("choose")?, kernel("pack")?);
    let pass = context.recorder.pass("vpl_clusters", &judge).uniform("params", &params);
    let pass = pass.bind("nodes", &tree.nodes).bind("ranges", &tree.ranges);
    pass.bind("states", &states).dispatch(items)?;
    let pass = context.recorder.pass("vpl_clusters", &choose).uniform("params", &params);
    pass.bind("states", &states).bind("chosen", &chosen).dispatch(items)?;
    compact::record(context, "vpl_clusters", &chosen, items, 1, 1, &list, &arguments)?;
    let count = context.recorder.fetch(&[&arguments])?[0][3] as usize;
    let lights = context.resources.buffer("vpls", count)?;
    let pass = context.recorder.pass("vpl_clusters", &pack).uniform("params", &params);
    pass.bind("nodes", &tree.nodes).bind("chosen_list", &list).bind("vpls", &lights).dispatch(count)?;
    Ok(VirtualLights { lights, count })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_rounded_up_and_within_the_tree_and_the_tiles() {
        assert_eq!(levels(256, 256, 8, 1), 4..=4);
        assert_eq!(levels(16, 257, 8, 1), 2..=5);
        assert_eq!(levels(1, 1, 8, 1), 0..=0);
        assert_eq!(levels(1, 5, 8, 4), 2..=2);
        assert_eq!(levels(1, 1_048_576, 4, 2), 1..=4);
        assert_eq!(levels(4096, 16, 8, 1), 2..=2);
    }
}
