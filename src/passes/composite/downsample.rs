//! The mean of the internal pixels.

use bytemuck::{Pod, Zeroable};

use super::composite::Images;
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;

/// Twin of `DownsampleParams` in `shaders/passes/composite/downsample.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct DownsampleParams {
    /// Columns of the output.
    pub width: u32,
    /// Rows of the output.
    pub height: u32,
    /// Internal pixels an axis.
    pub factor: u32,
    /// Unused.
    pub pad: u32,
}

/// Images at the size that the user asked for.
///
/// # Errors
/// Those of the device.
pub fn record(context: &mut Context<'_, '_>, fine: Images, factor: u32) -> Result<Images> {
    Ok(Images {
        image: one(context, "image", &fine.image, factor)?,
        direct: one(context, "direct", &fine.direct, factor)?,
        indirect: fine.indirect.map(|indirect| one(context, "indirect", &indirect, factor)).transpose()?,
    })
}

fn one(context: &mut Context<'_, '_>, name: &str, fine: &Buffer<[f32; 4]>, factor: u32) -> Result<Buffer<[f32; 4]>> {
    let kernel = context.kernel("composite/downsample", "main")?;
    let params =
        DownsampleParams { width: context.view.width / factor, height: context.view.height / factor, factor, pad: 0 };
    let pixels = (params.width * params.height) as usize;
    let coarse = context.resources.buffer(&format!("{name}/downsampled"), pixels)?;
    let pass = context.recorder.pass("downsample", &kernel).uniform("params", &params);
    pass.bind("fine", fine).bind("coarse", &coarse).dispatch(pixels)?;
    Ok(coarse)
}
