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
pub mod sub_gather;
pub mod sub_levels;
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
    /// Level and reason of the fragments of the lobes, where they have some.
    pub specular_levels: Option<[Buffer<u32>; 2]>,
    /// For each light what is proven of each tile, where lobes want to know.
    pub proven: Vec<Option<Buffer<u32>>>,
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
        adaptive::record(context, gbuffer, specular)?
    } else if plan::is_sub_fragment(context.settings) {
        sub_levels::record(context, gbuffer)?
    } else if plan::is_incremental(context.settings) {
        levels::record(context, gbuffer)?
    } else if plan::has_fragments(context.settings) {
        fragments::record(context, gbuffer)?
    } else {
        let irradiance = context.resources.buffer("direct_irradiance", context.view.pixels())?;
        let together = specular && !context.settings.is("direct_estimator", "ratio");
        let target = if together { Some(specular::target(context)?) } else { None };
        let mut direct = pixels(context, gbuffer, Some(&irradiance), target.as_ref(), 0)?;
        direct.specular = target;
        if together {
            return Ok(direct);
        }
        direct
    };
    if specular {
        let (target, levels) = lobes(context, gbuffer, &direct.proven)?;
        direct.specular = Some(target);
        direct.specular_levels = levels;
    }
    Ok(direct)
}

/// What lobes reflect: spots sample by sample, area lights by their integral where `direct_estimator` is ratio, else on
/// fragments of their own.
fn lobes(context: &mut Context<'_, '_>, gbuffer: &GBuffer, proven: &[Option<Buffer<u32>>]) -> Result<Lobes> {
    let target = specular::target(context)?;
    let areas = context.prepared.area_lights;
    if areas < context.prepared.lights {
        pixels(context, gbuffer, None, Some(&target), areas)?;
    }
    if context.settings.is("direct_estimator", "ratio") {
        crate::passes::specular::record(context, gbuffer, proven, &target)?;
        return Ok((target, None));
    }
    let levels = crate::passes::lobes::record(context, gbuffer, &target)?;
    Ok((target, Some(levels)))
}

/// Radiance a pixel, and level and reason of its fragment where there are fragments.
type Lobes = (Buffer<[f32; 4]>, Option<[Buffer<u32>; 2]>);

/// Every pixel for itself, lights from number `first` on: the diffuse part, the lobe's, or both from the same visibility.
fn pixels(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    diffuse: Option<&Buffer<[f32; 4]>>,
    specular: Option<&Buffer<[f32; 4]>>,
    first_light: usize,
) -> Result<Direct> {
    let nowhere = context.resources.buffer("no_irradiance", 1)?;
    let irradiance = diffuse.unwrap_or(&nowhere).clone();
    let counter = if diffuse.is_some() { "active_receivers" } else { "lobe_receivers" };
    let active = context.resources.buffer(counter, 1)?;
    context.recorder.clear(&irradiance)?;
    context.recorder.clear(&active)?;
    let samples = light_samples::record(context)?.split_off(first_light);
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
            if diffuse.is_some() {
                sum(context, &work)?;
            }
            if let Some(specular) = specular {
                specular::record(context, gbuffer, &work, specular)?;
            }
        }
        first += count;
    }
    let samples = samples.iter().map(|s| u64::from(s.strata)).sum();
    Ok(Direct {
        irradiance,
        active,
        samples,
        levels: None,
        empty: Vec::new(),
        specular: None,
        specular_levels: None,
        proven: Vec::new(),
        looked: None,
    })
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
