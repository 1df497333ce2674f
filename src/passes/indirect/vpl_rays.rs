//! Rays towards virtual lights, chosen by what they contribute.

use super::light_cut::{self, CutParams};
use super::parts::Parts;
use super::{Lights, forms};
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;
use crate::passes::lights::virtual_light::Rsm;
use crate::passes::visibility::{Ray, Receiver};

/// What a receiver costs at first guess, nanoseconds: of one thread, and of many.
const RECEIVER_NS: [f64; 2] = [20_000.0, 400.0];

/// Writes the rays of `count` receivers and what each stands for. `parts`: what each part of the sum has.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(
    context: &mut Context<'_, '_>,
    (receivers, count): (&Buffer<Receiver>, usize),
    (rsm, lights): (&Rsm, &Lights),
    irradiance: &Buffer<[f32; 4]>,
    parts: &Parts,
    (rays, weights): (&Buffer<Ray>, &Buffer<[f32; 4]>),
) -> Result<()> {
    let is_tree = matches!(lights, Lights::Tree(_));
    let lanes = if is_tree { light_cut::lanes(context) } else { 1 };
    let entry = if lanes > 1 { "wide" } else { "main" };
    let [form, mixed] = forms(context.settings);
    let overrides = [form, mixed, ("TREE", is_tree.into()), ("LANES", lanes as f64)];
    let kernel = context.kernel_with("indirect/vpl_rays", entry, &overrides)?;
    let nowhere: Buffer<[f32; 4]> = context.resources.buffer("no_ranges", 2)?;
    let (params, records, ranges) = match lights {
        Lights::Tree(tree) => (CutParams::of_tree(context.settings, rsm), &tree.nodes, &tree.ranges),
        Lights::List(list) => (CutParams::of_list(context.settings, rsm, list), &list.lights, &nowhere),
    };
    let wide = lanes > 1;
    let all = if wide { vec![params] } else { params.each().collect() };
    for params in all {
        let pass = context.recorder.pass("vpl_rays", &kernel).uniform("params", &params);
        let pass = pass.bind("receivers", receivers).bind("virtual_lights", records).bind("ranges", ranges);
        let pass = pass.bind("irradiance", irradiance).bind("rsm_texels", &rsm.texels).bind("parts", &parts.values);
        let pass = pass.bind("rays", rays).bind("ray_weights", weights);
        pass.dispatch_cut(count * lanes, RECEIVER_NS[usize::from(wide)] / lanes as f64)?;
    }
    Ok(())
}
