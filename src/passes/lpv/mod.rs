//! Light propagation volumes: samples all over the surfaces gather from the lights, what they reflect is left in the
//! cells before them, goes from cell to cell, and lights whoever looks into the cells that it passed [KD10; KJ16].

pub mod blockers;
pub mod inject;
pub mod look_up;
pub mod nested;
pub mod points;
pub mod propagate;
pub mod sample_rays;

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, IVec3, Vec3};

use self::points::{Asked, Placed};
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Gpu, Usage};
use crate::passes::indirect::{GatherWave, Lists, gather_hits, gather_sum};
use crate::passes::visibility::Receiver;
use crate::passes::{Context, TILE_PIXELS};
use crate::plan;
use crate::scene::prepare::Prepared;
use crate::settings::Settings;

/// Paths of a wave.
const WAVE: usize = 1 << 18;

/// Twin of `Volume` in `shaders/common/lpv_volume.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Volume {
    /// Scene space, of cell 0.
    pub corner: [f32; 3],
    /// Of a cell, scene units.
    pub edge: f32,
    /// Cells along each axis.
    pub size: [u32; 3],
    /// All of them.
    pub cells: u32,
}

impl Volume {
    /// About all meshes, with a margin of a cell, so that both sides of what is outermost lie inside.
    pub fn of(prepared: &Prepared, resolution: u32) -> Self {
        let mut bounds = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        for placed in &prepared.placed {
            for &vertex in placed.mesh.triangles.iter().flatten() {
                let p = placed.scene_from_object.transform_point3(placed.mesh.positions[vertex as usize].as_dvec3());
                bounds = [bounds[0].min(p), bounds[1].max(p)];
            }
        }
        let extent = (bounds[1] - bounds[0]).max(DVec3::ZERO);
        // A little more than the extent, so that rounding adds no cell.
        let edge = 1.0001 * extent.max_element() / f64::from(resolution - 2);
        let inside = (extent / edge).ceil().max(DVec3::ONE);
        let size = (inside + 2.0).as_uvec3();
        let corner = (bounds[0] + bounds[1]) * 0.5 - edge * 0.5 * size.as_dvec3();
        let corner: Vec3 = corner.as_vec3();
        Self { corner: corner.to_array(), edge: edge as f32, size: size.to_array(), cells: size.element_product() }
    }
}

/// Two bands of spherical harmonics a cell: all cells of red, then of green, then of blue.
pub type Flow = Buffer<[f32; 4]>;

/// Largest net flow, as a share of all light of a cell.
fn most(settings: &Settings) -> f32 {
    settings.float("lpv_most_flow").unwrap_or(0.7) as f32
}

/// # Errors
/// `Settings` when the volume does not fit the adapter.
pub fn check(settings: &Settings, gpu: &Gpu) -> Result<()> {
    let reflected = settings.float("lpv_reflection").unwrap_or(0.0);
    if plan::has_volume(settings) && reflected > 0.0 && settings.is("lpv_transport", "sides") {
        return Err(Error::Settings(format!(
            "lpv_reflection={reflected} sends light back towards other sides than it came from, which \
             lpv_transport=\"sides\" keeps apart; allowed: lpv_transport=\"together\" or \"faces\", or lpv_reflection=0"
        )));
    }
    let resolution = settings.int("lpv_resolution");
    let bytes = 3 * 16 * u64::from(resolution).pow(3);
    let most = gpu.limits().max_storage_buffer_binding_size;
    if plan::has_volume(settings) && bytes > most {
        return Err(Error::Settings(format!(
            "lpv_resolution={resolution} needs up to {bytes} bytes in one binding; this adapter allows {most} \
             (max_storage_buffer_binding_size)"
        )));
    }
    Ok(())
}

/// The light of a frame, ready to be looked up.
#[derive(Clone)]
pub struct Propagated {
    /// That of the whole scene first, then of each volume inside of the one before.
    pub volumes: Vec<Passed>,
}

/// The light of a volume.
#[derive(Clone)]
pub struct Passed {
    /// The volume.
    pub placed: Arc<Placed>,
    /// Means that left each cell through its lower faces, and through its upper ones.
    pub passed: [Flow; 2],
}

impl Propagated {
    /// Irradiance of `count` receivers at the places that their `pixel` says.
    ///
    /// # Errors
    /// Those of the device; `Cancelled`.
    pub fn look_up(
        &self,
        context: &mut Context<'_, '_>,
        receivers: (&Buffer<Receiver>, usize),
        irradiance: &Buffer<[f32; 4]>,
    ) -> Result<()> {
        self.volumes.iter().try_for_each(|volume| look_up::record(context, receivers, volume, irradiance))
    }
}

/// Gathers at the surface samples, leaves what they reflect in the volumes and lets it propagate.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(context: &mut Context<'_, '_>) -> Result<Propagated> {
    let asked = Asked::of(context.settings);
    let placed = match context.volumes.placed(0, asked) {
        Some(placed) => placed,
        None => place(context, 0, asked, Volume::of(context.prepared, asked.resolution))?,
    };
    let mut volumes = vec![propagate(context, 0, placed, None)?];
    for level in 1..context.settings.int("lpv_cascades") as usize {
        let Some(outer) = volumes.last().cloned() else { break };
        let (asked, volume) = nested::asked(context.settings, &outer.placed, &context.view);
        let placed = match context.volumes.placed(level, asked) {
            Some(placed) => placed,
            None => place(context, level, asked, volume)?,
        };
        volumes.push(propagate(context, level, placed, Some(&outer))?);
    }
    Ok(Propagated { volumes })
}

/// The light of one volume; what enters it comes from the one outside.
fn propagate(
    context: &mut Context<'_, '_>,
    level: usize,
    placed: Arc<Placed>,
    outer: Option<&Passed>,
) -> Result<Passed> {
    let radiosity = gather(context, &placed)?;
    let coefficients = 3 * placed.volume.cells as usize;
    let flow: Flow = context.resources.buffer("lpv_flow", coefficients)?;
    let names = ["lower", "upper"].map(|side| format!("lpv_passed_{side}_{level}"));
    let [lower, upper] = names.map(|name| context.resources.buffer(&name, coefficients));
    let passed = [lower?, upper?];
    for sums in &passed {
        context.recorder.clear(sums)?;
    }
    for &side in sides(context.settings) {
        inject::record(context, &placed, &radiosity, side, &flow)?;
        if let Some(outer) = outer {
            inject::enter(context, &placed, outer, side, &flow)?;
        }
        propagate::record(context, &placed, side, &flow, &passed)?;
    }
    Ok(Passed { placed, passed })
}

/// Ways that surfaces face whose light propagates by itself; 0: that of all together.
fn sides(settings: &Settings) -> &'static [IVec3] {
    const SIX: [IVec3; 6] = [IVec3::NEG_X, IVec3::X, IVec3::NEG_Y, IVec3::Y, IVec3::NEG_Z, IVec3::Z];
    if settings.is("lpv_transport", "sides") { &SIX } else { &[IVec3::ZERO] }
}

/// A new volume of a level, and samples whose light is left in cells that they see.
fn place(context: &mut Context<'_, '_>, level: usize, asked: Asked, volume: Volume) -> Result<Arc<Placed>> {
    let gpu = context.recorder.gpu().clone();
    let met = gpu.buffer("lpv_met", 3 * volume.cells as usize, Usage::Storage)?;
    let open = gpu.buffer("lpv_open", volume.cells as usize, Usage::Storage)?;
    blockers::record(context, &volume, &met, &open)?;
    let (prepared, kept) = (context.prepared, &mut *context.volumes);
    let asked_of = (level, asked);
    let placed =
        context.recorder.host("surface_samples", |gpu, _| kept.place(gpu, prepared, asked_of, (volume, met, open)))?;
    context.volumes.keep(level, asked, Arc::clone(&placed));
    Ok(placed)
}

/// Radiosity of every side of a sample, from points on the lights that it sees.
fn gather(context: &mut Context<'_, '_>, placed: &Placed) -> Result<Buffer<[f32; 4]>> {
    let radiosity = context.resources.buffer("lpv_radiosity", placed.count.max(1))?;
    context.recorder.clear(&radiosity)?;
    let strata = context.settings.int("lpv_rays");
    let tiles = placed.count.div_ceil(TILE_PIXELS as usize) as u32;
    let tiles_at_once = (WAVE as u32 / (TILE_PIXELS * strata)).clamp(1, tiles.max(1));
    let lists = Lists::new(context, (tiles_at_once * strata * TILE_PIXELS) as usize)?;
    for first_tile in (0..tiles).step_by(tiles_at_once as usize) {
        let wave = GatherWave {
            width: placed.count as u32,
            first_tile,
            tiles: tiles_at_once.min(tiles - first_tile),
            strata,
            strata_u: strata,
            strata_v: 1,
            lights: context.prepared.lights as u32,
            seed: context.settings.int("seed"),
            last: 1,
            ..GatherWave::zeroed()
        };
        sample_rays::record(context, &wave, &placed.points, &lists)?;
        gather_hits::record(context, &wave, &lists, false)?;
        let (tracer, count) = (context.tracer, wave.size());
        context.rays += tracer.any(context.recorder, "shadow", &lists.shadow_rays, &lists.occluded, 0..count)?;
        gather_sum::record(context, &wave, &lists.paths, &lists.occluded, &radiosity)?;
    }
    Ok(radiosity)
}
