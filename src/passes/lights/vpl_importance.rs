//! Virtual lights drawn as densely as flux is reflected.

use bytemuck::{Pod, Zeroable};

use super::virtual_light::{Rsm, Tree, VirtualLights};
use crate::error::Result;
use crate::passes::Context;

/// Twin of `VplImportanceParams` in `shaders/passes/lights/vpl_importance.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct VplImportanceParams {
    /// Maps.
    pub maps: u32,
    /// Which of them.
    pub map: u32,
    /// Virtual lights of it.
    pub count: u32,
    /// Place of its first in the list.
    pub first: u32,
    /// Level of the texels.
    pub finest: u32,
    /// The user's seed.
    pub seed: u32,
    /// Unused.
    pub pad: [u32; 2],
}

/// The packed list of all maps, `vpls` of each.
///
/// # Errors
/// Those of the device.
pub fn record(context: &mut Context<'_, '_>, rsm: &Rsm, tree: &Tree) -> Result<VirtualLights> {
    let (maps, wanted) = (rsm.maps.len(), context.settings.int("vpls"));
    let count = maps * wanted as usize;
    let lights = context.resources.buffer("virtual_lights", count.max(1))?;
    let kernel = context.kernel("lights/vpl_importance", "main")?;
    for map in 0..maps as u32 {
        let params = VplImportanceParams {
            maps: maps as u32,
            map,
            count: wanted,
            first: map * wanted,
            finest: rsm.finest(),
            seed: context.settings.int("seed"),
            pad: [0; 2],
        };
        let pass = context.recorder.pass("vpl_importance", &kernel).uniform("params", &params);
        pass.bind("nodes", &tree.nodes).bind("virtual_lights", &lights).dispatch(wanted as usize)?;
    }
    Ok(VirtualLights { lights, count })
}
