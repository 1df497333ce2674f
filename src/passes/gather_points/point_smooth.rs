//! Means of neighbouring points' light.

use super::{GatherPoint, PointParams, Points};
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;

/// The points of a level with smoother light.
///
/// # Errors
/// Those of the device.
pub(super) fn record(
    context: &mut Context<'_, '_>,
    points: &Points,
    params: &PointParams,
) -> Result<Buffer<GatherPoint>> {
    let smoothed = context.resources.buffer("points_smoothed", (params.first + params.count) as usize)?;
    let kernel = context.kernel("gather_points/point_smooth", "main")?;
    let pass = context.recorder.pass("point_smooth", &kernel).uniform("pyramid", &points.pyramid);
    let pass = pass.uniform("params", params).bind("blocks", &points.blocks).bind("point_at", &points.at);
    pass.bind("points", &points.points).bind("smoothed", &smoothed).dispatch(params.count as usize)?;
    Ok(smoothed)
}
