//! Direct light level by level where each fragment is tested inside: what its four sub-fragments see decides whether it is
//! split, and is what it is lit by [KJ16 Sec. 3.1].

use super::Direct;
use super::levels::{self, Work};
use super::sub_gather::{self, Lit};
use crate::error::{Error, Result};
use crate::gpu::Buffer;
use crate::passes::lights::light_samples::LightSamples;
use crate::passes::refine::extra_samples::{self, Extras};
use crate::passes::refine::nodes::{Level, Nodes};
use crate::passes::refine::one_pass::Fragments;
use crate::passes::refine::stop_guard::Proofs;
use crate::passes::refine::sub_fragments::{self, SUBS};
use crate::passes::visibility::Receiver;
use crate::passes::visibility::shadow::ShadowLight;
use crate::passes::visibility::sub_bits::SubBits;
use crate::passes::{Context, GBuffer};
use crate::plan;

/// Direct irradiance of every pixel from that of its fragment and its neighbours.
///
/// # Errors
/// Those of the device; `Settings` for levels in the wrong order or samples that cannot be shared out; `Cancelled`.
pub fn record(context: &mut Context<'_, '_>, gbuffer: &GBuffer) -> Result<Direct> {
    if context.settings.is("sub_fragment_samples", "own") && context.settings.int("interleave") == 1 {
        return Err(Error::Settings(
            "setting sub_fragment_samples is \"own\" with interleave 1; allowed: interleave 2, which gives each of the \
             four sub-fragments a fourth of the samples"
                .into(),
        ));
    }
    let work = Work::new(context, gbuffer)?;
    let guarded = plan::guards_stops(context.settings);
    let proofs = if guarded { Some(Proofs::record(context, gbuffer, &work.lights)?) } else { None };
    let mut nodes = Nodes::new(context, work.texels.pyramid)?;
    let pyramid = nodes.pyramid;
    for level in (pyramid.finest..=pyramid.coarsest).rev() {
        context.recorder.at_level(Some(level));
        let done = add_level(&work, context, &mut nodes, level, proofs.as_ref());
        context.recorder.at_level(None);
        done?;
    }
    work.finish(context, nodes)
}

fn add_level(
    work: &Work<'_>,
    context: &mut Context<'_, '_>,
    nodes: &mut Nodes,
    level: u32,
    proofs: Option<&Proofs>,
) -> Result<()> {
    let above = nodes.levels.last().copied();
    let level = nodes.add(context, work.gbuffer, &work.state, work.params, level)?;
    if level.count == 0 {
        return Ok(());
    }
    context.recorder.clear_from(&nodes.irradiance, level.first)?;
    if level.level == 0 {
        return work.lights.iter().try_for_each(|light| light_pixels(work, context, nodes, level, light, above));
    }
    let receivers = context.resources.buffer("sub_receivers", SUBS * level.count)?;
    if work.occlusion.asks() || work.lights.iter().any(|light| !light.is_area()) {
        sub_fragments::points(context, work.gbuffer, nodes, level, &work.state, &receivers)?;
    }
    for (index, light) in work.lights.iter().enumerate() {
        test_light(work, context, nodes, level, light, &receivers)?;
        if let Some(proofs) = proofs {
            proofs.guard(context, nodes, level, index)?;
        }
    }
    work.lights.iter().try_for_each(|light| light_nodes(work, context, nodes, level, light, &receivers))
}

/// What the sub-fragments of a level see of a light, and which nodes that splits.
fn test_light(
    work: &Work<'_>,
    context: &mut Context<'_, '_>,
    nodes: &Nodes,
    level: Level,
    light: &LightSamples,
    receivers: &Buffer<Receiver>,
) -> Result<()> {
    // Where nothing hides anything there is still the edge of a spot's cone.
    if !work.occlusion.asks() && light.is_area() {
        return Ok(());
    }
    let shadow = light.shadow_light();
    let (words, points) = (shadow.words(), SUBS * level.count);
    let bits = context.resources.buffer(&bits_name(light), 2 * words * points)?;
    let asked = context.resources.buffer("asked", words * points)?;
    let sub_bits = SubBits { light, shadow, level, bits: &bits, asked: &asked };
    sub_bits.ask_all(context, receivers, points)?;
    work.occlusion.ask(context, work.occlusion.stage(), receivers, &shadow, &asked, 0..points, true)?;
    sub_bits.take(context, 0, points)?;
    let least = levels::least_bits(context, light).unwrap_or(u32::MAX);
    sub_fragments::test(context, nodes, level, receivers, &bits, light, least)
}

/// Adds a light to the nodes of a level that are left whole.
fn light_nodes(
    work: &Work<'_>,
    context: &mut Context<'_, '_>,
    nodes: &Nodes,
    level: Level,
    light: &LightSamples,
    receivers: &Buffer<Receiver>,
) -> Result<()> {
    if !work.occlusion.asks() {
        return sub_gather::record(context, Lit::nodes(nodes, level), Some(nodes), light, None);
    }
    let shadow = light.shadow_light();
    let (words, points) = (shadow.words(), SUBS * level.count);
    let bits = context.resources.buffer(&bits_name(light), 2 * words * points)?;
    if light.classes > 1 && context.settings.is("sub_fragment_samples", "same") {
        let asked = context.resources.buffer("asked", words * points)?;
        let own = context.resources.buffer("own_receivers", points)?;
        let sub_bits = SubBits { light, shadow, level, bits: &bits, asked: &asked };
        sub_bits.ask_own(context, nodes, [receivers, &own])?;
        work.occlusion.ask(context, work.occlusion.stage(), &own, &shadow, &asked, 0..points, true)?;
        sub_bits.take(context, 0, points)?;
    }
    sub_gather::record(context, Lit::nodes(nodes, level), Some(nodes), light, Some((&bits, words)))
}

/// Pixels ask all samples, but those that were asked right there before.
fn light_pixels(
    work: &Work<'_>,
    context: &mut Context<'_, '_>,
    nodes: &Nodes,
    level: Level,
    light: &LightSamples,
    above: Option<Level>,
) -> Result<()> {
    let parts = SUBS * above.map_or(1, |above| above.count);
    let sub_bits = context.resources.buffer(&bits_name(light), 2 * light.shadow_light().words() * parts)?;
    light_points(work, context, Lit::nodes(nodes, level), light, |context, points| {
        points.ask_pixels(context, nodes, above, &sub_bits)
    })
}

/// Points that see for themselves ask what `ask` wants to know, and are lit by what they see.
fn light_points(
    work: &Work<'_>,
    context: &mut Context<'_, '_>,
    lit: Lit<'_>,
    light: &LightSamples,
    ask: impl Fn(&mut Context<'_, '_>, &SubBits<'_>) -> Result<()>,
) -> Result<()> {
    if !work.occlusion.asks() {
        return sub_gather::record(context, lit, None, light, None);
    }
    let (level, shadow) = (lit.level, ShadowLight { strata: light.strata * light.classes, ..light.shadow_light() });
    let (words, range) = (shadow.words(), level.first..level.first + level.count);
    let bits = context.resources.buffer("pixel_bits", 2 * words * level.count)?;
    let asked = context.resources.buffer("asked", words * range.end)?;
    let points = SubBits { light, shadow, level, bits: &bits, asked: &asked };
    ask(context, &points)?;
    work.occlusion.ask(context, work.occlusion.stage(), lit.receivers, &shadow, &asked, range, true)?;
    points.take(context, level.first, level.count)?;
    sub_gather::record(context, lit, None, light, Some((&bits, words)))
}

/// Extra samples of the large fragments, and their light.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn extras(work: &Work<'_>, context: &mut Context<'_, '_>, fragments: &Fragments) -> Result<Extras> {
    let extras = extra_samples::record(context, work.gbuffer, fragments)?;
    if extras.places > 0 {
        let level = Level { level: 0, first: 0, count: extras.places };
        let lit = Lit { receivers: &extras.receivers, irradiance: &extras.irradiance, level };
        for light in &work.lights {
            let ask = |context: &mut Context<'_, '_>, points: &SubBits<'_>| {
                points.ask_all(context, lit.receivers, extras.places)
            };
            light_points(work, context, lit, light, ask)?;
        }
    }
    Ok(extras)
}

/// Bits of the sub-fragments of one level.
fn bits_name(light: &LightSamples) -> String {
    format!("sub_bits/{}", light.light)
}
