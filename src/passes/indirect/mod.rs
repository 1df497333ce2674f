//! Indirect light: from virtual lights, from a propagation volume, or by a final gather, stratified hemisphere rays from
//! every pixel, whose hits are lit by the lights and may go on as paths, worked on in waves of whole tiles and ranges of
//! strata.

pub mod gather_hits;
pub mod gather_rays;
pub mod gather_sum;
pub mod light_cut;
pub mod parts;
pub mod virtual_lights;
pub mod volumes;
pub mod vpl_gather;
pub mod vpl_rays;
pub mod vpl_splat;
pub mod vpl_visible;

use bytemuck::{Pod, Zeroable};

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::lights::virtual_light::{Rsm, VirtualLights};
use crate::passes::lpv::Propagated;
use crate::passes::visibility::{Hit, Ray};
use crate::passes::{Context, GBuffer, TILE_PIXELS, gather_points};
use crate::plan;
use crate::scene::prepare::strata_grid;
use crate::settings::Settings;
pub use virtual_lights::{Evaluations, Lights, check};

/// Rays of a wave: what the native trace answers in about 0.1 s; a GPU takes more at once.
const WAVE_NATIVE: u32 = 1 << 18;
const WAVE_GPU: u32 = 1 << 20;

/// Twin of `GatherPath` in `shaders/common/gather_path.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct GatherPath {
    /// Irradiance a unit of radiance at the ray's end.
    pub throughput: [f32; 3],
    /// Whose irradiance.
    pub pixel: u32,
    /// What the shadow ray carries.
    pub pending: [f32; 3],
    /// Of the hemisphere.
    pub stratum: u32,
    /// Change of the first hit's light, as a share of it, by way of the ray's origin.
    pub slope: [f32; 3],
    /// Unused.
    pub pad: u32,
}

/// Twin of `GatherWave` in `shaders/common/gather_path.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct GatherWave {
    /// Internal columns.
    pub width: u32,
    /// Internal rows.
    pub height: u32,
    /// First tile of the wave.
    pub first_tile: u32,
    /// Tiles of the wave.
    pub tiles: u32,
    /// First stratum of the wave.
    pub first_stratum: u32,
    /// Strata of the wave.
    pub strata: u32,
    /// Strata of the hemisphere along one axis.
    pub strata_u: u32,
    /// Along the other.
    pub strata_v: u32,
    /// Lights of the scene.
    pub lights: u32,
    /// The user's seed.
    pub seed: u32,
    /// Which bounce the hits are of, from 0.
    pub bounce: u32,
    /// 1: no ray goes on.
    pub last: u32,
}

impl GatherWave {
    /// Rays of the wave.
    pub fn size(&self) -> usize {
        (self.tiles * self.strata * TILE_PIXELS) as usize
    }
}

/// Indirect light of a frame.
pub struct Indirect {
    /// Irradiance a pixel, W·m⁻².
    pub irradiance: Buffer<[f32; 4]>,
    /// Level and reason of each pixel's fragment, where there are larger ones than pixels.
    pub levels: Option<[Buffer<u32>; 2]>,
    /// Radiance a pixel that lobes reflect of it, where they do.
    pub specular: Option<Buffer<[f32; 4]>>,
    /// Virtual lights evaluated.
    pub evaluations: Evaluations,
    /// Where lights shine, and the list of virtual lights, where there are any.
    pub virtual_lights: Option<(Rsm, Option<VirtualLights>)>,
    /// The volume that it went through, where there is one.
    pub volume: Option<Propagated>,
}

/// Number of the form factor in `shaders/common/form_factor.wgsl`, and whether virtual lights are clusters.
pub fn forms(settings: &Settings) -> [(&'static str, f64); 2] {
    let forms = ["point", "disc", "quad"];
    let form = forms.iter().position(|form| settings.is("form_factor", form)).map_or(0.0, |number| number as f64);
    [("FORM", form), mixed(settings)]
}

/// Whether normals of virtual lights are means of normals that differ.
pub fn mixed(settings: &Settings) -> (&'static str, f64) {
    ("MIXED", (settings.is("indirect", "clustered") || settings.is("indirect", "hierarchical")).into())
}

/// The lists of a wave.
pub(super) struct Lists {
    /// Of gather rays.
    pub(super) rays: Buffer<Ray>,
    /// What they meet.
    pub(super) hits: Buffer<Hit>,
    /// What they carry.
    pub(super) paths: Buffer<GatherPath>,
    /// From the hits to points on lights.
    pub(super) shadow_rays: Buffer<Ray>,
    /// Which of these meet something.
    pub(super) occluded: Buffer<u32>,
}

impl Lists {
    /// # Errors
    /// Those of the device.
    pub(super) fn new(context: &mut Context<'_, '_>, len: usize) -> Result<Self> {
        Ok(Self {
            rays: context.resources.buffer("gather_rays", len)?,
            hits: context.resources.buffer("gather_hits", len)?,
            paths: context.resources.buffer("gather_paths", len)?,
            shadow_rays: context.resources.buffer("gather_shadow_rays", len)?,
            occluded: context.resources.buffer("gather_occluded", len.div_ceil(32))?,
        })
    }
}

/// Indirect light as the settings say; `glossy`: some surface has a lobe, and it counts.
///
/// # Errors
/// Those of the device; `Settings`; `Cancelled`.
pub fn record(context: &mut Context<'_, '_>, gbuffer: &GBuffer, glossy: bool) -> Result<Indirect> {
    if plan::has_lists_per_light(context.settings) {
        return virtual_lights::per_light(context, gbuffer, glossy);
    }
    if plan::indirect_from_virtual_lights(context.settings) {
        return virtual_lights::record(context, gbuffer);
    }
    if plan::has_volume(context.settings) {
        return volumes::record(context, gbuffer);
    }
    if plan::gathers_at_points(context.settings) {
        return gather_points::record(context, gbuffer);
    }
    let irradiance = final_gather(context, gbuffer)?;
    let evaluations = Evaluations::default();
    Ok(Indirect { irradiance, levels: None, specular: None, evaluations, virtual_lights: None, volume: None })
}

/// The waves of as many tiles as they are with `rays` from each place: whole tiles with all their strata, or where there are
/// too many of these a part of one tile's.
pub(super) fn waves(context: &Context<'_, '_>, [width, height]: [u32; 2], tiles: u32, rays: u32) -> Vec<GatherWave> {
    let capacity = if context.tracer.native() { WAVE_NATIVE } else { WAVE_GPU };
    let [strata_u, strata_v] = strata_grid(rays, 1.0, 1.0);
    let strata_at_once = rays.min(capacity / TILE_PIXELS);
    let tiles_at_once = (capacity / (TILE_PIXELS * strata_at_once)).clamp(1, tiles.max(1));
    let lights = context.prepared.lights as u32;
    let seed = context.settings.int("seed");
    let mut waves = Vec::new();
    for first_tile in (0..tiles).step_by(tiles_at_once as usize) {
        let tiles = tiles_at_once.min(tiles - first_tile);
        for first_stratum in (0..rays).step_by(strata_at_once as usize) {
            let strata = strata_at_once.min(rays - first_stratum);
            let part = GatherWave { first_tile, tiles, first_stratum, strata, ..GatherWave::zeroed() };
            waves.push(GatherWave { width, height, strata_u, strata_v, lights, seed, ..part });
        }
    }
    waves
}

/// Indirect irradiance of every pixel by rays.
fn final_gather(context: &mut Context<'_, '_>, gbuffer: &GBuffer) -> Result<Buffer<[f32; 4]>> {
    let irradiance = context.resources.buffer("indirect_irradiance", context.view.pixels())?;
    context.recorder.clear(&irradiance)?;
    let tiles = context.view.tiled / TILE_PIXELS;
    let size = [context.view.width, context.view.height];
    let waves = waves(context, size, tiles, context.settings.int("gather_rays"));
    let lists = Lists::new(context, waves.iter().map(GatherWave::size).max().unwrap_or(0))?;
    for wave in waves {
        record_wave(context, gbuffer, wave, &lists, &irradiance)?;
    }
    Ok(irradiance)
}

fn record_wave(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    mut wave: GatherWave,
    lists: &Lists,
    irradiance: &Buffer<[f32; 4]>,
) -> Result<()> {
    let bounces = context.settings.int("bounces");
    let count = wave.size();
    gather_rays::record(context, gbuffer, &wave, &lists.rays, &lists.paths)?;
    for bounce in 0..bounces {
        (wave.bounce, wave.last) = (bounce, u32::from(bounce + 1 == bounces));
        context.rays += context.tracer.closest(context.recorder, "trace", &lists.rays, &lists.hits, 0..count)?;
        gather_hits::record(context, &wave, lists, false)?;
        context.rays +=
            context.tracer.any(context.recorder, "shadow", &lists.shadow_rays, &lists.occluded, 0..count)?;
        gather_sum::record(context, &wave, &lists.paths, &lists.occluded, irradiance)?;
    }
    Ok(())
}
