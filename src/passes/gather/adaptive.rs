//! Direct light where shadows decide what is worth a ray: exact unshadowed light at each pixel times the visible share of
//! it, which is 1 or 0 without a ray where that can be proven, and asked finely only where it changes.

use super::irradiance::{self, IrradianceWork};
use super::{Direct, share, smooth_share};
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Usage};
use crate::passes::lights::light_samples::{self, LightSamples};
use crate::passes::refine::light_bounds::{self, LightFrame, Tiles, flags};
use crate::passes::refine::list_params::{Asked, CELL_PIXELS, WORDS};
use crate::passes::refine::penumbra::{self, PenumbraParams};
use crate::passes::refine::uniform_levels::Levels;
use crate::passes::refine::zone::{self, Cells};
use crate::passes::refine::{cell_rays, cells, compact, penumbra_rays, zone_rays};
use crate::passes::{Context, GBuffer, TILE_PIXELS};

/// Largest `finest_level`: that of the cells.
const FINEST: u32 = 1;
/// Receivers of a piece: a few megabytes for two cores; a GPU would spend its time on beginnings and ends.
const RECEIVERS_NATIVE: usize = 1 << 17;
const RECEIVERS_GPU: usize = 1 << 20;
/// Bit of `cell_plan`: the cell lies in the zone. Twins of the bits in `shaders/common/cells.wgsl`.
pub const PLAN_ZONE: u32 = 1;
/// Bit of `cell_plan`: each of its pixels asks for itself.
pub const PLAN_TRACED: u32 = 2;

/// A list on the device, and its length once the host has read it.
struct List {
    entries: Buffer<u32>,
    arguments: Buffer<u32>,
    count: usize,
}

/// Records the list of the words among the first `items` of `flags` whose bits in `mask` are `value`.
fn select(
    context: &mut Context<'_, '_>,
    name: &str,
    (flags, items): (&Buffer<u32>, usize),
    mask: u32,
    value: u32,
) -> Result<List> {
    let entries = context.resources.buffer(name, items)?;
    let arguments = context.resources.buffer_for(&format!("{name}/arguments"), 4, Usage::Indirect)?;
    compact::record(context, "compact", flags, items, mask, value, &entries, &arguments)?;
    Ok(List { entries, arguments, count: 0 })
}

/// Reads the lengths of lists; one wait for all of them.
fn count<const N: usize>(context: &mut Context<'_, '_>, mut lists: [List; N]) -> Result<[List; N]> {
    let words = context.recorder.fetch(&lists.each_ref().map(|list| &list.arguments))?;
    lists.iter_mut().zip(&words).for_each(|(list, words)| list.count = words[3] as usize);
    Ok(lists)
}

/// Direct irradiance of every pixel, light by light, and the fragment maps.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(context: &mut Context<'_, '_>, gbuffer: &GBuffer, keep: bool) -> Result<Direct> {
    let finest = context.settings.int("finest_level");
    if finest > FINEST {
        return Err(Error::Settings(format!(
            "setting finest_level is {finest}; with direct_estimator=\"ratio\" allowed: 0 or {FINEST}, because cells of \
             2 x 2 pixels share what they ask of a light"
        )));
    }
    let pixels = context.view.pixels();
    let irradiance = context.resources.buffer("direct_irradiance", pixels)?;
    let pixel_lights: Buffer<u32> = context.resources.buffer("pixel_lights", pixels)?;
    let active = context.resources.buffer("active_receivers", 1)?;
    context.recorder.clear(&irradiance)?;
    context.recorder.clear(&pixel_lights)?;
    context.recorder.clear(&active)?;
    let mut found = Found::default();
    let mut proven = Vec::new();
    let mut levels = Levels::new(context, gbuffer, context.view.tiled as usize / TILE_PIXELS as usize)?;
    for light in 0..context.prepared.lights {
        if context.prepared.is_dark(light) {
            proven.push(None);
            continue;
        }
        let frame = LightFrame::of(context, light);
        let tiles = light_bounds::record(context, gbuffer, &frame, light as u32, &pixel_lights, &active)?;
        let work = Light::new(context, gbuffer, frame, tiles, light)?;
        let share = work.visible_share(context, &mut found)?;
        proven.push(if keep { Some(work.keep_flags(context)?) } else { None });
        levels.add(context, gbuffer, &pixel_lights, &work.cells, !work.light.is_area())?;
        work.shade(context, &share, &irradiance)?;
    }
    levels.finish(context, gbuffer, &pixel_lights)?;
    let levels = Some([levels.level_map, levels.reason_map]);
    Ok(Direct {
        irradiance,
        active,
        samples: 1,
        levels,
        empty: found.empty(),
        specular: None,
        specular_levels: None,
        proven,
        looked: None,
    })
}

fn most_receivers(context: &Context<'_, '_>) -> usize {
    if context.tracer.native() { RECEIVERS_NATIVE } else { RECEIVERS_GPU }
}

/// What the lists of all lights held together.
#[derive(Default)]
struct Found {
    open_tiles: usize,
    zone_cells: usize,
    traced_cells: usize,
}

impl Found {
    /// Passes that had nothing to do.
    fn empty(&self) -> Vec<(&'static str, &'static str)> {
        let of = |count: usize, passes: &[&'static str], reason: &'static str| {
            passes.iter().filter(|_| count == 0).map(|&pass| (pass, reason)).collect::<Vec<_>>()
        };
        let open = ["direct/cell_rays", "direct/cell_shadow", "direct/cells"];
        let zone =
            ["direct/penumbra_rays", "direct/penumbra_trace", "direct/penumbra", "direct/share", "direct/smooth_share"];
        let traced = ["direct/zone_rays", "direct/zone_shadow"];
        let mut all = of(self.open_tiles, &open, "every tile is proven lit or dark");
        all.extend(of(self.zone_cells, &zone, "there is no penumbra"));
        all.extend(of(self.traced_cells, &traced, "no pixel lies in a narrow penumbra"));
        all
    }
}

/// One light at work.
struct Light<'g> {
    gbuffer: &'g GBuffer,
    frame: LightFrame,
    tiles: Tiles,
    light: LightSamples,
    cells: Cells,
    /// Shorter edge.
    size: f32,
}

impl<'g> Light<'g> {
    fn new(
        context: &mut Context<'_, '_>,
        gbuffer: &'g GBuffer,
        frame: LightFrame,
        tiles: Tiles,
        light: usize,
    ) -> Result<Self> {
        let [length_u, length_v] = light_samples::lengths(context, light);
        let size = length_u.min(length_v) as f32;
        let light = light_samples::blocks(context, light)?;
        let cells = Cells::new(context, tiles.count)?;
        Ok(Self { gbuffer, frame, tiles, light, cells, size })
    }

    /// A copy of what is proven of each tile, for whoever asked to keep it.
    fn keep_flags(&self, context: &mut Context<'_, '_>) -> Result<Buffer<u32>> {
        let name = format!("proven_tiles/{}", self.light.light);
        let copy = context.resources.buffer(&name, self.tiles.count)?;
        context.recorder.copy(&self.tiles.flags, &copy, self.tiles.count)?;
        Ok(copy)
    }

    /// Which part of the light each pixel sees: `cells.state`, and in the zone the buffer that is returned.
    fn visible_share(&self, context: &mut Context<'_, '_>, found: &mut Found) -> Result<Buffer<[f32; 4]>> {
        if !context.settings.is("visibility", "none") {
            let (frame, tiles) = (&self.frame, &self.tiles);
            if context.settings.is("shadow_proofs", "on") {
                context.tracer.prove(
                    context.recorder,
                    "prove",
                    frame,
                    &tiles.bounds,
                    &tiles.flags,
                    self.gbuffer,
                    &context.view,
                )?;
            }
            found.open_tiles += self.ask_open_tiles(context)?;
        }
        zone::record(context, &self.light, &self.tiles, &self.cells)?;
        if !self.light.is_area() || context.settings.is("visibility", "none") {
            return Ok(self.cells.share.clone());
        }
        let plan = (&self.cells.plan, self.cells.count);
        let zone = select(context, "zone_cells", plan, PLAN_ZONE, PLAN_ZONE)?;
        let [zone] = count(context, [zone])?;
        found.zone_cells += zone.count;
        if zone.count == 0 {
            return Ok(self.cells.share.clone());
        }
        self.plan_zone(context, &zone)?;
        self.ask_zone(context, found)
    }

    /// Pieces of a list with `pixels` receivers an entry: `make` writes them and what they ask, `take` has the answers.
    fn ask(
        &self,
        context: &mut Context<'_, '_>,
        list: &List,
        pixels: usize,
        stage: &str,
        make: impl Fn(&mut Context<'_, '_>, &Asked<'_>) -> Result<()>,
        take: impl Fn(&mut Context<'_, '_>, &Asked<'_>) -> Result<()>,
    ) -> Result<()> {
        let len = most_receivers(context).min((list.count * pixels).next_power_of_two().max(64));
        let receivers = context.resources.buffer("receivers", len)?;
        let bits = context.resources.buffer("asked", len * if self.light.is_area() { WORDS } else { 1 })?;
        for first in (0..list.count).step_by(len / pixels) {
            let count = (list.count - first).min(len / pixels);
            let piece = Asked {
                gbuffer: self.gbuffer,
                light: &self.light,
                list: &list.entries,
                first,
                count,
                receivers: &receivers,
                bits: &bits,
            };
            make(context, &piece)?;
            let (asked, tracer) = (self.light.shadow_light(), context.tracer);
            context.rays +=
                tracer.shadow_asked(context.recorder, stage, &receivers, &asked, &bits, 0..count * pixels)?;
            take(context, &piece)?;
        }
        Ok(())
    }

    /// One answer a block of strata for each cell of the tiles of which nothing is proven.
    fn ask_open_tiles(&self, context: &mut Context<'_, '_>) -> Result<usize> {
        let mask = flags::FACING | flags::LIT | flags::DARK;
        let open = select(context, "open_tiles", (&self.tiles.flags, self.tiles.count), mask, flags::FACING)?;
        let [open] = count(context, [open])?;
        self.ask(
            context,
            &open,
            TILE_PIXELS as usize,
            "cell_shadow",
            |context, piece| cell_rays::record(context, &self.frame, piece),
            |context, piece| cells::record(context, piece, &self.cells),
        )?;
        Ok(open.count)
    }

    /// How wide the penumbra is at each cell of the zone, and what it does.
    fn plan_zone(&self, context: &mut Context<'_, '_>, zone: &List) -> Result<()> {
        let width: Buffer<f32> = context.resources.buffer("cell_width", self.cells.count)?;
        context.recorder.clear(&width)?;
        let len = most_receivers(context).min(zone.count.next_power_of_two());
        let rays = context.resources.buffer("penumbra_rays", len)?;
        let hits = context.resources.buffer("penumbra_hits", len)?;
        for first in (0..zone.count).step_by(len) {
            let count = (zone.count - first).min(len);
            let list = (&zone.entries, first, count);
            penumbra_rays::record(context, self.gbuffer, &self.light, &self.cells, list, &rays)?;
            context.rays += context.tracer.closest(context.recorder, "penumbra_trace", &rays, &hits, 0..count)?;
            let params = PenumbraParams::new(context, self.size, first);
            penumbra::widths(context, self.gbuffer, &params, (&zone.entries, count), (&rays, &hits), &width)?;
        }
        let params = PenumbraParams::new(context, self.size, 0);
        penumbra::plans(context, &params, (&zone.entries, zone.count), &width, &self.cells)
    }

    /// Asks, weighs and smooths.
    fn ask_zone(&self, context: &mut Context<'_, '_>, found: &mut Found) -> Result<Buffer<[f32; 4]>> {
        let plan = (&self.cells.plan, self.cells.count);
        let both = PLAN_ZONE | PLAN_TRACED;
        let traced = select(context, "traced_cells", plan, both, both)?;
        let coarse = select(context, "coarse_cells", plan, both, PLAN_ZONE)?;
        let [traced, coarse] = count(context, [traced, coarse])?;
        found.traced_cells += traced.count;
        self.ask(
            context,
            &traced,
            CELL_PIXELS,
            "zone_shadow",
            |context, piece| zone_rays::record(context, piece, &self.cells),
            |context, piece| share::pixels(context, piece, &self.cells),
        )?;
        if coarse.count > 0 {
            let list = (&coarse.entries, coarse.count);
            share::cells(context, self.gbuffer, &self.light, &self.cells, list)?;
        }
        if context.settings.is("penumbra_filter", "off") {
            return Ok(self.cells.share.clone());
        }
        let smooth = context.resources.buffer("smooth_share", context.view.pixels())?;
        for (list, traced) in [(&traced, true), (&coarse, false)] {
            if list.count > 0 {
                let list = (&list.entries, list.count, traced);
                smooth_share::record(context, self.gbuffer, &self.light, &self.cells, list, &smooth)?;
            }
        }
        Ok(smooth)
    }

    /// Adds the light, pixel by pixel.
    fn shade(
        &self,
        context: &mut Context<'_, '_>,
        share: &Buffer<[f32; 4]>,
        irradiance: &Buffer<[f32; 4]>,
    ) -> Result<()> {
        let work = IrradianceWork {
            light: self.light.light,
            gbuffer: self.gbuffer,
            tile_flags: &self.tiles.flags,
            cell_state: &self.cells.state,
            share,
            irradiance,
        };
        irradiance::record(context, &work)
    }
}
