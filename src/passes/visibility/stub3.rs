//! TEMP stubs.
use std::ops::Range;

use super::shadow::ShadowLight;
use super::trace::Tracer;
use super::trace_native::Receiver;
use crate::error::Result;
use crate::gpu::{Buffer, Recorder};
use crate::passes::refine::light_bounds::{LightFrame, TileBounds};
use crate::passes::{GBuffer, View};

impl Tracer {
    /// TEMP.
    #[allow(clippy::too_many_arguments, reason = "temp")]
    pub fn prove(
        &self,
        _recorder: &mut Recorder<'_>,
        _stage: &str,
        _frame: &LightFrame,
        _bounds: &Buffer<TileBounds>,
        _flags: &Buffer<u32>,
        _gbuffer: &GBuffer,
        _view: &View,
    ) -> Result<()> {
        Ok(())
    }

    /// TEMP.
    pub fn shadow_asked(
        &self,
        recorder: &mut Recorder<'_>,
        stage: &str,
        receivers: &Buffer<Receiver>,
        light: &ShadowLight<'_>,
        asked: &Buffer<u32>,
        range: Range<usize>,
    ) -> Result<u64> {
        let words = light.words();
        let gpu = recorder.gpu().clone();
        let before: Vec<u32> = {
            recorder.flush()?;
            gpu.read(asked)?[..range.len() * words].to_vec()
        };
        self.shadow(recorder, stage, receivers, light, asked, range.clone())?;
        let mut after: Vec<u32> = gpu.read(asked)?[..range.len() * words].to_vec();
        for (a, b) in after.iter_mut().zip(&before) {
            *a &= b;
        }
        asked.write(&gpu, 0, &after)?;
        Ok(before.iter().map(|w| u64::from(w.count_ones())).sum())
    }
}
