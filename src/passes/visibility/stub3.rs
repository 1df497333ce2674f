//! TEMP stubs.
use super::trace::Tracer;
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
}
