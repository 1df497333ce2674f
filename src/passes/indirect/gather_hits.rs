//! Light at the hits of a wave, and the rays that go on.

use super::{GatherWave, Lists};
use crate::error::Result;
use crate::passes::Context;

/// Shades the hits: pending light and its shadow ray, and the next ray.
///
/// # Errors
/// Those of the device.
pub(in crate::passes) fn record(
    context: &mut Context<'_, '_>,
    wave: &GatherWave,
    lists: &Lists,
    slopes: bool,
) -> Result<()> {
    let pictures = !context.prepared.light_textures.is_empty();
    let lights = f64::from(u8::from(wave.lights != 1)) + 2.0 * f64::from(u8::from(pictures));
    let features = context.prepared.features();
    let later = f64::from(u8::from(wave.bounce > 0));
    let constants = [
        ("FEATURES", features.into()),
        ("LIGHTS", lights),
        ("LAST", wave.last.into()),
        ("LATER", later),
        ("SLOPES", slopes.into()),
    ];
    let kernel = context.kernel_with("indirect/gather_hits", "main", &constants)?;
    let scene = context.scene;
    context
        .recorder
        .pass("gather_hits", &kernel)
        .uniform("wave", wave)
        .bind("hits", &lists.hits)
        .bind("rays", &lists.rays)
        .bind("paths", &lists.paths)
        .bind("shadow_rays", &lists.shadow_rays)
        .bind("geometry", scene.geometry()?)
        .bind("instances", scene.instances()?)
        .bind("texels", scene.texels()?)
        .bind("lights", scene.lights()?)
        .dispatch(wave.size())
}
