//! Virtual lights as dense as the flux that is reflected [DS06].

use bytemuck::{Pod, Zeroable};

use super::virtual_light::{Rsm, Tree, VirtualLights};
use crate::error::Result;
use crate::passes::Context;

/// Twin of `VplImportanceParams` in `shaders/passes/lights/vpl_importance.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct VplImportanceParams {
    /// Lights a map.
    pub count: u32,
    /// How many maps there are.
    pub maps: u32,
    /// Level of texels.
    pub finest: u32,
    /// The user's seed.
    pub seed: u32,
}

/// Makes the list: `vpls` for each map, those of a dark one without flux.
///
/// # Errors
/// Those of the device.
pub fn record(context: &mut Context<'_, '_>, rsm: &Rsm, tree: &Tree) -> Result<VirtualLights> {
    let params = VplImportanceParams {
        count: context.settings.int("vpls"),
        maps: rsm.maps.len() as u32,
        finest: rsm.finest(),
        seed: context.settings.int("seed"),
    };
    let count = rsm.maps.len() * params.count as usize;
    let lights = context.resources.buffer("vpls", count)?;
    let kernel = context.kernel("lights/vpl_importance", "main")?;
    let pass = context.recorder.pass("vpl_importance", &kernel).uniform("params", &params);
    pass.bind("nodes", &tree.nodes).bind("vpls", &lights).dispatch(count)?;
    Ok(VirtualLights { lights, count })
}
