//! What lobes reflect of the lights, the way of [NPW10 Sec. 3.2.1]: fragments of their own, and samples in the lobe.

pub mod lobe_ask;
pub mod lobe_gather;
pub mod lobe_levels;
pub mod lobe_points;
pub mod lobe_visible;

use crate::error::{Error, Result};
use crate::gpu::Buffer;
use crate::passes::lights::light_samples::{self, LightSamples};
use crate::passes::refine::one_pass::Listed;
use crate::passes::specular::LobeLight;
use crate::passes::visibility::occlusion::Occlusion;
use crate::passes::visibility::{Hit, Ray, Receiver};
use crate::passes::{Context, GBuffer, upsample};
use crate::plan;
use crate::settings::Settings;

/// What is left of a lobe where its places end: few of them are better spent where it is high.
const LEAST: f32 = 0.03;
/// Fragments that are worked on at once.
const CHUNK: usize = 1 << 14;

/// Whether the settings go together.
///
/// # Errors
/// `Settings`.
pub fn check(settings: &Settings) -> Result<()> {
    let without = !plan::refines_direct(settings) || settings.is("direct_estimator", "ratio");
    if settings.is("specular_visibility", "variance") && without {
        return Err(Error::Settings(
            "setting specular_visibility is \"variance\" with refine=\"none\" or direct_estimator=\"ratio\"; allowed: \
             \"ray\", because variance is that of neighbouring fragments of lobes, and here lobes have none"
                .to_owned(),
        ));
    }
    Ok(())
}

/// One light at work.
pub(crate) struct Work<'w> {
    listed: &'w Listed,
    receivers: &'w Buffer<Receiver>,
    source: LobeLight,
    light: &'w LightSamples,
    first: usize,
    count: usize,
    asked: &'w Buffer<u32>,
    rays: &'w Buffer<Ray>,
    weights: &'w Buffer<[f32; 4]>,
    seen: &'w Buffer<f32>,
}

impl Work<'_> {
    /// Places in a lobe.
    fn places(&self) -> usize {
        (self.source.side * self.source.side) as usize
    }
}

/// Adds what lobes reflect of all area lights; returns level and reason of each pixel's fragment.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    specular: &Buffer<[f32; 4]>,
) -> Result<[Buffer<u32>; 2]> {
    let listed = lobe_levels::record(context, gbuffer)?;
    let count = context.recorder.fetch(&[&listed.arguments])?[0][3] as usize;
    let lit: Buffer<[f32; 4]> = context.resources.buffer("lobe_fragments", count)?;
    context.recorder.clear(&lit)?;
    if count > 0 {
        let samples = light_samples::record(context)?;
        let receivers = lobe_points::record(context, gbuffer, &listed, count)?;
        let occlusion = Occlusion::of_rays(context);
        for light in samples.iter().filter(|light| light.is_area()) {
            if !context.prepared.is_dark(light.light as usize) {
                shade(context, &listed, &receivers, light, count, &occlusion, &lit)?;
            }
        }
    }
    let image = context.resources.buffer("lobe_image", context.view.pixels())?;
    upsample::record_into(context, gbuffer, &listed.fragments, &lit, &image)?;
    lobe_gather::apply(context, gbuffer, &image, specular)?;
    Ok([listed.fragments.level_map, listed.fragments.reason_map])
}

/// Adds one light to the fragments.
fn shade(
    context: &mut Context<'_, '_>,
    listed: &Listed,
    receivers: &Buffer<Receiver>,
    light: &LightSamples,
    count: usize,
    occlusion: &Occlusion,
    lit: &Buffer<[f32; 4]>,
) -> Result<()> {
    let side = context.settings.int("lobe_samples").isqrt();
    let source = LobeLight { side, least: LEAST, ..LobeLight::of(context, light.light as usize) };
    let places = (side * side) as usize;
    let len = CHUNK.min(count.next_multiple_of(64));
    let words = light.shadow_light().words();
    let asked = context.resources.buffer("lobe_asked", len * words)?;
    let rays = context.resources.buffer("lobe_rays", len * places)?;
    let weights = context.resources.buffer("lobe_weights", len * places)?;
    let seen = context.resources.buffer("lobe_seen", len * places)?;
    let variance = occlusion.asks() && context.settings.is("specular_visibility", "variance");
    let distances = context.resources.buffer("lobe_distances", if variance { count * places } else { 1 })?;
    let at = |first: usize| Work {
        listed,
        receivers,
        source,
        light,
        first,
        count: (count - first).min(len),
        asked: &asked,
        rays: &rays,
        weights: &weights,
        seen: &seen,
    };
    for first in (0..count).step_by(len).filter(|_| variance) {
        measure(context, &at(first), &distances)?;
    }
    let occluded: Buffer<u32> = context.resources.buffer("lobe_occluded", (len * places).div_ceil(32))?;
    for first in (0..count).step_by(len) {
        let work = at(first);
        lobe_ask::record(context, &work)?;
        if occlusion.asks() {
            let range = first..first + work.count;
            lobe_visible::samples(context, &work, occlusion, range)?;
        }
        if variance {
            lobe_visible::variance(context, &work, &distances)?;
        } else {
            context.recorder.clear(&occluded)?;
            if occlusion.asks() {
                let range = 0..work.count * places;
                context.rays += context.tracer.any(context.recorder, "lobe_trace", &rays, &occluded, range)?;
            }
            lobe_visible::bits(context, &work, &occluded)?;
        }
        lobe_gather::record(context, &work, lit)?;
    }
    Ok(())
}

/// How far the rays to all places go.
fn measure(context: &mut Context<'_, '_>, work: &Work<'_>, distances: &Buffer<f32>) -> Result<()> {
    let rays = work.count * work.places();
    let hits: Buffer<Hit> = context.resources.buffer("lobe_hits", rays)?;
    lobe_ask::record(context, work)?;
    context.rays += context.tracer.closest(context.recorder, "lobe_trace", work.rays, &hits, 0..rays)?;
    lobe_visible::distances(context, work, &hits, distances)
}
