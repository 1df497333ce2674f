//! The levels of the image, and what the metrics of refinement need to know of every texel.

use bytemuck::{Pod, Zeroable};

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::{Context, GBuffer, View};

/// Levels that a pyramid may have: 0 to 16.
pub const MOST_LEVELS: usize = 17;

/// The levels of an image, numbered through; twin of `Pyramid` in `shaders/common/pyramid.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Pyramid {
    /// A level: columns, rows, flat number of the first texel, texels.
    pub levels: [[u32; 4]; MOST_LEVELS],
    /// Level of the largest fragments.
    pub coarsest: u32,
    /// Level of the smallest fragments.
    pub finest: u32,
    /// Level that a dispatch works on.
    pub level: u32,
    /// Scene units that a pixel covers at depth 1.
    pub pixel_width: f32,
}

impl Pyramid {
    /// The levels of `view`; all 17 are laid out, whatever the coarsest in use.
    pub fn new(view: &View, coarsest: u32, finest: u32) -> Self {
        let mut first = 0;
        let levels = std::array::from_fn(|level| {
            let [columns, rows] = [view.width, view.height].map(|side| side.div_ceil(1 << level));
            let row = [columns, rows, first, columns * rows];
            first += columns * rows;
            row
        });
        let pixel_width = (1.0 / view.fx).max(1.0 / view.fy);
        Self { levels, coarsest, finest, level: 0, pixel_width }
    }

    /// Texels of levels 0 to `coarsest`.
    pub fn texels(&self) -> usize {
        let [_, _, first, count] = self.levels[self.coarsest as usize];
        first as usize + count as usize
    }

    /// Number of the first texel of a level; one past the last of all where there is no such level.
    pub fn first_texel(&self, level: u32) -> usize {
        if level > self.coarsest { self.texels() } else { self.levels[level as usize][2] as usize }
    }

    /// Texels of levels 1 to `coarsest`.
    pub fn texels_above(&self) -> usize {
        self.texels() - self.levels[0][3] as usize
    }

    /// The same for a dispatch over `level`.
    pub fn at(&self, level: u32) -> Self {
        Self { level, ..*self }
    }
}

/// What is known of each texel from level 1 on; rows as in `shaders/passes/refine/pyramid.wgsl`.
#[derive(Debug, Clone)]
pub struct Texels {
    /// The levels.
    pub pyramid: Pyramid,
    /// Three rows: mean position and surface pixels, mean normal and curvature, mean geometric normal and slope.
    pub means: Buffer<[u32; 4]>,
    /// Two rows: least and largest shading normal and depth.
    pub ranges: Buffer<[f32; 4]>,
    /// Two words: the largest distance to the mean plane and the largest 1 − cosine to the mean normal.
    pub spreads: Buffer<u32>,
}

/// What of a texel is looked at beside means and ranges.
#[derive(Debug, Clone, Copy)]
pub struct Wanted {
    /// Slopes and curvatures; zero if not.
    pub steepness: bool,
    /// Spreads; not written if not.
    pub spreads: bool,
}

/// Fills levels 1 to `pyramid.coarsest` from the G-buffer, with what is wanted.
///
/// # Errors
/// Those of the device.
pub fn record(context: &mut Context<'_, '_>, gbuffer: &GBuffer, pyramid: Pyramid, wanted: Wanted) -> Result<Texels> {
    let texels = pyramid.texels_above();
    let means = context.resources.buffer("pyramid_means", 3 * texels)?;
    let ranges = context.resources.buffer("pyramid_ranges", 2 * texels)?;
    let spreads = context.resources.buffer("pyramid_spreads", 2 * texels)?;
    let made = Texels { pyramid, means, ranges, spreads };
    if pyramid.coarsest == 0 {
        return Ok(made);
    }
    let base = context.kernel_with("refine/pyramid", "base", &[("STEEPNESS", wanted.steepness.into())])?;
    let pass = context.recorder.pass("pyramid", &base).uniform("pyramid", &pyramid).uniform("view", &context.view);
    let pass = pass.bind("g_position", &gbuffer.position).bind("g_normal", &gbuffer.normal);
    let pass = pass.bind("g_geometric", &gbuffer.geometric).bind("means", &made.means).bind("ranges", &made.ranges);
    pass.dispatch(pyramid.levels[1][3] as usize)?;
    let reduce = context.kernel("refine/pyramid", "reduce")?;
    for level in 2..=pyramid.coarsest {
        let pass = context.recorder.pass("pyramid", &reduce).uniform("pyramid", &pyramid.at(level));
        let pass = pass.bind("means", &made.means).bind("ranges", &made.ranges);
        pass.dispatch(pyramid.levels[level as usize][3] as usize)?;
    }
    if wanted.spreads {
        context.recorder.clear(&made.spreads)?;
        let kernel = context.kernel("refine/pyramid", "deviations")?;
        let pass = context.recorder.pass("pyramid", &kernel).uniform("pyramid", &pyramid);
        let pass = pass.uniform("view", &context.view).bind("g_position", &gbuffer.position);
        let pass = pass.bind("g_normal", &gbuffer.normal).bind("means", &made.means).bind("spreads", &made.spreads);
        pass.dispatch(pyramid.levels[1][3] as usize)?;
    }
    Ok(made)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_halve_rounding_up_and_follow_each_other() {
        let view = View { width: 13, height: 1, fx: 10.0, fy: 5.0, ..View::zeroed() };
        let pyramid = Pyramid::new(&view, 3, 0);
        assert_eq!(pyramid.levels[..4], [[13, 1, 0, 13], [7, 1, 13, 7], [4, 1, 20, 4], [2, 1, 24, 2]]);
        assert_eq!((pyramid.texels(), pyramid.texels_above()), (26, 13));
        assert_eq!(pyramid.levels[16], [1, 1, 26 + 12, 1]);
        assert_eq!(pyramid.pixel_width, 0.2);
        assert_eq!(Pyramid::new(&view, 0, 0).texels_above(), 0);
    }
}
