//! Reflective shadow maps [DS05]: rays for their texels, traced, and what the surfaces that they meet reflect.

use bytemuck::{Pod, Zeroable};

use super::virtual_light::{RSM_ROWS, Rsm, RsmMap, VirtualLight, level_first};
use super::{light_samples, vpl_grid};
use crate::error::{Error, Result};
use crate::gpu::Buffer;
use crate::passes::Context;
use crate::passes::visibility::{Hit, Ray};
use crate::scene::prepare::RADIANCE_ROW;
use crate::scene::snapshot::Snapshot;
use crate::settings::Settings;

/// Rays that are traced at once.
const RAYS: usize = 1 << 19;
/// How far off the light its rays start, as a share of its longer edge: clear of its own surface.
const OFFSET: f64 = 1e-4;
/// Fewest texels along an edge of a tile.
const TILE_TEXELS: u32 = 8;
/// Fewest places of a map in the list of what parts of lights emit: 256 bytes, so that each map's can be bound.
const PLACES: usize = 16;

/// Twin of `RsmParams` in `shaders/passes/lights/rsm_rays.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct RsmParams {
    /// Texel of the list.
    pub first: u32,
    /// Parts of lights that a map has room for.
    pub stride: u32,
    /// Unused.
    pub pad0: u32,
    /// Unused.
    pub pad1: u32,
}

/// Bytes of what is longest: the texels of the maps, the tree over them where one is made, the list of virtual lights.
fn longest(settings: &Settings, maps: usize) -> usize {
    let resolution = settings.int("rsm_resolution");
    let clustered = ["clustered", "hierarchical"].iter().any(|indirect| settings.is("indirect", indirect));
    let importance = settings.is("vpl_pattern", "importance");
    let texels = maps * resolution as usize * resolution as usize;
    let nodes = if clustered || importance { level_first(resolution.trailing_zeros() + 1, maps) } else { 0 };
    let vpls = settings.int("vpls");
    let across = vpl_grid::across(vpls, resolution, tiles(settings)) as usize;
    let lights = maps * if importance { vpls as usize } else { across * across };
    (texels * RSM_ROWS * size_of::<[f32; 4]>()).max(nodes.max(lights) * size_of::<VirtualLight>())
}

/// Whether the maps of all lights, and what is made of them, fit into bindings of at most `most` bytes each.
///
/// # Errors
/// `Settings`.
pub fn check(settings: &Settings, snapshot: &Snapshot, most: u64) -> Result<()> {
    let areas = snapshot.area_lights.iter().filter(|light| light.emits());
    let spots = snapshot.spot_lights.iter().filter(|light| light.emits());
    let maps = areas.map(|light| 1 + usize::from(light.two_sided)).sum::<usize>() + spots.count();
    let bytes = longest(settings, maps) as u64;
    if bytes <= most {
        return Ok(());
    }
    let (resolution, vpls) = (settings.int("rsm_resolution"), settings.int("vpls"));
    Err(Error::Settings(format!(
        "rsm_resolution={resolution} with vpls={vpls} and {maps} reflective shadow maps for the lights of this scene needs \
         {bytes} bytes in one binding; this adapter allows {most} (max_storage_buffer_binding_size)"
    )))
}

/// Tiles along an edge of an area light's map.
fn tiles(settings: &Settings) -> u32 {
    let most = settings.int("rsm_resolution") / TILE_TEXELS;
    settings.int("rsm_light_points").isqrt().min(most).max(1)
}

fn spot_map(context: &Context<'_, '_>, light: usize) -> RsmMap {
    let rows = light_samples::rows(context, light);
    let cos = f64::from(rows[4][3]);
    let tan2 = (1.0 - cos) * (1.0 + cos) / (cos * cos);
    let resolution = context.settings.int("rsm_resolution");
    let equal = context.settings.is("rsm_solid_angle", "equal");
    // A square frustum's solid angle, shared by its texels [NSW09 Eq. 4].
    let share = 4.0 * (tan2 / (1.0 + tan2)).asin() / (f64::from(resolution) * f64::from(resolution));
    RsmMap {
        origin: light_samples::xyz(rows[0]).to_array(),
        kind: 0,
        axis: light_samples::xyz(rows[3]).to_array(),
        tan_half: tan2.sqrt() as f32,
        cos_cutoff: rows[4][3],
        tiles: 1,
        resolution,
        equal: if equal { share as f32 } else { 0.0 },
        ..RsmMap::zeroed()
    }
}

fn area_map(context: &Context<'_, '_>, light: usize, tiles: u32) -> RsmMap {
    let [origin, edge_u, edge_v] = light_samples::edges(context, light);
    let [length_u, length_v] = light_samples::lengths(context, light);
    RsmMap {
        origin,
        kind: 1,
        axis: light_samples::xyz(light_samples::rows(context, light)[3]).to_array(),
        edge_u,
        edge_v,
        offset: (OFFSET * length_u.max(length_v)) as f32,
        tiles,
        resolution: context.settings.int("rsm_resolution"),
        ..RsmMap::zeroed()
    }
}

/// The maps, and whose each is.
fn maps_of(context: &Context<'_, '_>, tiles: u32) -> Vec<(RsmMap, usize)> {
    let mut maps = Vec::new();
    for light in 0..context.prepared.lights {
        if context.prepared.is_dark(light) {
            continue;
        }
        if light >= context.prepared.area_lights {
            maps.push((spot_map(context, light), light));
            continue;
        }
        let front = area_map(context, light, tiles);
        maps.push((front, light));
        if light_samples::rows(context, light)[1][3] != 0.0 {
            maps.push((RsmMap { axis: front.axis.map(|x| -x), ..front }, light));
        }
    }
    maps.iter_mut().zip(0..).for_each(|((map, _), number)| map.map = number);
    maps
}

/// What the parts of each light emit, `stride` places a map: a spot's intensity, or radiance times area of a tile's part.
fn emitted(context: &mut Context<'_, '_>, maps: &[(RsmMap, usize)], stride: usize) -> Result<Buffer<[f32; 4]>> {
    let to = context.resources.buffer("rsm_emitted", maps.len() * stride)?;
    let gpu = context.recorder.gpu().clone();
    for (number, (map, light)) in maps.iter().enumerate() {
        let first = number * stride;
        if map.kind == 1 {
            light_samples::parts(context, *light, map.tiles, to.range(&gpu, first..first + stride)?)?;
        } else {
            to.write(&gpu, first, &[light_samples::rows(context, *light)[RADIANCE_ROW]])?;
        }
    }
    Ok(to)
}

/// Makes the maps of all lights that emit anything.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(context: &mut Context<'_, '_>) -> Result<Rsm> {
    let resolution = context.settings.int("rsm_resolution");
    let tiles = tiles(context.settings);
    let owned = maps_of(context, tiles);
    let stride = PLACES.max((tiles * tiles) as usize);
    let from = emitted(context, &owned, stride)?;
    let maps: Vec<RsmMap> = owned.iter().map(|(map, _)| *map).collect();
    let table = context.resources.buffer("rsm_maps", maps.len())?;
    table.write(context.recorder.gpu(), 0, &maps)?;
    let count = maps.len() * resolution as usize * resolution as usize;
    let texels = context.resources.buffer("rsm_texels", RSM_ROWS * count)?;
    let rsm = Rsm { maps, table, resolution, texels };
    trace(context, &rsm, count, &from, stride as u32)?;
    Ok(rsm)
}

fn trace(
    context: &mut Context<'_, '_>,
    rsm: &Rsm,
    texels: usize,
    emitted: &Buffer<[f32; 4]>,
    stride: u32,
) -> Result<()> {
    let features = context.prepared.features();
    let make = context.kernel("lights/rsm_rays", "main")?;
    let store = context.kernel_with("lights/rsm_rays", "store", &[("FEATURES", features.into())])?;
    let len = RAYS.min(texels);
    let rays: Buffer<Ray> = context.resources.buffer("rsm_rays", len)?;
    let hits: Buffer<Hit> = context.resources.buffer("rsm_hits", len)?;
    let scene = context.scene;
    for first in (0..texels).step_by(len.max(1)) {
        let count = len.min(texels - first);
        let params = RsmParams { first: first as u32, stride, pad0: 0, pad1: 0 };
        let pass = context.recorder.pass("rsm_rays", &make).uniform("params", &params);
        pass.bind("maps", &rsm.table).bind("rays", &rays).dispatch(count)?;
        context.rays += context.tracer.closest(context.recorder, "rsm_trace", &rays, &hits, 0..count)?;
        let pass = context.recorder.pass("rsm_rays", &store).uniform("params", &params);
        let pass = pass.bind("maps", &rsm.table).bind("emitted", emitted).bind("hits", &hits);
        let pass = pass.bind("rsm_texels", &rsm.texels).bind("geometry", scene.geometry()?);
        pass.bind("instances", scene.instances()?).bind("texels", scene.texels()?).dispatch(count)?;
    }
    Ok(())
}
