//! From the points to the pixels, and which blocks lack points.

use super::{GatherPoint, PointParams, Points};
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::indirect::{Evaluations, Indirect};
use crate::passes::{Context, GBuffer};

/// Marks all blocks of the coarsest level that see a surface.
///
/// # Errors
/// Those of the device.
pub(super) fn begin(context: &mut Context<'_, '_>, gbuffer: &GBuffer, points: &Points) -> Result<()> {
    let kernel = context.kernel("gather_points/point_pixels", "begin")?;
    let coarsest = points.pyramid.at(points.pyramid.coarsest);
    let pass = context.recorder.pass("point_pixels", &kernel).uniform("pyramid", &coarsest);
    let pass = pass.bind("g_normal", &gbuffer.normal).bind("marks", &points.marks);
    pass.bind("sums", &points.sums).bind("coverage", &points.coverage).dispatch(context.view.pixels())
}

/// Adds the points of a level to the pixels around them, and marks the blocks of the next where they do not hold.
///
/// # Errors
/// Those of the device.
pub(super) fn interpolate(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    points: &Points,
    held: &Buffer<GatherPoint>,
    params: &PointParams,
) -> Result<()> {
    let kernel = context.kernel("gather_points/point_pixels", "interpolate")?;
    let pass = context.recorder.pass("point_pixels", &kernel).uniform("pyramid", &points.pyramid);
    let pass = pass.uniform("params", params).uniform("view", &context.view);
    let pass = pass.bind("g_position", &gbuffer.position).bind("g_normal", &gbuffer.normal);
    let pass = pass.bind("point_at", &points.at).bind("points", held).bind("sums", &points.sums);
    pass.bind("coverage", &points.coverage).bind("marks", &points.marks).dispatch(context.view.pixels())
}

/// Irradiance of every pixel, and the level of the block that stands for it.
///
/// # Errors
/// Those of the device.
pub(super) fn finish(context: &mut Context<'_, '_>, gbuffer: &GBuffer, points: &Points) -> Result<Indirect> {
    let pixels = context.view.pixels();
    let irradiance = context.resources.buffer("indirect_irradiance", pixels)?;
    let level_map = context.resources.buffer("indirect_level_map", pixels)?;
    let reason_map = context.resources.buffer("indirect_reason_map", pixels)?;
    let kernel = context.kernel("gather_points/point_pixels", "finish")?;
    let pass = context.recorder.pass("point_pixels", &kernel).uniform("pyramid", &points.pyramid);
    let pass = pass.bind("g_normal", &gbuffer.normal).bind("point_at", &points.at).bind("sums", &points.sums);
    let pass = pass.bind("irradiance", &irradiance).bind("level_map", &level_map).bind("reason_map", &reason_map);
    pass.dispatch(pixels)?;
    let levels = Some([level_map, reason_map]);
    Ok(Indirect {
        irradiance,
        levels,
        specular: None,
        evaluations: Evaluations::default(),
        virtual_lights: None,
        volume: None,
    })
}
