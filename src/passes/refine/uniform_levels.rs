//! The fragment of each pixel: the largest block that every light sees alike.

use bytemuck::{Pod, Zeroable};

use super::list_params::TILE_CELLS;
use super::one_pass;
use super::zone::Cells;
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::{Context, GBuffer};
use crate::plan;

/// Lights whose states fit into a word.
pub const LIGHTS: usize = 15;

/// Twin of `UniformLevelsParams` in `shaders/passes/refine/uniform_levels.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct UniformLevelsParams {
    /// Internal columns.
    pub width: u32,
    /// Internal rows.
    pub height: u32,
    /// Of the light in the words.
    pub slot: u32,
    /// Level of the largest fragments.
    pub coarsest: u32,
    /// 1: the light's zone is shaded pixel by pixel.
    pub own_pixels: u32,
    /// 1: the levels of other lights are there already.
    pub again: u32,
    /// 1: no other lights follow.
    pub last: u32,
    /// Unused.
    pub pad: u32,
}

/// What becomes the fragment maps.
#[derive(Debug, Clone)]
pub struct Levels {
    words: Buffer<u32>,
    /// Level of each pixel's fragment, 254 culled, 255 nothing.
    pub level_map: Buffer<u32>,
    /// Why it is no larger.
    pub reason_map: Buffer<u32>,
    lights: usize,
    /// Geometry has split fragments already.
    split: bool,
}

fn params(context: &Context<'_, '_>, levels: &Levels) -> UniformLevelsParams {
    UniformLevelsParams {
        width: context.view.width,
        height: context.view.height,
        slot: (levels.lights % LIGHTS) as u32,
        coarsest: context.settings.int("coarsest_level"),
        own_pixels: 0,
        again: (levels.split || levels.lights > LIGHTS).into(),
        last: 1,
        pad: 0,
    }
}

impl Levels {
    /// Nothing known of any light; where geometry refines as well, the fragments that it asks for.
    ///
    /// # Errors
    /// Those of the device; `Settings` for levels in the wrong order.
    pub fn new(context: &mut Context<'_, '_>, gbuffer: &GBuffer, tiles: usize) -> Result<Self> {
        let pixels = context.view.pixels();
        let split = plan::splits_by_geometry(context.settings);
        let [level_map, reason_map] = if split {
            let listed = one_pass::record(context, gbuffer)?.fragments;
            [listed.level_map, listed.reason_map]
        } else {
            [context.resources.buffer("level_map", pixels)?, context.resources.buffer("reason_map", pixels)?]
        };
        let words = context.resources.buffer("cell_word", tiles * TILE_CELLS)?;
        let levels = Self { words, level_map, reason_map, lights: 0, split };
        context.recorder.clear(&levels.words)?;
        Ok(levels)
    }

    /// Adds what one light says of the cells.
    ///
    /// # Errors
    /// Those of the device.
    pub fn add(
        &mut self,
        context: &mut Context<'_, '_>,
        gbuffer: &GBuffer,
        pixel_lights: &Buffer<u32>,
        cells: &Cells,
        own_pixels: bool,
    ) -> Result<()> {
        if self.lights > 0 && self.lights.is_multiple_of(LIGHTS) {
            self.maps(context, gbuffer, pixel_lights, 0)?;
            context.recorder.clear(&self.words)?;
        }
        let params = UniformLevelsParams { own_pixels: own_pixels.into(), ..params(context, self) };
        self.lights += 1;
        let kernel = context.kernel("refine/uniform_levels", "add")?;
        let pass = context.recorder.pass("uniform_levels", &kernel).uniform("params", &params);
        pass.bind("cell_state", &cells.state)
            .bind("cell_plan", &cells.plan)
            .bind("cell_word", &self.words)
            .dispatch(cells.count)
    }

    /// Writes the maps.
    ///
    /// # Errors
    /// Those of the device.
    pub fn finish(&self, context: &mut Context<'_, '_>, gbuffer: &GBuffer, pixel_lights: &Buffer<u32>) -> Result<()> {
        self.maps(context, gbuffer, pixel_lights, 1)
    }

    fn maps(
        &self,
        context: &mut Context<'_, '_>,
        gbuffer: &GBuffer,
        pixel_lights: &Buffer<u32>,
        last: u32,
    ) -> Result<()> {
        let params = UniformLevelsParams { last, ..params(context, self) };
        let tiles = self.words.len() / TILE_CELLS;
        let tile_word: Buffer<u32> = context.resources.buffer("tile_word", tiles)?;
        let tile_level: Buffer<u32> = context.resources.buffer("tile_level", tiles)?;
        let kernel = context.kernel("refine/uniform_levels", "tiles")?;
        let pass = context.recorder.pass("uniform_levels", &kernel);
        pass.bind("cell_word", &self.words).bind("tile_word", &tile_word).dispatch(tiles)?;
        let kernel = context.kernel("refine/uniform_levels", "tops")?;
        let pass = context.recorder.pass("uniform_levels", &kernel).uniform("params", &params);
        pass.bind("tile_word", &tile_word).bind("tile_level", &tile_level).dispatch(tiles)?;
        let kernel = context.kernel("refine/uniform_levels", "map")?;
        let pass = context.recorder.pass("uniform_levels", &kernel).uniform("params", &params);
        pass.bind("cell_word", &self.words)
            .bind("tile_level", &tile_level)
            .bind("g_normal", &gbuffer.normal)
            .bind("pixel_lights", pixel_lights)
            .bind("level_map", &self.level_map)
            .bind("reason_map", &self.reason_map)
            .dispatch(context.view.pixels())
    }
}
