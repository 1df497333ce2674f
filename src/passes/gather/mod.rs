//! Direct light: shading points, which samples they see, and their sum.

pub mod adaptive;
pub mod fragment_receivers;
pub mod fragments;
#[allow(clippy::module_inception, reason = "the pass has the name of its stage")]
pub mod gather;
pub mod gather_ratio;
pub mod interleaved;
pub mod irradiance;
pub mod levels;
pub mod receivers;
pub mod share;
pub mod smooth_share;
pub mod specular;
pub mod textured_share;

use self::gather::Gathered;
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::lights::light_samples;
use crate::passes::visibility::Receiver;
use crate::passes::visibility::occlusion::Occlusion;
use crate::passes::{Context, GBuffer, TILE_PIXELS};
use crate::plan;

/// Rays that the native trace answers in about 0.1 s on two cores; a GPU takes more at once.
const RAYS_NATIVE: usize = 1 << 21;
const RAYS_GPU: usize = 1 << 25;
/// Receivers of a chunk on a GPU at most, so that their buffers stay small.
const MOST_RECEIVERS: usize = 1 << 19;

/// Irradiance from all lights, a pixel each, and how many light samples were evaluated.
pub struct Direct {
    /// Irradiance, W·m⁻².
    pub irradiance: Buffer<[f32; 4]>,
    /// Active receivers, counted on the device.
    pub active: Buffer<u32>,
    /// Samples of all lights together.
    pub samples: u64,
    /// Level and reason of each pixel's fragment, where there are larger ones than pixels.
    pub levels: Option<[Buffer<u32>; 2]>,
    /// Passes that had nothing to do, and why.
    pub empty: Vec<(&'static str, &'static str)>,
    /// Radiance that lobes reflect, a pixel each, where some surface has one.
    pub specular: Option<Buffer<[f32; 4]>>,
    /// What incremental refinement looked at.
    pub looked: Option<levels::Looked>,
}

/// Receivers that are worked on at once.
fn chunk_len(context: &Context<'_, '_>, strata: u32) -> usize {
    let rays = if context.tracer.native() { RAYS_NATIVE } else { RAYS_GPU };
    let receivers = (rays / strata as usize).clamp(4096, MOST_RECEIVERS);
    receivers.next_multiple_of(TILE_PIXELS as usize).min(context.view.tiled as usize)
}

/// Direct irradiance of every pixel, chunk by chunk: all lights of a chunk share its receivers.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(context: &mut Context<'_, '_>, gbuffer: &GBuffer, specular: bool) -> Result<Direct> {
    let mut direct = if plan::is_adaptive(context.settings) {
        adaptive::record(context, gbuffer)?
    } else if plan::is_incremental(context.settings) {
        levels::record(context, gbuffer)?
    } else if plan::has_fragments(context.settings) {
        fragments::record(context, gbuffer)?
    } else {
        return pixels(context, gbuffer, true, specular);
    };
    if specular {
        direct.specular = pixels(context, gbuffer, false, true)?.specular;
    }
    Ok(direct)
}

/// Every pixel for itself: the diffuse part, the lobe's, or both from the same visibility.
fn pixels(context: &mut Context<'_, '_>, gbuffer: &GBuffer, diffuse: bool, specular: bool) -> Result<Direct> {
    let name = if diffuse { "direct_irradiance" } else { "no_irradiance" };
    let irradiance = context.resources.buffer(name, if diffuse { context.view.pixels() } else { 1 })?;
    let specular = match specular {
        true => Some(specular::target(context)?),
        false => None,
    };
    let active = context.resources.buffer("active_receivers", 1)?;
    context.recorder.clear(&irradiance)?;
    context.recorder.clear(&active)?;
    let samples = light_samples::record(context)?;
    let most = samples.iter().map(|s| s.strata).max().unwrap_or(1);
    let occlusion = Occlusion::record(context, &samples)?;
    let words = if occlusion.asks() { most.div_ceil(32) as usize } else { 0 };
    let len = chunk_len(context, most);
    let receivers: Buffer<Receiver> = context.resources.buffer("receivers", len)?;
    let visibility: Buffer<u32> = context.resources.buffer("visibility", (len * words).max(1))?;
    let mut first = 0;
    while first < context.view.tiled as usize {
        let count = len.min(context.view.tiled as usize - first);
        receivers::record(context, gbuffer, first, count, &receivers, &active)?;
        for light in &samples {
            let (receivers, visibility, irradiance) = (&receivers, &visibility, &irradiance);
            let work = Gathered { light, receivers, visibility, count, traced: words > 0, irradiance };
            occluded(context, &occlusion, &work)?;
            if diffuse {
                sum(context, &work)?;
            }
            if let Some(specular) = &specular {
                specular::record(context, gbuffer, &work, specular)?;
            }
        }
        first += count;
    }
    let samples = samples.iter().map(|s| u64::from(s.strata)).sum();
    Ok(Direct { irradiance, active, samples, levels: None, empty: Vec::new(), specular, looked: None })
}

/// Which samples of a light the receivers see.
fn occluded(context: &mut Context<'_, '_>, occlusion: &Occlusion, work: &Gathered<'_>) -> Result<()> {
    let light = work.light;
    if work.traced {
        let (asked, range) = (light.shadow_light(), 0..work.count);
        occlusion.ask(context, occlusion.stage(), work.receivers, &asked, work.visibility, range, false)?;
    }
    Ok(())
}

/// What they make of them.
fn sum(context: &mut Context<'_, '_>, work: &Gathered<'_>) -> Result<()> {
    if work.light.is_area() && context.settings.is("direct_estimator", "ratio") {
        gather_ratio::record(context, work)
    } else {
        gather::record(context, work)
    }
}
