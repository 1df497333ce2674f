//! Indirect light from virtual lights: where lights shine, what is reflected there, and what of it each fragment gets.

use super::parts::{self, Parts};
use super::{Indirect, light_cut, vpl_gather, vpl_rays, vpl_splat, vpl_visible};
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Gpu};
use crate::passes::gather::{fragment_receivers, receivers};
use crate::passes::lights::virtual_light::{Rsm, Tree, VirtualLights};
use crate::passes::lights::{rsm_rays, rsm_tree, vpl_clusters, vpl_grid, vpl_importance};
use crate::passes::refine::one_pass::{self, Listed};
use crate::passes::refine::vpl_lists;
use crate::passes::visibility::{Ray, Receiver};
use crate::passes::{Context, GBuffer, TILE_PIXELS, upsample};
use crate::plan;
use crate::scene::snapshot::Snapshot;
use crate::settings::Settings;

/// Names of the buffers of these fragments begin so.
const PREFIX: &str = "indirect_";
/// Receivers that are worked on at once, and rays of theirs.
const RECEIVERS: usize = 1 << 18;
const RAYS_NATIVE: usize = 1 << 20;
const RAYS_GPU: usize = 1 << 23;

/// What lights the fragments.
pub enum Lights {
    /// All of these.
    List(VirtualLights),
    /// A cut for each.
    Tree(Tree),
}

/// # Errors
/// `Settings` for what does not work together, or does not fit the adapter.
pub fn check(snapshot: &Snapshot, settings: &Settings, gpu: &Gpu) -> Result<()> {
    let gathers = settings.is("indirect", "final-gather");
    if gathers && settings.is("indirect_visibility", "off") {
        let why = "indirect_visibility=\"off\" is not available with indirect=\"final-gather\"; allowed: on";
        return Err(Error::Settings(why.to_owned()));
    }
    if !plan::indirect_from_virtual_lights(settings) {
        return Ok(());
    }
    if settings.is("indirect", "splat") && !gpu.can_blend_floats() {
        let why = "indirect=\"splat\" adds up floats by blending, which this adapter cannot; indirect=\"gather\" has the \
                   same result";
        return Err(Error::Settings(why.to_owned()));
    }
    check_lists(settings)?;
    rsm_rays::check(settings, snapshot, gpu.limits().max_storage_buffer_binding_size)?;
    if settings.is("indirect", "splat") && settings.is("form_factor", "quad") {
        let why = "form_factor=\"quad\" is not available with indirect=\"splat\"; allowed: point, disc";
        return Err(Error::Settings(why.to_owned()));
    }
    Ok(())
}

/// What goes together with fragments for each virtual light.
fn check_lists(settings: &Settings) -> Result<()> {
    let refuse = |name: &str, value: &str, allowed: &str| {
        let why = format!("setting {name} is {value:?} with refine_lists=\"per-light\"; allowed: {allowed}");
        if plan::has_lists_per_light(settings) && settings.is(name, value) { Err(Error::Settings(why)) } else { Ok(()) }
    };
    refuse("indirect", "hierarchical", "splat, gather, clustered")?;
    refuse("indirect_visibility", "on", "off")?;
    refuse("form_factor", "quad", "point, disc")
}

/// Rays towards virtual lights know what each part of a sum has; splats have no parts.
fn check_splats(settings: &Settings, lights: &Lights) -> Result<()> {
    let splats = settings.is("indirect", "splat") && settings.is("indirect_visibility", "on");
    match lights {
        Lights::List(list) if splats && parts::ranges(list.count).count() > 1 => Err(Error::Settings(format!(
            "vpls makes {} virtual lights for all lights; allowed with indirect=\"splat\" and indirect_visibility=\"on\": \
             {}",
            list.count,
            parts::AT_ONCE
        ))),
        _ => Ok(()),
    }
}

fn lights(context: &mut Context<'_, '_>, rsm: &Rsm) -> Result<Lights> {
    if context.settings.is("indirect", "hierarchical") {
        return Ok(Lights::Tree(rsm_tree::record(context, rsm)?));
    }
    Ok(Lights::List(if context.settings.is("indirect", "clustered") {
        let tree = rsm_tree::record(context, rsm)?;
        vpl_clusters::record(context, rsm, &tree)?
    } else if context.settings.is("vpl_pattern", "importance") {
        let tree = rsm_tree::record(context, rsm)?;
        vpl_importance::record(context, rsm, &tree)?
    } else {
        vpl_grid::record(context, rsm)?
    }))
}

/// The receivers of a frame: pixels in tile order, or fragments of a list.
struct Work<'g> {
    gbuffer: &'g GBuffer,
    listed: Option<Listed>,
    /// Of all chunks.
    count: usize,
    rsm: Rsm,
    lights: Lights,
    receivers: Buffer<Receiver>,
    /// Receivers of a chunk.
    len: usize,
    /// Shaded pixels.
    active: Buffer<u32>,
    evaluations: Buffer<u32>,
    /// By number of the fragment or pixel.
    irradiance: Buffer<[f32; 4]>,
    seen: Option<Seen>,
}

/// What indirect visibility needs.
struct Seen {
    rays: Buffer<Ray>,
    weights: Buffer<[f32; 4]>,
    occluded: Buffer<u32>,
    sums: Buffer<[f32; 4]>,
}

impl Seen {
    fn new(context: &mut Context<'_, '_>, len: usize, receivers: usize) -> Result<Self> {
        let rays = len * context.settings.int("indirect_rays") as usize;
        let sums = context.resources.buffer("vpl_seen", 2 * receivers.max(1))?;
        context.recorder.clear(&sums)?;
        Ok(Self {
            rays: context.resources.buffer("vpl_rays", rays)?,
            weights: context.resources.buffer("vpl_ray_weights", rays)?,
            occluded: context.resources.buffer("vpl_occluded", rays.div_ceil(32))?,
            sums,
        })
    }
}

impl<'g> Work<'g> {
    fn new(context: &mut Context<'_, '_>, gbuffer: &'g GBuffer) -> Result<Self> {
        let rsm = rsm_rays::record(context)?;
        let lights = lights(context, &rsm)?;
        check_splats(context.settings, &lights)?;
        let listed = match context.settings.is("refine", "none") {
            true => None,
            false => Some(one_pass::record_all_lit(context, gbuffer, PREFIX)?),
        };
        let count = match &listed {
            Some(listed) => context.recorder.fetch(&[&listed.arguments])?[0][3] as usize,
            None => context.view.tiled as usize,
        };
        let by_number = if listed.is_some() { count.max(1) } else { context.view.pixels() };
        let visible = context.settings.is("indirect_visibility", "on");
        let len = chunk_len(context, visible).min(count.max(1));
        let irradiance = context.resources.buffer("virtual_irradiance", by_number)?;
        let active = context.resources.buffer("indirect_receivers", 1)?;
        let evaluations = context.resources.buffer("virtual_evaluations", 2)?;
        context.recorder.clear(&irradiance)?;
        context.recorder.clear(&active)?;
        context.recorder.clear(&evaluations)?;
        let seen = if visible { Some(Seen::new(context, len, by_number)?) } else { None };
        let receivers = context.resources.buffer("indirect_receiver_list", len)?;
        Ok(Self { gbuffer, listed, count, rsm, lights, receivers, len, active, evaluations, irradiance, seen })
    }

    /// Light of the receivers from number `first` on, and what they see of it.
    fn chunk(&self, context: &mut Context<'_, '_>, first: usize, count: usize) -> Result<()> {
        let (receivers, irradiance) = (&self.receivers, &self.irradiance);
        match &self.listed {
            Some(listed) => fragment_receivers::record(context, self.gbuffer, listed, first, count, receivers)?,
            None => receivers::record(context, self.gbuffer, first, count, receivers, &self.active)?,
        }
        let list = (receivers, count);
        let parts = match &self.lights {
            Lights::Tree(tree) => light_cut::record(context, list, &self.rsm, tree, irradiance, &self.evaluations)?,
            Lights::List(lights) if context.settings.is("indirect", "splat") => {
                vpl_splat::record(context, list, lights, irradiance)?;
                Parts::of_count(context, count, 1)?
            }
            Lights::List(lights) => vpl_gather::record(context, list, &self.rsm, lights, irradiance)?,
        };
        let Some(seen) = &self.seen else { return Ok(()) };
        let rays = count * context.settings.int("indirect_rays") as usize;
        let (answers, tracer) = ((&seen.rays, &seen.weights), context.tracer);
        vpl_rays::record(context, list, (&self.rsm, &self.lights), irradiance, &parts, answers)?;
        context.rays += tracer.any(context.recorder, "vpl_shadow", &seen.rays, &seen.occluded, 0..rays)?;
        vpl_visible::sum_up(context, list, (&seen.occluded, &seen.weights), &seen.sums)
    }
}

fn chunk_len(context: &Context<'_, '_>, visible: bool) -> usize {
    if !visible {
        return RECEIVERS;
    }
    let rays = if context.tracer.native() { RAYS_NATIVE } else { RAYS_GPU };
    let receivers = (rays / context.settings.int("indirect_rays") as usize).clamp(1024, RECEIVERS);
    receivers.next_multiple_of(TILE_PIXELS as usize)
}

/// Indirect irradiance of every pixel.
///
/// # Errors
/// Those of the device; `Settings`; `Cancelled`.
pub fn record(context: &mut Context<'_, '_>, gbuffer: &GBuffer) -> Result<Indirect> {
    let work = Work::new(context, gbuffer)?;
    for first in (0..work.count).step_by(work.len) {
        work.chunk(context, first, work.len.min(work.count - first))?;
    }
    if let Some(seen) = &work.seen {
        let count = if work.listed.is_some() { work.count } else { context.view.pixels() };
        vpl_visible::apply(context, gbuffer, work.listed.as_ref(), count, &seen.sums, &work.irradiance)?;
    }
    let fragments = work.listed.map(|listed| listed.fragments);
    let irradiance = match &fragments {
        Some(fragments) => {
            let irradiance = context.resources.buffer("indirect_irradiance", context.view.pixels())?;
            upsample::record_into(context, gbuffer, fragments, &work.irradiance, &irradiance)?;
            irradiance
        }
        None => work.irradiance,
    };
    let evaluations = match &work.lights {
        Lights::Tree(_) => Evaluations { counted: Some(work.evaluations), receivers: None, each: 0 },
        Lights::List(lights) if fragments.is_some() => {
            Evaluations { counted: None, receivers: None, each: (lights.count * work.count) as u64 }
        }
        Lights::List(lights) => Evaluations { counted: None, receivers: Some(work.active), each: lights.count as u64 },
    };
    let levels = fragments.map(|fragments| [fragments.level_map, fragments.reason_map]);
    let list = match work.lights {
        Lights::List(list) => Some(list),
        Lights::Tree(_) => None,
    };
    let virtual_lights = Some((work.rsm, list));
    Ok(Indirect { irradiance, levels, specular: None, evaluations, virtual_lights, volume: None })
}

/// Indirect light where each virtual light has fragments of its own.
///
/// # Errors
/// Those of the device; `Settings`; `Cancelled`.
pub fn per_light(context: &mut Context<'_, '_>, gbuffer: &GBuffer, glossy: bool) -> Result<Indirect> {
    let rsm = rsm_rays::record(context)?;
    let Lights::List(list) = lights(context, &rsm)? else {
        return Err(Error::Settings("refine_lists=\"per-light\" needs a list of virtual lights".to_owned()));
    };
    let reflected = vpl_lists::record(context, gbuffer, &list, glossy)?;
    let evaluations = Evaluations { counted: Some(reflected.evaluations), receivers: None, each: 0 };
    Ok(Indirect {
        irradiance: reflected.irradiance,
        levels: reflected.levels,
        specular: reflected.radiance,
        evaluations,
        virtual_lights: Some((rsm, Some(list))),
        volume: None,
    })
}

/// How many virtual lights were evaluated, as far as the host knows before the frame ends.
#[derive(Debug, Clone, Default)]
pub struct Evaluations {
    /// Two words: bytes and the rest, see `light_cut`.
    pub counted: Option<Buffer<u32>>,
    /// Receivers that evaluate `each`.
    pub receivers: Option<Buffer<u32>>,
    /// Of each receiver; without `receivers`, of all.
    pub each: u64,
}

impl Evaluations {
    /// What has to be read when the frame is done.
    pub fn asked(&self) -> Option<&Buffer<u32>> {
        self.counted.as_ref().or(self.receivers.as_ref())
    }

    /// The number, from what was read.
    pub fn total(&self, words: Option<&[u32]>) -> u64 {
        match (words, &self.counted) {
            (Some([low, high, ..]), Some(_)) => u64::from(*low) + 256 * u64::from(*high),
            (Some([receivers, ..]), None) => u64::from(*receivers) * self.each,
            _ => self.each,
        }
    }
}
