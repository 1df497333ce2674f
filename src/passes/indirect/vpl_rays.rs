//! Rays towards virtual lights, chosen by what they contribute.

use super::light_cut::CutParams;
use super::{Lights, forms};
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;
use crate::passes::lights::virtual_light::Rsm;
use crate::passes::visibility::{Ray, Receiver};

/// What a receiver costs at first guess, nanoseconds.
const RECEIVER_NS: f64 = 20_000.0;

/// Writes the rays of `count` receivers and what each stands for.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(
    context: &mut Context<'_, '_>,
    (receivers, count): (&Buffer<Receiver>, usize),
    (rsm, lights): (&Rsm, &Lights),
    irradiance: &Buffer<[f32; 4]>,
    (rays, weights): (&Buffer<Ray>, &Buffer<[f32; 4]>),
) -> Result<()> {
    let is_tree = matches!(lights, Lights::Tree(_));
    let [form, mixed] = forms(context.settings);
    let overrides = [form, mixed, ("TREE", is_tree.into())];
    let kernel = context.kernel_with("indirect/vpl_rays", "main", &overrides)?;
    let nowhere: Buffer<[f32; 4]> = context.resources.buffer("no_ranges", 2)?;
    let (params, records, ranges) = match lights {
        Lights::Tree(tree) => (CutParams::of_tree(context.settings, rsm), &tree.nodes, &tree.ranges),
        Lights::List(list) => (CutParams::of_list(context.settings, rsm, list), &list.lights, &nowhere),
    };
    let pass = context.recorder.pass("vpl_rays", &kernel).uniform("params", &params);
    let pass = pass.bind("receivers", receivers).bind("virtual_lights", records).bind("ranges", ranges);
    let pass = pass.bind("irradiance", irradiance).bind("rsm_texels", &rsm.texels);
    pass.bind("rays", rays).bind("ray_weights", weights).dispatch_cut(count, RECEIVER_NS)
}
