//! Shadow maps of light samples, for comparison [NPW10 Sec. 4]: rays for their texels, traced, and their distances.

use bytemuck::{Pod, Zeroable};

use super::{Hit, Ray};
use crate::error::{Error, Result};
use crate::gpu::Buffer;
use crate::passes::Context;
use crate::passes::lights::light_samples::{self, LightSamples};
use crate::scene::snapshot::Snapshot;
use crate::settings::Settings;

/// Rays that are traced at once.
const RAYS: usize = 1 << 19;
/// How far off the light its rays start, as a share of its longer edge: clear of its own surface.
const OFFSET: f64 = 1e-4;
/// Half of the narrowest frustum's width at distance 1.
const LEAST_TAN: f32 = 1e-6;
/// Texels along an edge at most.
const MOST_WIDTH: u32 = 4096;

/// Twin of `MapParams` in `shaders/common/shadow_map.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct MapParams {
    /// Of the light's lit side, or a spot's axis.
    pub normal: [f32; 3],
    /// Texels along an edge.
    pub resolution: u32,
    /// 2: a second map of each sample looks the other way.
    pub sides: u32,
    /// First texel.
    pub first: u32,
    /// Samples that have maps: those of all interleaved sets.
    pub samples: u32,
    /// How far off the light its rays start.
    pub offset: f32,
    /// Half of the frustum's width at distance 1; 0: a hemisphere.
    pub tan_half: f32,
    /// Unused.
    pub pad0: u32,
    /// Unused.
    pub pad1: u32,
    /// Unused.
    pub pad2: u32,
}

/// The maps of one light.
pub struct LightMaps {
    /// Whose maps: the light's samples.
    pub points: Buffer<[f32; 4]>,
    /// Where they are; `first` is their first texel.
    pub params: MapParams,
}

/// The maps of all lights.
pub struct ShadowMaps {
    /// Distance to the first thing, a texel each.
    pub distances: Buffer<f32>,
    /// Light by light.
    pub lights: Vec<LightMaps>,
}

/// Width of a spot's map: it has one where an area light has one for each sample, and may be as large as those together.
fn spot_width(settings: &Settings) -> u32 {
    let across = f64::from(settings.int("light_samples")).sqrt().ceil() as u32;
    (settings.int("shadow_map_resolution") * across).min(MOST_WIDTH)
}

fn texels(maps: u64, resolution: u32) -> u64 {
    maps * u64::from(resolution) * u64::from(resolution)
}

/// Whether the maps of all lights fit into one binding of at most `most` bytes.
///
/// # Errors
/// `Settings`.
pub fn check(settings: &Settings, snapshot: &Snapshot, most: u64) -> Result<()> {
    let (samples, resolution) = (settings.int("light_samples"), settings.int("shadow_map_resolution"));
    let sides: u64 = snapshot.area_lights.iter().map(|l| 1 + u64::from(l.two_sided)).sum();
    let of_spots = snapshot.spot_lights.len() as u64;
    let maps = sides * u64::from(samples) + of_spots;
    let all = texels(sides * u64::from(samples), resolution) + texels(of_spots, spot_width(settings));
    let bytes = all * size_of::<f32>() as u64;
    if bytes <= most {
        return Ok(());
    }
    Err(Error::Settings(format!(
        "shadow_map_resolution={resolution} with light_samples={samples} makes {maps} maps for the lights of this scene, \
         {bytes} bytes; this adapter allows {most} (max_storage_buffer_binding_size)"
    )))
}

fn maps_of(context: &Context<'_, '_>, light: &LightSamples, first: u32) -> LightMaps {
    let [u, v] = light_samples::lengths(context, light.light as usize);
    let (settings, cos) = (context.settings, light.cos_cutoff);
    // Rounding may not take the frustum's width from a cone without any.
    let tan_half = (((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt() / cos).max(LEAST_TAN);
    let params = MapParams {
        normal: light.normal.to_array(),
        resolution: if light.is_area() { settings.int("shadow_map_resolution") } else { spot_width(settings) },
        sides: 1 + u32::from(light.is_area() && light.two_sided),
        first,
        samples: light.strata * light.classes,
        offset: (OFFSET * u.max(v)) as f32,
        tan_half: if light.is_area() { 0.0 } else { tan_half },
        ..Zeroable::zeroed()
    };
    LightMaps { points: light.points.clone(), params }
}

/// Makes the maps of all lights.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(context: &mut Context<'_, '_>, samples: &[LightSamples]) -> Result<ShadowMaps> {
    let mut first = 0;
    let mut lights = Vec::new();
    let mut counts = Vec::new();
    for light in samples {
        let maps = maps_of(context, light, first);
        let count = texels(u64::from(maps.params.samples * maps.params.sides), maps.params.resolution) as u32;
        first += count;
        counts.push(count as usize);
        lights.push(maps);
    }
    let distances = context.resources.buffer("shadow_maps", first as usize)?;
    for (light, count) in lights.iter().zip(counts) {
        trace(context, light, count, &distances)?;
    }
    Ok(ShadowMaps { distances, lights })
}

fn trace(context: &mut Context<'_, '_>, light: &LightMaps, texels: usize, distances: &Buffer<f32>) -> Result<()> {
    let (make, store) =
        (context.kernel("visibility/map_rays", "main")?, context.kernel("visibility/map_rays", "store")?);
    let len = RAYS.min(texels);
    let rays: Buffer<Ray> = context.resources.buffer("map_rays", len)?;
    let hits: Buffer<Hit> = context.resources.buffer("map_hits", len)?;
    for first in (0..texels).step_by(len.max(1)) {
        let count = len.min(texels - first);
        let own = MapParams { first: first as u32, ..light.params };
        let pass = context.recorder.pass("map_rays", &make).uniform("params", &own);
        pass.bind("points", &light.points).bind("rays", &rays).dispatch(count)?;
        context.rays += context.tracer.closest(context.recorder, "map_trace", &rays, &hits, 0..count)?;
        let all = MapParams { first: light.params.first + first as u32, ..own };
        let pass = context.recorder.pass("map_rays", &store).uniform("params", &all);
        pass.bind("hits", &hits).bind("distances", distances).dispatch(count)?;
    }
    Ok(())
}
