//! One list of fragments for each virtual light, refined by what surfaces reflect of it.

use bytemuck::{Pod, Zeroable};

use super::pyramid::Pyramid;
use super::vpl_points::{self, Points};
use super::{compact, one_pass, vpl_levels};
use crate::error::Result;
use crate::gpu::{Buffer, Usage};
use crate::passes::indirect::light_cut::reach;
use crate::passes::lights::virtual_light::VirtualLights;
use crate::passes::upsample::vpl_pixels;
use crate::passes::{Context, GBuffer};

/// Virtual lights of a word, and words of a batch at most: a batch is done in a fraction of a second.
const LIGHTS: usize = 32;
const MOST_WORDS: usize = 8;
/// Words of all texels at most: 64 MiB.
const MOST_MASKS: usize = 1 << 24;
/// Words before the masks; twin of `HEAD` in `shaders/common/vpl_masks.wgsl`.
const HEAD: usize = 4;

/// Twin of `VplListsParams` in `shaders/common/vpl_masks.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct VplListsParams {
    /// Virtual light of the batch.
    pub first: u32,
    /// Virtual lights of the batch.
    pub count: u32,
    /// Words a texel.
    pub words: u32,
    /// Level below which nothing is split.
    pub lowest: u32,
    /// How far each virtual light reaches.
    pub reach: f32,
    /// Unused.
    pub pad0: u32,
    /// Unused.
    pub pad1: u32,
    /// Unused.
    pub pad2: u32,
}

/// What the surfaces reflect of all virtual lights.
#[derive(Debug, Clone)]
pub struct Reflected {
    /// Irradiance a pixel.
    pub irradiance: Buffer<[f32; 4]>,
    /// Radiance a pixel that lobes send to the eye, where they were asked for.
    pub radiance: Option<Buffer<[f32; 4]>>,
    /// Virtual lights looked at from a point: bytes and the rest, as of `light_cut`.
    pub evaluations: Buffer<u32>,
    /// Level and reason of the finest fragment at each pixel; without virtual lights there is none.
    pub levels: Option<[Buffer<u32>; 2]>,
}

/// What a batch works on.
#[derive(Debug, Clone)]
pub struct Lists {
    /// The levels; the coarsest is 1 at least.
    pub pyramid: Pyramid,
    /// Of all texels.
    pub state: Buffer<u32>,
    /// What is lit, and by what.
    pub points: Points,
    /// A bit a virtual light of the batch, after a head.
    pub masks: Buffer<u32>,
    /// Irradiance, and radiance of lobes, of the texels from level 1 on.
    pub held: [Buffer<[f32; 4]>; 2],
    /// Whether there are lobes.
    pub glossy: bool,
    evaluations: Buffer<u32>,
    listed: Buffer<u32>,
    list: Buffer<u32>,
    arguments: Buffer<u32>,
}

/// Batches of the virtual lights, for masks of so many texels.
fn batches(lights: usize, texels: usize) -> Vec<(usize, usize)> {
    let words = (MOST_MASKS / texels.max(1)).clamp(1, MOST_WORDS);
    let len = words * LIGHTS;
    (0..lights).step_by(len).map(|first| (first, len.min(lights - first))).collect()
}

/// What every pixel reflects of all virtual lights, that of lobes where `glossy`. Quadrilaterals are taken for discs.
///
/// # Errors
/// Those of the device; `Settings` for levels in the wrong order; `Cancelled`.
pub fn record(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    lights: &VirtualLights,
    glossy: bool,
) -> Result<Reflected> {
    let chosen = one_pass::levels(context)?;
    // What a texel keeps lights its children, so that those of level 1 are pixels already.
    let pyramid = Pyramid { coarsest: chosen.coarsest.max(1), ..chosen };
    let lowest = pyramid.finest.max(1);
    let texels = pyramid.texels() - pyramid.first_texel(lowest);
    let batches = batches(lights.count, texels);
    let words = batches.first().map_or(1, |(_, count)| count.div_ceil(LIGHTS));
    let lists = Lists::new(context, gbuffer, pyramid, HEAD + words * texels, (lights, glossy))?;
    let pixels = context.view.pixels();
    let irradiance = context.resources.buffer("indirect_irradiance", pixels)?;
    let radiance = context.resources.buffer("indirect_specular", if glossy { pixels } else { 1 })?;
    for image in [&irradiance, &radiance, &lists.held[0], &lists.held[1]] {
        context.recorder.clear(image)?;
    }
    context.recorder.clear(&lists.evaluations)?;
    let images = [&irradiance, &radiance];
    let level_map = context.resources.buffer("indirect_level_map", pixels)?;
    let maps = [level_map, context.resources.buffer("indirect_reason_map", pixels)?];
    let reach = reach(context.settings);
    for (first, count) in batches {
        let words = count.div_ceil(LIGHTS) as u32;
        let params = VplListsParams {
            first: first as u32,
            count: count as u32,
            words,
            lowest,
            reach,
            pad0: 0,
            pad1: 0,
            pad2: 0,
        };
        lists.batch(context, &params)?;
        if lowest == 1 {
            lists.count(context, &params)?;
            vpl_pixels::pixels(context, gbuffer, &lists, &params, images)?;
        }
        vpl_levels::record(context, gbuffer, &lists, &params, &maps)?;
    }
    vpl_pixels::levels(context, &lists, lowest, images)?;
    let levels = (lights.count > 0).then_some(maps);
    Ok(Reflected { irradiance, radiance: glossy.then_some(radiance), evaluations: lists.evaluations, levels })
}

impl Lists {
    fn new(
        context: &mut Context<'_, '_>,
        gbuffer: &GBuffer,
        pyramid: Pyramid,
        masks: usize,
        (lights, glossy): (&VirtualLights, bool),
    ) -> Result<Self> {
        let (_, state) = one_pass::all_lit_states(context, gbuffer, pyramid)?;
        let points = vpl_points::record(context, gbuffer, (&pyramid, &state), lights, glossy)?;
        let most = pyramid.levels[pyramid.finest.max(1) as usize][3] as usize;
        let (pool, texels) = (&mut *context.resources, pyramid.texels_above());
        let held_radiance = pool.buffer("held_radiance", if glossy { texels } else { 1 })?;
        Ok(Self {
            pyramid,
            state,
            points,
            masks: pool.buffer("vpl_masks", masks)?,
            held: [pool.buffer("held_irradiance", texels)?, held_radiance],
            glossy,
            evaluations: pool.buffer("virtual_evaluations", 2)?,
            listed: pool.buffer("vpl_listed", most)?,
            list: pool.buffer("vpl_list", most)?,
            arguments: pool.buffer_for("vpl_list_arguments", 4, Usage::Indirect)?,
        })
    }

    /// From the coarsest level to the finest; the host waits for no list.
    fn batch(&self, context: &mut Context<'_, '_>, params: &VplListsParams) -> Result<()> {
        let pyramid = &self.pyramid;
        let kernel = context.kernel("refine/vpl_lists", "begin")?;
        context.recorder.clear(&self.masks)?;
        let pass = context.recorder.pass("vpl_lists", &kernel).uniform("params", params).uniform("pyramid", pyramid);
        let pass = pass.bind("texel_state", &self.state).bind("masks", &self.masks).bind("listed", &self.listed);
        pass.dispatch(pyramid.levels[pyramid.coarsest as usize][3] as usize)?;
        for level in (params.lowest.max(2)..=pyramid.coarsest).rev() {
            self.level(context, params, level)?;
        }
        Ok(())
    }

    /// Adds up what is left for pixels.
    fn count(&self, context: &mut Context<'_, '_>, params: &VplListsParams) -> Result<()> {
        let kernel = context.kernel("refine/vpl_lists", "count")?;
        let pass = context.recorder.pass("vpl_lists", &kernel).uniform("params", params);
        let pass = pass.uniform("pyramid", &self.pyramid).bind("texel_state", &self.state);
        let pass = pass.bind("masks", &self.masks).bind("evaluations", &self.evaluations);
        pass.dispatch(self.pyramid.levels[1][3] as usize)
    }

    fn level(&self, context: &mut Context<'_, '_>, params: &VplListsParams, level: u32) -> Result<()> {
        let pyramid = self.pyramid.at(level);
        let constants = vpl_points::constants(context, self.glossy);
        let test = context.kernel_with("refine/vpl_lists", "test", &constants)?;
        let split = context.kernel("refine/vpl_lists", "split")?;
        let items = pyramid.levels[level as usize][3] as usize;
        compact::record(context, "vpl_lists", &self.listed, items, 1, 1, &self.list, &self.arguments)?;
        // Read by the shaders and as arguments of their dispatches, which one buffer may not be at once.
        context.recorder.copy(&self.arguments, &self.masks, HEAD)?;
        let pass = context.recorder.pass("vpl_lists", &test).uniform("params", params).uniform("pyramid", &pyramid);
        let pass = pass.bind("points", &self.points.points).bind("short_lights", &self.points.lights);
        let pass = pass.bind("texel_state", &self.state).bind("masks", &self.masks).bind("list", &self.list);
        let pass = pass.bind("held_irradiance", &self.held[0]).bind("held_radiance", &self.held[1]);
        let pass = pass.bind("evaluations", &self.evaluations);
        pass.dispatch_indirect(&self.arguments, 0)?;
        if level == params.lowest {
            return Ok(());
        }
        context.recorder.clear(&self.listed)?;
        let pass = context.recorder.pass("vpl_lists", &split).uniform("params", params).uniform("pyramid", &pyramid);
        let pass = pass.bind("texel_state", &self.state).bind("masks", &self.masks).bind("list", &self.list);
        pass.bind("listed", &self.listed).dispatch_indirect(&self.arguments, 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn batches_hold_all_virtual_lights_in_words_that_fit() {
        assert_eq!(batches(300, 1000), [(0, 256), (256, 44)]);
        assert_eq!(batches(70, MOST_MASKS), [(0, 32), (32, 32), (64, 6)]);
        assert!(batches(0, 5).is_empty());
    }
}
