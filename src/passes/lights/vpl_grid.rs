//! Virtual lights on a regular grid over each reflective shadow map [NW09 Sec. 3.1].

use bytemuck::{Pod, Zeroable};

use super::virtual_light::{Rsm, VirtualLights};
use crate::error::Result;
use crate::passes::Context;

/// Texels along a block's edge from which on a workgroup adds it up: Mesa's software renderer ends a loop after 65,535
/// rounds, and a thread would be slow.
const WIDE: u32 = 64;
/// Threads of a workgroup.
const GROUP: usize = 64;

/// Twin of `VplGridParams` in `shaders/passes/lights/vpl_grid.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct VplGridParams {
    /// Texels along an edge of a map.
    pub resolution: u32,
    /// Lights along an edge of a map.
    pub across: u32,
    /// Map of the first light.
    pub first_map: u32,
    /// Its place in the list.
    pub first_light: u32,
}

/// Lights along an edge of a map for at least `vpls` of them: no block crosses the border of a tile, because as many lie
/// in each, and none is smaller than a texel.
pub(super) fn across(vpls: u32, resolution: u32, tiles: u32) -> u32 {
    let root = vpls.isqrt();
    let up = root + u32::from(root * root < vpls);
    up.min(resolution).next_multiple_of(tiles.max(1)).min(resolution)
}

/// Makes the list; lights without flux stay in it.
///
/// # Errors
/// Those of the device.
pub fn record(context: &mut Context<'_, '_>, rsm: &Rsm) -> Result<VirtualLights> {
    let vpls = context.settings.int("vpls");
    // Maps of area lights come before those of spots; all of a kind are alike.
    let areas = rsm.maps.iter().filter(|map| map.kind != 0).count();
    let mut parts = Vec::new();
    let mut count = 0;
    for maps in [0..areas, areas..rsm.maps.len()].into_iter().filter(|maps| !maps.is_empty()) {
        let across = across(vpls, rsm.resolution, rsm.maps[maps.start].tiles);
        let params = VplGridParams {
            resolution: rsm.resolution,
            across,
            first_map: maps.start as u32,
            first_light: count as u32,
        };
        let lights = maps.len() * across as usize * across as usize;
        parts.push((params, lights));
        count += lights;
    }
    let lights = context.resources.buffer("vpls", count)?;
    for (params, lights_of) in parts {
        let wide = params.resolution / params.across >= WIDE;
        let kernel = context.kernel("lights/vpl_grid", if wide { "wide" } else { "main" })?;
        let pass = context.recorder.pass("vpl_grid", &kernel).uniform("params", &params);
        let pass = pass.bind("rsm_texels", &rsm.texels).bind("vpls", &lights);
        pass.dispatch(if wide { GROUP * lights_of } else { lights_of })?;
    }
    Ok(VirtualLights { lights, count })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_fill_tiles_and_are_no_smaller_than_texels() {
        assert_eq!(across(256, 256, 1), 16);
        assert_eq!(across(257, 256, 1), 17);
        assert_eq!(across(1, 256, 1), 1);
        assert_eq!(across(1, 256, 4), 4);
        assert_eq!(across(25, 256, 4), 8);
        assert_eq!(across(1_048_576, 64, 4), 64);
        assert_eq!(across(63 * 63, 64, 8), 64);
    }
}
