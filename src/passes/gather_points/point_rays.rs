//! The places that gather, and their rays.

use super::{PointParams, Points};
use crate::error::Result;
use crate::passes::indirect::{GatherWave, Lists};
use crate::passes::{Context, GBuffer};

/// Writes the points of a level, without any light.
///
/// # Errors
/// Those of the device.
pub(super) fn begin(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    points: &Points,
    params: &PointParams,
) -> Result<()> {
    let kernel = context.kernel("gather_points/point_rays", "begin")?;
    let pass = context.recorder.pass("point_rays", &kernel).uniform("pyramid", &points.pyramid);
    let pass = pass.uniform("params", params).bind("g_position", &gbuffer.position);
    let pass = pass.bind("g_normal", &gbuffer.normal).bind("blocks", &points.blocks).bind("marks", &points.marks);
    pass.bind("points", &points.points).bind("point_at", &points.at).dispatch(params.count as usize)
}

/// Writes the rays and paths of a wave.
///
/// # Errors
/// Those of the device.
pub(super) fn record(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    (points, params): (&Points, &PointParams),
    wave: &GatherWave,
    lists: &Lists,
) -> Result<()> {
    let kernel = context.kernel("gather_points/point_rays", "main")?;
    let pass = context.recorder.pass("point_rays", &kernel).uniform("pyramid", &points.pyramid);
    let pass = pass.uniform("params", params).uniform("wave", wave).bind("g_position", &gbuffer.position);
    let pass = pass.bind("g_normal", &gbuffer.normal).bind("g_geometric", &gbuffer.geometric);
    let pass = pass.bind("blocks", &points.blocks).bind("marks", &points.marks);
    pass.bind("rays", &lists.rays).bind("paths", &lists.paths).dispatch(wave.size())
}
