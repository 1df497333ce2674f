//! Reflective shadow maps of all lights: rays for their texels, traced, and what they meet.

use glam::Vec3;

use super::light_samples;
use super::virtual_light::{RSM_ROWS, Rsm, RsmMap, VirtualLight};
use crate::error::{Error, Result};
use crate::gpu::Buffer;
use crate::passes::Context;
use crate::passes::visibility::{Hit, Ray};
use crate::scene::prepare::{LIGHT_ROWS, RADIANCE_ROW};
use crate::scene::snapshot::Snapshot;
use crate::settings::Settings;

/// Rays that are traced at once.
const RAYS: usize = 1 << 19;
/// How far off an area light its rays start, as a share of its longer edge: clear of its own surface.
const OFFSET: f32 = 1e-4;
/// Texels along an edge that each point of an area light has at least.
const LEAST_TILE: u32 = 8;

/// Points along an edge of an area light.
fn tiles(settings: &Settings) -> u32 {
    let wanted = f64::from(settings.int("rsm_light_points")).sqrt() as u32;
    wanted.min(settings.int("rsm_resolution") / LEAST_TILE).max(1)
}

/// Whether the maps of all lights, and what is made of them, fit into bindings of at most `most` bytes.
///
/// # Errors
/// `Settings`.
pub fn check(settings: &Settings, snapshot: &Snapshot, most: u64) -> Result<()> {
    let resolution = settings.int("rsm_resolution");
    let sides: u64 = snapshot.area_lights.iter().map(|l| 1 + u64::from(l.two_sided)).sum();
    let maps = sides + snapshot.spot_lights.len() as u64;
    let tree = ["clustered", "hierarchical"].iter().any(|indirect| settings.is("indirect", indirect));
    let texel = if tree || settings.is("vpl_pattern", "importance") {
        size_of::<VirtualLight>() * 4 / 3 + 1
    } else {
        RSM_ROWS * size_of::<[f32; 4]>()
    };
    let bytes = maps * u64::from(resolution) * u64::from(resolution) * texel as u64;
    if bytes <= most {
        return Ok(());
    }
    Err(Error::Settings(format!(
        "rsm_resolution={resolution} makes {maps} maps for the lights of this scene, {bytes} bytes; this adapter allows \
         {most} (max_storage_buffer_binding_size)"
    )))
}

/// The map or maps of a light; none where it is dark.
fn maps_of(context: &Context<'_, '_>, light: usize, first: u32) -> Vec<RsmMap> {
    let rows = &context.prepared.light_rows[light * LIGHT_ROWS..][..LIGHT_ROWS];
    if rows[RADIANCE_ROW][..3].iter().all(|&channel| channel <= 0.0) {
        return Vec::new();
    }
    let xyz = |row: usize| [rows[row][0], rows[row][1], rows[row][2]];
    let (settings, cos_cutoff) = (context.settings, rows[4][3]);
    let spot = light >= context.prepared.area_lights;
    let longer = Vec3::from(xyz(1)).length().max(Vec3::from(xyz(2)).length());
    let map = RsmMap {
        origin: xyz(0),
        kind: u32::from(!spot),
        axis: xyz(3),
        tan_half: if spot { (1.0 / (cos_cutoff * cos_cutoff) - 1.0).max(0.0).sqrt() } else { 0.0 },
        edge_u: if spot { [0.0; 3] } else { xyz(1) },
        cos_cutoff,
        edge_v: if spot { [0.0; 3] } else { xyz(2) },
        offset: if spot { 0.0 } else { OFFSET * longer },
        tiles: if spot { 1 } else { tiles(settings) },
        resolution: settings.int("rsm_resolution"),
        equal: u32::from(settings.is("rsm_solid_angle", "equal")),
        map: first,
    };
    let back = RsmMap { axis: map.axis.map(|x| -x), map: first + 1, ..map };
    if !spot && rows[1][3] != 0.0 { vec![map, back] } else { vec![map] }
}

/// Makes the maps of all lights that shine.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(context: &mut Context<'_, '_>) -> Result<Rsm> {
    let resolution = context.settings.int("rsm_resolution");
    let mut maps: Vec<RsmMap> = Vec::new();
    let mut lights = Vec::new();
    for light in 0..context.prepared.lights {
        let own = maps_of(context, light, maps.len() as u32);
        lights.extend(own.iter().map(|_| light));
        maps.extend(own);
    }
    let texels = resolution as usize * resolution as usize;
    let table = context.resources.buffer("rsm_maps", maps.len().max(1))?;
    table.write(context.recorder.gpu(), 0, &maps)?;
    let rsm = Rsm {
        table,
        resolution,
        texels: context.resources.buffer("rsm_texels", (RSM_ROWS * texels * maps.len()).max(1))?,
        maps,
    };
    for (map, light) in rsm.maps.iter().zip(lights) {
        trace(context, &rsm, map, light)?;
    }
    Ok(rsm)
}

fn trace(context: &mut Context<'_, '_>, rsm: &Rsm, map: &RsmMap, light: usize) -> Result<()> {
    let radiance = light_samples::radiance_of(context, light, [map.tiles; 2], "rsm_radiance")?;
    let features = [("FEATURES", context.prepared.features().into())];
    let make = context.kernel("lights/rsm_rays", "main")?;
    let store = context.kernel_with("lights/rsm_rays", "store", &features)?;
    let texels = rsm.resolution as usize * rsm.resolution as usize;
    let len = RAYS.min(texels);
    let rays: Buffer<Ray> = context.resources.buffer("rsm_rays", len)?;
    let hits: Buffer<Hit> = context.resources.buffer("rsm_hits", len)?;
    for first in (0..texels).step_by(len) {
        let count = len.min(texels - first);
        let start = [first as u32, 0, 0, 0];
        let pass = context.recorder.pass("rsm_rays", &make).uniform("map", map).uniform("first", &start);
        pass.bind("rays", &rays).dispatch(count)?;
        context.rays += context.tracer.closest(context.recorder, "rsm_trace", &rays, &hits, 0..count)?;
        let scene = context.scene;
        let pass = context.recorder.pass("rsm_rays", &store).uniform("map", map).uniform("first", &start);
        let pass = pass.bind("hits", &hits).bind("radiance", &radiance).bind("geometry", scene.geometry()?);
        let pass = pass.bind("instances", scene.instances()?).bind("texels", scene.texels()?);
        pass.bind("rsm_texels", &rsm.texels).dispatch(count)?;
    }
    Ok(())
}
