//! A regular grid of virtual lights over each map.

use bytemuck::{Pod, Zeroable};

use super::virtual_light::{Rsm, RsmMap, VirtualLights};
use crate::error::Result;
use crate::passes::Context;

/// Twin of `VplGridParams` in `shaders/passes/lights/vpl_grid.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct VplGridParams {
    /// Which map.
    pub map: u32,
    /// Virtual lights along an edge of it.
    pub side: u32,
    /// Place of its first in the list.
    pub first: u32,
    /// Texels along an edge of it.
    pub resolution: u32,
}

/// Virtual lights along an edge of a map, so that there are `wanted` or more and none lies across the border of two tiles.
fn side(wanted: u32, map: &RsmMap) -> u32 {
    let root: u32 = (1_u32..).find(|side| u64::from(*side) * u64::from(*side) >= u64::from(wanted)).unwrap_or(1);
    root.next_multiple_of(map.tiles).min(map.resolution)
}

/// The packed list of all maps.
///
/// # Errors
/// Those of the device.
pub fn record(context: &mut Context<'_, '_>, rsm: &Rsm) -> Result<VirtualLights> {
    let wanted = context.settings.int("vpls");
    let sides: Vec<u32> = rsm.maps.iter().map(|map| side(wanted, map)).collect();
    let count = sides.iter().map(|&side| side as usize * side as usize).sum();
    let lights = context.resources.buffer("virtual_lights", std::cmp::max(count, 1))?;
    let kernel = context.kernel("lights/vpl_grid", "main")?;
    let mut first = 0;
    for (map, side) in sides.into_iter().enumerate() {
        let params = VplGridParams { map: map as u32, side, first, resolution: rsm.resolution };
        let pass = context.recorder.pass("vpl_grid", &kernel).uniform("params", &params);
        let pass = pass.bind("rsm_texels", &rsm.texels).bind("virtual_lights", &lights);
        pass.dispatch((side * side) as usize)?;
        first += side * side;
    }
    Ok(VirtualLights { lights, count })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_hold_what_is_wanted_and_never_cross_tiles() {
        let map = |tiles| RsmMap { tiles, resolution: 64, ..RsmMap::zeroed() };
        assert_eq!([1, 2, 256, 257, 1 << 20].map(|wanted| side(wanted, &map(1))), [1, 2, 16, 17, 64]);
        assert_eq!([1, 10, 256].map(|wanted| side(wanted, &map(4))), [4, 4, 16]);
    }
}
