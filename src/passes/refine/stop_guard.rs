//! Guard of the stops of sub-fragment tests: a node that sees all or nothing of a light is split unless that is proven.

use bytemuck::{Pod, Zeroable};

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::lights::light_samples::LightSamples;
use crate::passes::refine::light_bounds::{self, LightFrame};
use crate::passes::refine::nodes::{Level, Nodes};
use crate::passes::{Context, GBuffer};

/// Twin of `StopGuardParams` in `shaders/passes/refine/stop_guard.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct StopGuardParams {
    /// First node of the level.
    pub first: u32,
    /// 1: of a spot, whose cone has an edge.
    pub hard: u32,
    /// Unused.
    pub pad1: u32,
    /// Unused.
    pub pad2: u32,
}

/// What is proven of each tile, light by light, and whether its light has a hard edge; none where nothing is in doubt.
#[derive(Debug, Clone)]
pub struct Proofs(Vec<Option<(Buffer<u32>, bool)>>);

impl Proofs {
    /// Proves what can be proven for all lights.
    ///
    /// # Errors
    /// Those of the device; `Cancelled`.
    pub fn record(context: &mut Context<'_, '_>, gbuffer: &GBuffer, lights: &[LightSamples]) -> Result<Self> {
        let pixel_lights: Buffer<u32> = context.resources.buffer("guard_pixel_lights", context.view.pixels())?;
        let facing = context.resources.buffer("guard_facing", 1)?;
        let mut all = Vec::new();
        let unshadowed = context.settings.is("visibility", "none");
        for light in lights {
            if unshadowed && light.is_area() {
                all.push(None);
                continue;
            }
            let frame = LightFrame::of(context, light.light as usize);
            let tiles = light_bounds::record(context, gbuffer, &frame, light.light, &pixel_lights, &facing)?;
            let (bounds, flags) = (&tiles.bounds, &tiles.flags);
            if !unshadowed {
                context.tracer.prove(context.recorder, "prove", &frame, bounds, flags, gbuffer, &context.view)?;
            }
            let kept = context.resources.buffer(&format!("proven_tiles/{}", light.light), tiles.count)?;
            context.recorder.copy(flags, &kept, tiles.count)?;
            all.push(Some((kept, !light.is_area())));
        }
        Ok(Self(all))
    }

    /// Splits nodes of a level of which nothing is proven for light number `index` of the list, or, where they are small,
    /// marks them.
    ///
    /// # Errors
    /// Those of the device.
    pub fn guard(&self, context: &mut Context<'_, '_>, nodes: &Nodes, level: Level, index: usize) -> Result<()> {
        let Some((flags, hard)) = &self.0[index] else { return Ok(()) };
        let params = StopGuardParams { first: level.first as u32, hard: (*hard).into(), pad1: 0, pad2: 0 };
        let kernel = context.kernel("refine/stop_guard", "main")?;
        let pyramid = nodes.pyramid.at(level.level);
        let pass = context.recorder.pass("stop_guard", &kernel).uniform("params", &params).uniform("pyramid", &pyramid);
        let pass = pass.bind("node_rows", &nodes.rows).bind("tile_flags", flags);
        pass.dispatch(level.count)
    }
}
