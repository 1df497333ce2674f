//! Visibility bits of sub-fragments and pixels: what they ask of a light, and the answers.

use super::Receiver;
use super::reuse::{self, ReuseParams};
use super::shadow::ShadowLight;
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;
use crate::passes::lights::light_samples::LightSamples;
use crate::passes::refine::nodes::{Level, Nodes};

/// What a list of shading points asks of a light.
pub struct SubBits<'s> {
    /// Whose samples.
    pub light: &'s LightSamples,
    /// Those samples that each point asks.
    pub shadow: ShadowLight<'s>,
    /// Who asks.
    pub level: Level,
    /// Twice [`ShadowLight::words`] a point: samples that face it, samples that it sees.
    pub bits: &'s Buffer<u32>,
    /// [`ShadowLight::words`] a point.
    pub asked: &'s Buffer<u32>,
}

impl SubBits<'_> {
    fn params(&self, context: &Context<'_, '_>) -> ReuseParams {
        let together = context.settings.is("sub_fragment_samples", "same");
        let params = reuse::params(context, self.light, &self.shadow, self.level);
        ReuseParams { together: together.into(), ..params }
    }

    /// So many points ask all that faces them.
    ///
    /// # Errors
    /// Those of the device.
    pub fn ask_all(&self, context: &mut Context<'_, '_>, receivers: &Buffer<Receiver>, points: usize) -> Result<()> {
        let params = self.params(context);
        let kernel = context.kernel("visibility/sub_bits", "ask_all")?;
        let pass = context.recorder.pass("sub_bits", &kernel).uniform("params", &params);
        let pass = pass.bind("points", &self.light.points).bind("receivers", receivers);
        pass.bind("bits", self.bits).bind("asked", self.asked).dispatch(points)
    }

    /// Sub-fragments of nodes that are left whole and in doubt ask the sets that none has asked: from now on `receivers`
    /// are those that ask, each its own set.
    ///
    /// # Errors
    /// Those of the device.
    pub fn ask_own(
        &self,
        context: &mut Context<'_, '_>,
        nodes: &Nodes,
        [receivers, own]: [&Buffer<Receiver>; 2],
    ) -> Result<()> {
        let params = self.params(context);
        let kernel = context.kernel("visibility/sub_bits", "ask_own")?;
        let pass = context.recorder.pass("sub_bits", &kernel).uniform("params", &params);
        let pass = pass.uniform("pyramid", &nodes.pyramid.at(self.level.level)).bind("node_rows", &nodes.rows);
        let pass = pass.bind("points", &self.light.points).bind("receivers", receivers).bind("own_receivers", own);
        pass.bind("bits", self.bits).bind("asked", self.asked).dispatch(self.level.count)
    }

    /// Pixels ask what the nodes of level 1 have not asked; `sub_bits` are those of `above`, if there is one.
    ///
    /// # Errors
    /// Those of the device.
    pub fn ask_pixels(
        &self,
        context: &mut Context<'_, '_>,
        nodes: &Nodes,
        above: Option<Level>,
        sub_bits: &Buffer<u32>,
    ) -> Result<()> {
        let mut params = self.params(context);
        params.reuse = above.is_some().into();
        params.above = above.map_or(0, |above| above.first as u32);
        let kernel = context.kernel("visibility/sub_bits", "ask_pixels")?;
        let pass = context.recorder.pass("sub_bits", &kernel).uniform("params", &params);
        let pass = pass.uniform("pyramid", &nodes.pyramid.at(0)).bind("node_rows", &nodes.rows);
        let pass = pass.bind("points", &self.light.points).bind("receivers", &nodes.receivers);
        let pass = pass.bind("bits", self.bits).bind("asked", self.asked).bind("sub_bits", sub_bits);
        pass.dispatch(self.level.count)
    }

    /// Takes the answers for `points` in, those from number `first` of the list of who asked on.
    ///
    /// # Errors
    /// Those of the device.
    pub fn take(&self, context: &mut Context<'_, '_>, first: usize, points: usize) -> Result<()> {
        let mut params = self.params(context);
        params.first = first as u32;
        let kernel = context.kernel("visibility/sub_bits", "take")?;
        let pass = context.recorder.pass("sub_bits", &kernel).uniform("params", &params);
        pass.bind("bits", self.bits).bind("asked", self.asked).dispatch(points)
    }
}
