//! Which samples of a light each receiver sees: one bit a stratum. In two forms, as `trace`.
use std::ops::Range;

use bytemuck::{Pod, Zeroable};

use super::trace::{FIRST_RAYS, GO_ON, Tracer, pieces};
use super::trace_native::{Receiver, SampleTable};
use super::trace_wgsl::WgslTrace;
use crate::error::Result;
use crate::gpu::{Buffer, Recorder};

/// Twin of `ShadowParams` in `shaders/common/shadow_query.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct ShadowParams {
    /// Unit normal of the light.
    pub light_normal: [f32; 3],
    /// 1: both sides emit.
    pub two_sided: u32,
    /// Unit axis of the cone, away from the light.
    pub cone_axis: [f32; 3],
    /// Cosine of the cone's half-angle; -1 and below: no cone.
    pub cos_cutoff: f32,
    /// Receivers of the list.
    pub receivers: u32,
    /// Samples of a pattern.
    pub strata: u32,
    /// Patterns of the table.
    pub patterns: u32,
    /// Words of bits a receiver.
    pub words: u32,
}

/// Samples of one light on the device; see [`super::trace_native::SampleTable`].
#[derive(Clone, Copy, Debug)]
pub struct ShadowLight<'a> {
    /// Patterns × strata: a scene-space point on the light, and the largest `t` (just under 1).
    pub points: &'a Buffer<[f32; 4]>,
    /// Samples of a pattern.
    pub strata: u32,
    /// Unit normal of the light.
    pub light_normal: [f32; 3],
    /// Both sides emit; also true for spots.
    pub two_sided: bool,
    /// Unit axis of the cone, away from the light.
    pub cone_axis: [f32; 3],
    /// Cosine of the cone's half-angle; -2: no cone.
    pub cos_cutoff: f32,
}

impl ShadowLight<'_> {
    /// Words of visibility bits that a receiver has.
    pub fn words(&self) -> usize {
        (self.strata as usize).div_ceil(32)
    }

    /// What shaders need to know of it and of a list of receivers.
    pub fn params(&self, receivers: usize) -> ShadowParams {
        ShadowParams {
            light_normal: self.light_normal,
            two_sided: u32::from(self.two_sided),
            cone_axis: self.cone_axis,
            cos_cutoff: self.cos_cutoff,
            receivers: receivers as u32,
            strata: self.strata,
            patterns: self.points.len() as u32 / self.strata.max(1),
            words: self.words() as u32,
        }
    }

    /// The same on the host.
    fn table<'p>(&self, points: &'p [[f32; 4]]) -> SampleTable<'p> {
        SampleTable {
            points,
            strata: self.strata,
            light_normal: self.light_normal,
            two_sided: self.two_sided,
            cone_axis: self.cone_axis,
            cos_cutoff: self.cos_cutoff,
        }
    }
}

impl Tracer {
    /// Which samples of a light the receivers of `range` see, [`ShadowLight::words`] words a receiver. As
    /// [`Tracer::closest`] otherwise; `range` starts at a multiple of 64.
    ///
    /// # Errors
    /// `Device`, `Cancelled`.
    pub fn shadow(
        &self,
        recorder: &mut Recorder<'_>,
        stage: &str,
        receivers: &Buffer<Receiver>,
        light: &ShadowLight<'_>,
        visibility: &Buffer<u32>,
        range: Range<usize>,
    ) -> Result<u64> {
        if let Some(wgsl) = &self.wgsl {
            return record(wgsl, "main", recorder, stage, receivers, light, visibility, range).map(|()| 0);
        }
        let first = (FIRST_RAYS / light.strata.max(1) as usize).max(64);
        self.on_host(recorder, stage, receivers, light, visibility, range, first, false)
    }

    /// As [`Tracer::shadow`] for some samples only. On entry bit `k` says that stratum `k` is asked; it stays when
    /// nothing hides the sample, and also when the sample does not face the receiver or the light does not emit towards
    /// it: then it is not traced. An inactive receiver gets no bit. Quickest when runs of 64 receivers, from a multiple of
    /// 64 on, lie close together, and those of 4 closest.
    ///
    /// # Errors
    /// `Device`, `Cancelled`.
    pub fn shadow_asked(
        &self,
        recorder: &mut Recorder<'_>,
        stage: &str,
        receivers: &Buffer<Receiver>,
        light: &ShadowLight<'_>,
        asked: &Buffer<u32>,
        range: Range<usize>,
    ) -> Result<u64> {
        if let Some(wgsl) = &self.wgsl {
            return record(wgsl, "asked", recorder, stage, receivers, light, asked, range).map(|()| 0);
        }
        self.on_host(recorder, stage, receivers, light, asked, range, FIRST_ASKED, true)
    }

    /// The native form of both; `first` receivers make the first piece.
    #[allow(clippy::too_many_arguments, reason = "the question, where its answer goes, and how it is cut")]
    fn on_host(
        &self,
        recorder: &mut Recorder<'_>,
        stage: &str,
        receivers: &Buffer<Receiver>,
        light: &ShadowLight<'_>,
        bits: &Buffer<u32>,
        range: Range<usize>,
        first: usize,
        some: bool,
    ) -> Result<u64> {
        let words = light.words();
        recorder.host(stage, |gpu, cancel| {
            let points = gpu.view(light.points, 0..light.points.len())?;
            let receivers = gpu.view(receivers, range.clone())?;
            let place = range.start * words..range.end * words;
            // What is asked stands in the answers. Mapped memory is there as it is; a copy has to be fetched.
            let fetch = some && !bits.mappable();
            let before = if fetch { Some(gpu.view(bits, place.clone())?) } else { None };
            let mut answers = gpu.view_mut(bits, place)?;
            if let Some(before) = before {
                answers.copy_from_slice(&before);
            }
            let table = light.table(&points);
            let mut traced = 0;
            pieces(cancel, range.len(), first, 64, |part| {
                let bits = &mut answers[part.start * words..part.end * words];
                traced += match some {
                    true => self.scene.shadow_asked(&receivers[part], &table, bits, &GO_ON),
                    false => self.scene.shadow(&receivers[part], &table, bits, &GO_ON),
                };
            })?;
            answers.commit(gpu)?;
            Ok(traced)
        })
    }
}

/// First piece of receivers that ask for some samples each.
const FIRST_ASKED: usize = FIRST_RAYS / 16;

/// The WGSL form: `main` for all samples, `asked` for some.
#[allow(clippy::too_many_arguments, reason = "those of `Tracer::shadow`")]
fn record(
    wgsl: &WgslTrace,
    entry: &str,
    recorder: &mut Recorder<'_>,
    stage: &str,
    receivers: &Buffer<Receiver>,
    light: &ShadowLight<'_>,
    visibility: &Buffer<u32>,
    range: Range<usize>,
) -> Result<()> {
    if range.is_empty() || light.strata == 0 {
        return Ok(());
    }
    let gpu = recorder.gpu().clone();
    let kernel = gpu.kernel("passes/visibility/shadow", entry, &[])?;
    let words = light.words();
    let params = light.params(range.len());
    let rays_an_item = f64::from(light.strata.min(32));
    wgsl.pass(recorder, stage, &kernel)?
        .uniform("params", &params)
        .bind("points", light.points)
        .bind("receivers", receivers.range(&gpu, range.clone())?)
        .bind("visibility", visibility.range(&gpu, range.start * words..range.end * words)?)
        .dispatch_cut(range.len() * words, wgsl.ns_per_ray * rays_an_item)
}
