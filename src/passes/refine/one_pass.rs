//! One-pass refinement: the level of every pixel, why, and the list of fragments.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use crate::error::{Error, Result};
use crate::gpu::{Buffer, Kernel, Usage};
use crate::passes::refine::compact;
use crate::passes::refine::extra_samples::Extras;
use crate::passes::refine::iterative;
use crate::passes::refine::pyramid::{self, Pyramid, Texels, Wanted};
use crate::passes::{Context, GBuffer};
use crate::settings::Settings;

/// Bit of `fragment_flags`; twin of `FRAGMENT` in `shaders/common/fragment.wgsl`.
pub const FRAGMENT: u32 = 256;

/// Twin of `OnePassParams` in `shaders/passes/refine/one_pass.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct OnePassParams {
    /// In the unit of the metric.
    pub depth_threshold: f32,
    /// Difference of unit normals.
    pub normal_threshold: f32,
    /// Lights in the table.
    pub lights: u32,
    /// Unused.
    pub pad: u32,
}

/// What makes a texel rough.
#[derive(Debug, Clone, Copy)]
pub struct Metrics {
    /// 0 none, 1 range, 2 derivative, 3 plane.
    depth: u32,
    /// 0 none, 1 component, 2 cone, 3 curvature.
    normal: u32,
    /// Thresholds.
    pub params: OnePassParams,
}

impl Metrics {
    /// As the settings say; a metric without a threshold is left out. `lights`: in the table.
    pub fn new(settings: &Settings, lights: usize) -> Self {
        let metric = |name: &str, threshold: &str, choices: [&str; 3]| {
            let number = choices.iter().position(|choice| settings.is(name, choice)).map_or(0, |i| i as u32 + 1);
            settings.float(threshold).map_or((0, 0.0), |t| (number, t as f32))
        };
        let (depth, depth_threshold) = metric("depth_metric", "depth_threshold", ["range", "derivative", "plane"]);
        let (normal, normal_threshold) =
            metric("normal_metric", "normal_threshold", ["component", "cone", "curvature"]);
        let params = OnePassParams { depth_threshold, normal_threshold, lights: lights as u32, pad: 0 };
        Self { depth, normal, params }
    }

    /// What they look at.
    fn wanted(&self) -> Wanted {
        Wanted { steepness: self.depth == 2 || self.normal == 3, spreads: self.depth == 3 || self.normal == 2 }
    }

    /// A kernel that asks them.
    ///
    /// # Errors
    /// Those of the device.
    pub fn kernel(
        &self,
        context: &Context<'_, '_>,
        stem: &str,
        entry: &str,
        also: &[(&str, f64)],
    ) -> Result<Arc<Kernel>> {
        let metrics = [("DEPTH_METRIC", f64::from(self.depth)), ("NORMAL_METRIC", f64::from(self.normal))];
        context.kernel_with(stem, entry, &[&metrics, also].concat())
    }
}

/// The fragments of a frame.
#[derive(Debug, Clone)]
pub struct Fragments {
    /// The pyramid they were chosen from.
    pub texels: Texels,
    /// Level a pixel, 254 culled, 255 nothing.
    pub level_map: Buffer<u32>,
    /// Reason a pixel.
    pub reason_map: Buffer<u32>,
    /// A texel: 0 no fragment, 1 + its number in the list of their values, `u32::MAX` culled.
    pub at: Buffer<u32>,
    /// Samples beside those of the fragments.
    pub extras: Option<Extras>,
}

/// Fragments in a list of their own.
#[derive(Debug, Clone)]
pub struct Listed {
    /// The fragments.
    pub fragments: Fragments,
    /// A place of the tile order: [`FRAGMENT`] and level + 1 at a fragment's first pixel, else 0.
    pub flags: Buffer<u32>,
    /// Places of the first pixels of all fragments, in tile order.
    pub list: Buffer<u32>,
    /// Arguments of a dispatch over the list, and its length.
    pub arguments: Buffer<u32>,
}

/// Levels as the settings say.
///
/// # Errors
/// `Settings` when the coarsest level is finer than the finest.
pub fn levels(context: &Context<'_, '_>) -> Result<Pyramid> {
    let [coarsest, finest] = ["coarsest_level", "finest_level"].map(|name| context.settings.int(name));
    if coarsest < finest {
        return Err(Error::Settings(format!(
            "setting coarsest_level is {coarsest} and finest_level {finest}; allowed: coarsest_level >= finest_level"
        )));
    }
    Ok(Pyramid::new(&context.view, coarsest, finest))
}

/// What geometry and the lights' places say of every texel: its part of the pyramid, and bits of
/// `shaders/common/fragment.wgsl`.
///
/// # Errors
/// Those of the device; `Settings` as [`levels`].
pub fn states(context: &mut Context<'_, '_>, gbuffer: &GBuffer) -> Result<(Texels, Buffer<u32>)> {
    states_with(context, gbuffer, false)
}

fn states_with(context: &mut Context<'_, '_>, gbuffer: &GBuffer, all_lit: bool) -> Result<(Texels, Buffer<u32>)> {
    let pyramid = levels(context)?;
    let metrics = Metrics::new(context.settings, context.prepared.lights);
    let (texels, state) = marked(context, gbuffer, pyramid, &metrics, all_lit)?;
    if pyramid.coarsest > pyramid.finest && context.settings.is("refine", "iterative") {
        iterative::record(context, &texels, &metrics, &state)?;
    } else {
        classify(context, &texels, &metrics, &state, false)?;
    }
    Ok((texels, state))
}

/// The same where every pixel that sees a surface is lit; of levels of the caller's, all texels of which are tested.
///
/// # Errors
/// Those of the device.
pub fn all_lit_states(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    pyramid: Pyramid,
) -> Result<(Texels, Buffer<u32>)> {
    let metrics = Metrics::new(context.settings, 0);
    let (texels, state) = marked(context, gbuffer, pyramid, &metrics, true)?;
    classify(context, &texels, &metrics, &state, false)?;
    Ok((texels, state))
}

/// Which pixels are lit, and texels with any of them.
fn marked(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    pyramid: Pyramid,
    metrics: &Metrics,
    all_lit: bool,
) -> Result<(Texels, Buffer<u32>)> {
    let texels = pyramid::record(context, gbuffer, pyramid, metrics.wanted())?;
    let state: Buffer<u32> = context.resources.buffer("texel_state", pyramid.texels())?;
    context.recorder.clear(&state)?;
    match all_lit {
        true => light_all(context, gbuffer, &pyramid, &state)?,
        false => cull(context, gbuffer, &pyramid, &metrics.params, &state)?,
    }
    Ok((texels, state))
}

fn classify(
    context: &mut Context<'_, '_>,
    texels: &Texels,
    metrics: &Metrics,
    state: &Buffer<u32>,
    all_lit: bool,
) -> Result<()> {
    let pyramid = texels.pyramid;
    if pyramid.coarsest <= pyramid.finest && !(all_lit && pyramid.coarsest > 0) {
        return Ok(());
    }
    let kernel = metrics.kernel(context, "refine/one_pass", "classify", &[("ALL_LIT", all_lit.into())])?;
    let pass = context.recorder.pass("one_pass", &kernel).uniform("pyramid", &pyramid);
    let pass = pass.uniform("params", &metrics.params);
    let pass = pass.uniform("view", &context.view).bind("means", &texels.means).bind("ranges", &texels.ranges);
    pass.bind("spreads", &texels.spreads).bind("texel_state", state).dispatch(pyramid.texels_above())
}

/// Chooses the fragments of a frame and lists them.
///
/// # Errors
/// Those of the device; `Settings` as [`levels`].
pub fn record(context: &mut Context<'_, '_>, gbuffer: &GBuffer) -> Result<Listed> {
    let (texels, state) = states(context, gbuffer)?;
    choose(context, gbuffer, texels, &state, "", false)
}

/// The same where light comes from everywhere: every pixel that sees a surface is lit. Names of the buffers begin with
/// `prefix`.
///
/// # Errors
/// Those of the device; `Settings` as [`levels`].
pub fn record_all_lit(context: &mut Context<'_, '_>, gbuffer: &GBuffer, prefix: &str) -> Result<Listed> {
    if context.settings.is("refine", "iterative") {
        let (texels, state) = states_with(context, gbuffer, true)?;
        return choose(context, gbuffer, texels, &state, prefix, false);
    }
    let (pyramid, metrics) = (levels(context)?, Metrics::new(context.settings, 0));
    let texels = pyramid::record(context, gbuffer, pyramid, metrics.wanted())?;
    let state = context.resources.buffer("texel_state", pyramid.texels())?;
    classify(context, &texels, &metrics, &state, true)?;
    choose(context, gbuffer, texels, &state, prefix, true)
}

fn light_all(context: &mut Context<'_, '_>, gbuffer: &GBuffer, pyramid: &Pyramid, state: &Buffer<u32>) -> Result<()> {
    let kernel = context.kernel("refine/one_pass", "all_lit")?;
    let pass = context.recorder.pass("one_pass", &kernel).uniform("pyramid", pyramid);
    pass.bind("g_normal", &gbuffer.normal).bind("marks", state).dispatch(pyramid.levels[1][3] as usize)
}

fn cull(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    pyramid: &Pyramid,
    params: &OnePassParams,
    state: &Buffer<u32>,
) -> Result<()> {
    let kernel = context.kernel("refine/one_pass", "cull")?;
    let lights = context.scene.lights()?;
    let pass = context.recorder.pass("one_pass", &kernel).uniform("params", params).uniform("pyramid", pyramid);
    let pass = pass.bind("g_position", &gbuffer.position).bind("g_normal", &gbuffer.normal);
    let pass = pass.bind("g_geometric", &gbuffer.geometric).bind("lights", lights).bind("marks", state);
    pass.dispatch(pyramid.levels[1][3] as usize)
}

/// The fragments that follow from the states of the texels; names of their buffers begin with `prefix`. `all_lit`: nobody
/// has written the states of pixels, and all that see a surface are lit.
///
/// # Errors
/// Those of the device.
pub fn choose(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    texels: Texels,
    state: &Buffer<u32>,
    prefix: &str,
    all_lit: bool,
) -> Result<Listed> {
    let (pixels, places) = (context.view.pixels(), context.view.tiled as usize);
    let name = |plain: &str| format!("{prefix}{plain}");
    let (pool, pyramid) = (&mut *context.resources, texels.pyramid);
    let listed = Listed {
        flags: pool.buffer(&name("fragment_flags"), places)?,
        list: pool.buffer(&name("fragment_list"), places)?,
        arguments: pool.buffer_for(&name("fragment_arguments"), 4, Usage::Indirect)?,
        fragments: Fragments {
            level_map: pool.buffer(&name("level_map"), pixels)?,
            reason_map: pool.buffer(&name("reason_map"), pixels)?,
            at: pool.buffer(&name("fragment_at"), pyramid.texels())?,
            texels,
            extras: None,
        },
    };
    let fragments = &listed.fragments;
    context.recorder.clear(&fragments.at)?;
    let kernel = context.kernel_with("refine/one_pass", "choose", &[("ALL_LIT", all_lit.into())])?;
    let pass = context.recorder.pass("one_pass", &kernel).uniform("pyramid", &pyramid);
    let pass = pass.bind("g_normal", &gbuffer.normal).bind("texel_state", state);
    let pass = pass.bind("level_map", &fragments.level_map).bind("reason_map", &fragments.reason_map);
    let pass = pass.bind("fragment_flags", &listed.flags).bind("fragment_at", &fragments.at);
    pass.dispatch(places)?;
    let (flags, list, arguments) = (&listed.flags, &listed.list, &listed.arguments);
    compact::record(context, "fragment_list", flags, places, FRAGMENT, FRAGMENT, list, arguments)?;
    Ok(listed)
}
