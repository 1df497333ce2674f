//! Direct light level by level, from coarse to fine: visibility and irradiance of a level decide what the next one looks
//! at [NPW10 Sec. 3.4].

use super::{Direct, interleaved};
use crate::error::{Error, Result};
use crate::gpu::Buffer;
use crate::passes::lights::light_samples::{self, LightSamples};
use crate::passes::refine::extra_samples::Extras;
use crate::passes::refine::nodes::{Level, Nodes, NodesParams};
use crate::passes::refine::pyramid::Texels;
use crate::passes::refine::{incremental, one_pass};
use crate::passes::visibility::occlusion::Occlusion;
use crate::passes::visibility::reuse::{MOST_WORDS, Reuse};
use crate::passes::{Context, GBuffer, upsample};
use crate::plan;

/// Which samples of a light the nodes face and see.
#[derive(Debug, Clone)]
pub struct NodeBits {
    /// Twice `words` a node.
    pub buffer: Buffer<u32>,
    /// Words of samples that a node asks.
    pub words: usize,
}

/// What was looked at, kept until the next frame.
#[derive(Debug, Clone)]
pub struct Looked {
    /// The nodes.
    pub nodes: Nodes,
    /// Light by light; none where everything is seen, nor of sub-fragments.
    pub bits: Vec<NodeBits>,
    /// Samples beyond the fragments, where there are some.
    pub extras: Option<Extras>,
}

/// What stays the same from level to level.
pub struct Work<'g> {
    /// What is seen.
    pub gbuffer: &'g GBuffer,
    /// Samples of all lights, dealt to interleaved sets.
    pub lights: Vec<LightSamples>,
    /// What geometry says of every texel,
    pub texels: Texels,
    /// and whether it is rough, and lit by anything.
    pub state: Buffer<u32>,
    /// How nodes are made.
    pub params: NodesParams,
    /// How it is found what they see.
    pub occlusion: Occlusion,
    tests_inside: bool,
}

/// Direct irradiance of every pixel from that of its fragment and its neighbours.
///
/// # Errors
/// Those of the device; `Settings` for levels in the wrong order or samples that cannot be interleaved; `Cancelled`.
pub fn record(context: &mut Context<'_, '_>, gbuffer: &GBuffer) -> Result<Direct> {
    let work = Work::new(context, gbuffer)?;
    let pyramid = work.texels.pyramid;
    let mut nodes = Nodes::new(context, pyramid)?;
    let mut mean = None;
    for level in (pyramid.finest..=pyramid.coarsest).rev() {
        context.recorder.at_level(Some(level));
        let done = work.level(context, &mut nodes, level, &mut mean);
        context.recorder.at_level(None);
        done?;
    }
    work.finish(context, nodes)
}

/// # Errors
/// `Settings` when the samples cannot be split into the interleaved sets, or are too many.
fn check_samples(samples: u32, classes: u32) -> Result<()> {
    if !samples.is_multiple_of(classes) {
        return Err(Error::Settings(format!(
            "setting light_samples is {samples} with interleave 2; allowed: multiples of 4, because each of 2 x 2 \
             fragments asks a fourth of them"
        )));
    }
    let most = MOST_WORDS as u32 * 32 * classes;
    if samples > most {
        return Err(Error::Settings(format!(
            "setting light_samples is {samples}; with refine=\"incremental\" and this interleave allowed: up to {most}"
        )));
    }
    Ok(())
}

impl<'g> Work<'g> {
    /// Samples, geometry and occlusion of a frame.
    ///
    /// # Errors
    /// Those of the device; `Settings` for levels in the wrong order or samples that cannot be interleaved; `Cancelled`.
    pub fn new(context: &mut Context<'_, '_>, gbuffer: &'g GBuffer) -> Result<Self> {
        let tests_inside = plan::is_sub_fragment(context.settings);
        let classes = context.settings.int("interleave").pow(2);
        check_samples(context.settings.int("light_samples"), classes)?;
        let lights = light_samples::interleaved(context, classes)?;
        let (texels, state) = one_pass::states(context, gbuffer)?;
        let params = NodesParams {
            base: 0,
            parents: 0,
            patterns: light_samples::patterns(context),
            // Sub-fragments choose their sets, and pixels ask all.
            classes: if tests_inside { 1 } else { classes },
            seed: context.settings.int("seed"),
            inherit: tests_inside.into(),
            pad1: 0,
            pad2: 0,
        };
        let occlusion = Occlusion::record(context, &lights)?;
        Ok(Self { gbuffer, lights, texels, state, params, occlusion, tests_inside })
    }
}

impl Work<'_> {
    fn level(
        &self,
        context: &mut Context<'_, '_>,
        nodes: &mut Nodes,
        level: u32,
        mean: &mut Option<Buffer<[f32; 4]>>,
    ) -> Result<()> {
        let kept = nodes.end();
        let level = nodes.add(context, self.gbuffer, &self.state, self.params, level)?;
        if level.count == 0 {
            return Ok(());
        }
        context.recorder.clear_from(&nodes.irradiance, level.first)?;
        for light in &self.lights {
            let bits = if self.occlusion.asks() { Some(self.ask(context, nodes, level, light, kept)?) } else { None };
            interleaved::record(context, nodes, level, light, bits.as_ref())?;
            let last = level.level == nodes.pyramid.finest;
            if let (Some(bits), Some(least), false) = (&bits, least_bits(context, light), last) {
                incremental::bits(context, nodes, level, bits, [light.strata.div_ceil(32), least])?;
            }
        }
        if mean.is_none() {
            *mean = Some(incremental::mean(context, nodes, level)?);
        }
        let threshold = context.settings.float("illumination_threshold");
        if let (Some(threshold), Some(mean), true) = (threshold, mean, level.level > nodes.pyramid.finest) {
            incremental::differ(context, nodes, level, mean, threshold)?;
        }
        Ok(())
    }

    /// Which samples of a light the nodes of a level see.
    fn ask(
        &self,
        context: &mut Context<'_, '_>,
        nodes: &Nodes,
        level: Level,
        light: &LightSamples,
        kept: usize,
    ) -> Result<Buffer<u32>> {
        let words = light.shadow_light().words();
        let end = level.first + level.count;
        let bits = context.grown(&bits_name(light), 2 * words * kept, 2 * words * end)?;
        let asked = context.resources.buffer("asked", words * end)?;
        let reuse = Reuse { nodes, level, light, bits: &bits, asked: &asked };
        reuse.ask(context)?;
        let (shadow, receivers) = (light.shadow_light(), &nodes.receivers);
        let (stage, range) = (self.occlusion.stage(), level.first..end);
        self.occlusion.ask(context, stage, receivers, &shadow, &asked, range, true)?;
        reuse.answer(context)?;
        Ok(bits)
    }

    /// Fragments and pixels from all nodes.
    ///
    /// # Errors
    /// Those of the device.
    pub fn finish(self, context: &mut Context<'_, '_>, nodes: Nodes) -> Result<Direct> {
        let mut fragments = incremental::choose(context, self.gbuffer, &nodes, self.texels.clone(), &self.state)?;
        if plan::adds_extra_samples(context.settings) {
            fragments.extras = Some(super::sub_levels::extras(&self, context, &fragments)?);
        }
        let irradiance = upsample::record(context, self.gbuffer, &fragments, &nodes.irradiance)?;
        if nodes.pyramid.finest > 0 {
            upsample::bilateral::record(context, self.gbuffer, &fragments, &nodes, &irradiance)?;
        }
        let active = context.resources.buffer("active_receivers", 1)?;
        let count: usize = nodes.levels.iter().map(|level| level.count).sum();
        active.write(context.recorder.gpu(), 0, &[count as u32])?;
        let samples = self.lights.iter().map(|light| u64::from(light.strata * light.classes)).sum();
        let levels = Some([fragments.level_map, fragments.reason_map]);
        let why = "every pixel is culled or sees nothing";
        let [bits, light] = match self.tests_inside {
            true => [plan::SUB_FRAGMENTS[0], plan::SUB_FRAGMENTS[1]],
            false => plan::INCREMENTAL,
        };
        let passes = [bits, self.occlusion.pass(), light];
        let empty = if count == 0 { passes.map(|pass| (pass, why)).to_vec() } else { Vec::new() };
        let bits =
            if self.occlusion.asks() && !self.tests_inside { self.kept_bits(context, &nodes)? } else { Vec::new() };
        Ok(Direct {
            irradiance,
            active,
            samples,
            levels,
            empty,
            specular: None,
            specular_levels: None,
            proven: Vec::new(),
            looked: Some(Looked { nodes, bits, extras: fragments.extras }),
        })
    }
}

impl Work<'_> {
    fn kept_bits(&self, context: &mut Context<'_, '_>, nodes: &Nodes) -> Result<Vec<NodeBits>> {
        let of = |light: &LightSamples| {
            let words = light.shadow_light().words();
            let buffer = context.resources.buffer(&bits_name(light), 2 * words * nodes.end())?;
            Ok(NodeBits { buffer, words })
        };
        self.lights.iter().map(of).collect()
    }
}

fn bits_name(light: &LightSamples) -> String {
    format!("node_bits/{}", light.light)
}

/// Bits of a node from which on it is split: the setting counts those of all samples, of which a node asks a share.
pub fn least_bits(context: &Context<'_, '_>, light: &LightSamples) -> Option<u32> {
    let all = context.settings.float("bit_threshold")? as u32;
    Some(if light.is_area() { all.div_ceil(light.classes) } else { 1 })
}
