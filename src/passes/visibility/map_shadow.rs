//! Which samples of a light each receiver sees by their shadow maps.

use super::map_rays::ShadowMaps;
use super::occlusion::Asked;
use crate::error::{Error, Result};
use crate::passes::Context;

/// First guess of what a look into a map costs, nanoseconds.
const LOOK_NS: f64 = 20.0;

/// Answers a question from the maps of its light.
///
/// # Errors
/// `Shader` for samples that have no maps; those of the device; `Cancelled`.
pub fn record(context: &mut Context<'_, '_>, stage: &str, maps: &ShadowMaps, asked: &Asked<'_>) -> Result<()> {
    let (light, range) = (asked.light, asked.range.clone());
    if range.is_empty() || light.strata == 0 {
        return Ok(());
    }
    let Some(own) = maps.lights.iter().find(|own| own.points.raw() == light.points.raw()) else {
        return Err(Error::Shader(format!("pass {stage:?} asks about {:?}, of which there are no maps", light.points)));
    };
    let kernel = context.kernel("visibility/map_shadow", if asked.some { "asked" } else { "main" })?;
    let (gpu, words) = (context.recorder.gpu().clone(), light.words());
    let params = light.params(range.len());
    let pass = context.recorder.pass(stage, &kernel).uniform("params", &params).uniform("map", &own.params);
    pass.bind("distances", &maps.distances)
        .bind("points", light.points)
        .bind("receivers", asked.receivers.range(&gpu, range.clone())?)
        .bind("visibility", asked.bits.range(&gpu, range.start * words..range.end * words)?)
        .dispatch_cut(range.len() * words, LOOK_NS * f64::from(light.strata.min(32)))
}
