//! Direct light of fragments: refine, gather at one point of each, upsample. Irradiance alone, so that albedo stays sharp.

use super::gather::Gathered;
use super::{Direct, chunk_len, fragment_receivers, occluded, sum};
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::lights::light_samples;
use crate::passes::refine::one_pass;
use crate::passes::visibility::Receiver;
use crate::passes::visibility::occlusion::Occlusion;
use crate::passes::{Context, GBuffer, upsample};

/// Direct irradiance of every pixel from that of its fragment and its neighbours.
///
/// # Errors
/// Those of the device; `Settings` for levels in the wrong order; `Cancelled`.
pub fn record(context: &mut Context<'_, '_>, gbuffer: &GBuffer) -> Result<Direct> {
    let samples = light_samples::record(context)?;
    let occlusion = Occlusion::record(context, &samples)?;
    let listed = one_pass::record(context, gbuffer)?;
    let count = context.recorder.fetch(&[&listed.arguments])?[0][3] as usize;
    let active = context.resources.buffer("active_receivers", 1)?;
    active.write(context.recorder.gpu(), 0, &[count as u32])?;
    let own: Buffer<[f32; 4]> = context.resources.buffer("fragment_irradiance", count)?;
    context.recorder.clear(&own)?;
    let most = samples.iter().map(|s| s.strata).max().unwrap_or(1);
    let words = if occlusion.asks() { most.div_ceil(32) as usize } else { 0 };
    let len = chunk_len(context, most).min(count);
    let receivers: Buffer<Receiver> = context.resources.buffer("receivers", len)?;
    let visibility: Buffer<u32> = context.resources.buffer("visibility", (len * words).max(1))?;
    let mut first = 0;
    while first < count {
        let chunk = len.min(count - first);
        fragment_receivers::record(context, gbuffer, &listed, first, chunk, &receivers)?;
        for light in &samples {
            let (receivers, visibility, irradiance) = (&receivers, &visibility, &own);
            let work = Gathered { light, receivers, visibility, count: chunk, traced: words > 0, irradiance };
            occluded(context, &occlusion, &work)?;
            sum(context, &work)?;
        }
        first += chunk;
    }
    let fragments = listed.fragments;
    let irradiance = upsample::record(context, gbuffer, &fragments, &own)?;
    let samples = samples.iter().map(|s| u64::from(s.strata)).sum();
    let levels = Some([fragments.level_map, fragments.reason_map]);
    let why = "every pixel is culled or sees nothing";
    let empty = if count == 0 { vec![("direct/fragment_receivers", why), (occlusion.pass(), why)] } else { vec![] };
    Ok(Direct {
        irradiance,
        active,
        samples,
        levels,
        empty,
        specular: None,
        specular_levels: None,
        proven: Vec::new(),
        looked: None,
    })
}
