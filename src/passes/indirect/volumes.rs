//! Indirect light from a light propagation volume: every pixel, or every fragment, looks up what passed before it.

use super::{Evaluations, Indirect};
use crate::error::Result;
use crate::passes::gather::{fragment_receivers, receivers};
use crate::passes::refine::one_pass;
use crate::passes::{Context, GBuffer, lpv, upsample};

/// Names of the buffers of these fragments begin so.
const PREFIX: &str = "indirect_";
/// Receivers that are worked on at once.
const RECEIVERS: usize = 1 << 18;

/// Indirect irradiance of every pixel.
///
/// # Errors
/// Those of the device; `Settings`; `Cancelled`.
pub fn record(context: &mut Context<'_, '_>, gbuffer: &GBuffer) -> Result<Indirect> {
    let light = lpv::record(context)?;
    let listed = match context.settings.is("refine", "none") {
        true => None,
        false => Some(one_pass::record_all_lit(context, gbuffer, PREFIX)?),
    };
    let count = match &listed {
        Some(listed) => context.recorder.fetch(&[&listed.arguments])?[0][3] as usize,
        None => context.view.tiled as usize,
    };
    let pixels = context.view.pixels();
    let irradiance = context.resources.buffer("indirect_irradiance", pixels)?;
    let by_number = match &listed {
        Some(_) => context.resources.buffer("lpv_irradiance", count.max(1))?,
        None => irradiance.clone(),
    };
    let active = context.resources.buffer("indirect_receivers", 1)?;
    context.recorder.clear(&by_number)?;
    context.recorder.clear(&active)?;
    let len = RECEIVERS.min(count.max(1));
    let list = context.resources.buffer("indirect_receiver_list", len)?;
    for first in (0..count).step_by(len) {
        let part = len.min(count - first);
        match &listed {
            Some(listed) => fragment_receivers::record(context, gbuffer, listed, first, part, &list)?,
            None => receivers::record(context, gbuffer, first, part, &list, &active)?,
        }
        light.look_up(context, (&list, part), &by_number)?;
    }
    let levels = match listed {
        Some(listed) => {
            upsample::record_into(context, gbuffer, &listed.fragments, &by_number, &irradiance)?;
            Some([listed.fragments.level_map, listed.fragments.reason_map])
        }
        None => None,
    };
    let evaluations = Evaluations::default();
    Ok(Indirect { irradiance, levels, specular: None, evaluations, virtual_lights: None, volume: Some(light) })
}
