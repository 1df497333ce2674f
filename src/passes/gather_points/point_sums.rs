//! What the rays of a wave found, added to the points that sent them.

use super::{PointParams, Points};
use crate::error::Result;
use crate::passes::indirect::{GatherWave, Lists};
use crate::passes::{Context, TILE_PIXELS};

/// Distances of the first hits.
///
/// # Errors
/// Those of the device.
pub(super) fn distances(
    context: &mut Context<'_, '_>,
    (points, params): (&Points, &PointParams),
    wave: &GatherWave,
    lists: &Lists,
) -> Result<()> {
    let kernel = context.kernel("gather_points/point_sums", "distances")?;
    let pass = context.recorder.pass("point_sums", &kernel).uniform("wave", wave).uniform("params", params);
    let pass = pass.bind("rays", &lists.rays).bind("hits", &lists.hits).bind("points", &points.points);
    pass.dispatch((wave.tiles * TILE_PIXELS) as usize)
}

/// Light that reached the hits.
///
/// # Errors
/// Those of the device.
pub(super) fn light(
    context: &mut Context<'_, '_>,
    (points, params): (&Points, &PointParams),
    wave: &GatherWave,
    lists: &Lists,
) -> Result<()> {
    let kernel = context.kernel("gather_points/point_sums", "light")?;
    let pass = context.recorder.pass("point_sums", &kernel).uniform("wave", wave).uniform("params", params);
    let pass = pass.bind("paths", &lists.paths).bind("occluded", &lists.occluded).bind("points", &points.points);
    pass.dispatch((wave.tiles * TILE_PIXELS) as usize)
}
