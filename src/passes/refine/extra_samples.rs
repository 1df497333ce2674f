//! Extra samples on the borders of large fragments.

use bytemuck::{Pod, Zeroable};

use crate::error::Result;
use crate::gpu::{Buffer, Usage};
use crate::passes::lights::light_samples;
use crate::passes::refine::compact;
use crate::passes::refine::one_pass::Fragments;
use crate::passes::visibility::Receiver;
use crate::passes::{Context, GBuffer};

/// Samples of a texel in each set.
pub const SAMPLES: usize = 3;
/// Sets of samples: on upper and left sides, on the image's last column, on its last row; see
/// `shaders/common/extra_places.wgsl`.
const SETS: usize = 3;
/// The smallest fragments that have some; twin of `LARGE` in `shaders/common/border_samples.wgsl`.
pub const LARGE: u32 = 3;

/// Twin of `ExtraSamplesParams` in `shaders/passes/refine/extra_samples.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct ExtraSamplesParams {
    /// Sets of sample points.
    pub patterns: u32,
    /// The user's seed.
    pub seed: u32,
    /// Unused.
    pub pad0: u32,
    /// Unused.
    pub pad1: u32,
}

/// Samples beyond the partition: in the middle of the upper side, in the corner and in the middle of the left side of each
/// fragment from level [`LARGE`] on, and where the image ends on its last column and row.
#[derive(Debug, Clone)]
pub struct Extras {
    /// Set by set, a texel from level [`LARGE`] on: 0, or 1 + its number in the list.
    pub at: Buffer<u32>,
    /// [`SAMPLES`] an entry of the list; the fourth number is 1 where there is a sample.
    pub irradiance: Buffer<[f32; 4]>,
    /// Their shading points.
    pub receivers: Buffer<Receiver>,
    /// [`SAMPLES`] times the length of the list.
    pub places: usize,
    /// How many there are, counted on the device.
    pub count: Buffer<u32>,
}

/// Finds the extra samples of all fragments; their light is yet to be found.
///
/// # Errors
/// Those of the device.
pub fn record(context: &mut Context<'_, '_>, gbuffer: &GBuffer, fragments: &Fragments) -> Result<Extras> {
    let pyramid = fragments.texels.pyramid;
    let texels = SETS * (pyramid.texels() - pyramid.first_texel(LARGE));
    let at: Buffer<u32> = context.resources.buffer("extra_at", texels.max(1))?;
    let count: Buffer<u32> = context.resources.buffer("extra_count", 1)?;
    context.recorder.clear(&at)?;
    context.recorder.clear(&count)?;
    let large = if texels == 0 { 0 } else { find(context, fragments, texels)? };
    let places = SAMPLES * large;
    let extras = Extras {
        at,
        irradiance: context.resources.buffer("extra_irradiance", places.max(1))?,
        receivers: context.resources.buffer("extra_receivers", places.max(1))?,
        places,
        count,
    };
    if large == 0 {
        return Ok(extras);
    }
    let patterns = light_samples::patterns(context);
    let params = ExtraSamplesParams { patterns, seed: context.settings.int("seed"), pad0: 0, pad1: 0 };
    let list: Buffer<u32> = context.resources.buffer("extra_list", texels)?;
    let kernel = context.kernel("refine/extra_samples", "points")?;
    let pass = context.recorder.pass("extra_samples", &kernel).uniform("params", &params).uniform("pyramid", &pyramid);
    let pass = pass.bind("extra_list", &list).bind("g_position", &gbuffer.position);
    let pass = pass.bind("g_normal", &gbuffer.normal).bind("g_geometric", &gbuffer.geometric);
    let pass = pass.bind("extra_receivers", &extras.receivers).bind("extra_irradiance", &extras.irradiance);
    pass.bind("extra_at", &extras.at).bind("extra_count", &extras.count).dispatch(places)?;
    Ok(extras)
}

/// Lists the large fragments; how many there are.
fn find(context: &mut Context<'_, '_>, fragments: &Fragments, texels: usize) -> Result<usize> {
    let flags: Buffer<u32> = context.resources.buffer("extra_flags", texels)?;
    let list: Buffer<u32> = context.resources.buffer("extra_list", texels)?;
    let arguments = context.resources.buffer_for("extra_arguments", 4, Usage::Indirect)?;
    let kernel = context.kernel("refine/extra_samples", "find")?;
    let pass = context.recorder.pass("extra_samples", &kernel).uniform("pyramid", &fragments.texels.pyramid);
    pass.bind("fragment_at", &fragments.at).bind("extra_flags", &flags).dispatch(texels)?;
    compact::record(context, "extra_samples", &flags, texels, 1, 1, &list, &arguments)?;
    Ok(context.recorder.fetch(&[&arguments])?[0][3] as usize)
}
