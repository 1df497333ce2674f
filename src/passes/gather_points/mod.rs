//! A final gather at few places: points on a coarse grid of the image gather the light of their hemispheres, pixels take
//! that of the points around them as far as these hold for them, and where none does finer blocks gather for themselves,
//! down to single pixels [WRC88].

pub mod point_pixels;
pub mod point_rays;
pub mod point_smooth;
pub mod point_sums;

use bytemuck::{Pod, Zeroable};

use crate::error::{Error, Result};
use crate::gpu::{Buffer, Usage};
use crate::passes::indirect::{GatherWave, Indirect, Lists, gather_hits, waves};
use crate::passes::refine::compact;
use crate::passes::refine::pyramid::Pyramid;
use crate::passes::{Context, GBuffer, TILE_PIXELS};

/// Twin of `GatherPoint` in `shaders/common/gather_point.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct GatherPoint {
    /// Scene space.
    pub position: [f32; 3],
    /// Sum of 1 / distance to what its rays met.
    pub inverse: f32,
    /// Shading normal.
    pub normal: [f32; 3],
    /// Level of its block.
    pub level: u32,
    /// Vector irradiance.
    pub red: [f32; 3],
    /// Rays that met something.
    pub met: f32,
    /// Vector irradiance.
    pub green: [f32; 3],
    /// Unused.
    pub pad1: u32,
    /// Vector irradiance.
    pub blue: [f32; 3],
    /// Unused.
    pub pad2: u32,
    /// Gradient of the irradiance by the place, along the surface.
    pub red_slope: [f32; 3],
    /// Unused.
    pub pad3: u32,
    /// Of green.
    pub green_slope: [f32; 3],
    /// Unused.
    pub pad4: u32,
    /// Of blue.
    pub blue_slope: [f32; 3],
    /// Unused.
    pub pad5: u32,
}

/// Twin of `PointParams` in `shaders/common/gather_point.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct PointParams {
    /// Share of the harmonic mean distance that a point holds for.
    pub reach: f32,
    /// First point of the level at work.
    pub first: u32,
    /// How many they are.
    pub count: u32,
    /// Share of a pixel's neighbours that must hold for it.
    pub covered: f32,
}

/// Share of a pixel's neighbours that must hold for it, or its block gathers at a finer level.
const COVERED: f32 = 0.3;
/// The same for pixels by themselves.
const ALONE: f32 = 0.05;
/// Rays of a point at least.
const LEAST_RAYS: u32 = 8;

/// What all levels share.
pub struct Points {
    /// Levels of the blocks, at the one at work.
    pub pyramid: Pyramid,
    /// A block of any level: 0 none, else 1 + the number of its point.
    pub at: Buffer<u32>,
    /// A block of the level at work: its top bit says that it gathers, the others which of its pixels.
    pub marks: Buffer<u32>,
    /// Numbers of the blocks that gather, in order.
    pub blocks: Buffer<u32>,
    /// The points so far, level by level.
    pub points: Buffer<GatherPoint>,
    /// A pixel: sum of irradiance times weight, and of weights.
    pub sums: Buffer<[f32; 4]>,
    /// A pixel: how far the points so far hold.
    pub coverage: Buffer<f32>,
}

/// Indirect irradiance of every pixel.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(context: &mut Context<'_, '_>, gbuffer: &GBuffer) -> Result<Indirect> {
    let pyramid = Pyramid::new(&context.view, context.settings.int("gather_level"), 0);
    let (pixels, pool) = (context.view.pixels(), &mut *context.resources);
    let mut points = Points {
        at: pool.buffer("point_at", pyramid.texels())?,
        marks: pool.buffer("point_marks", pixels)?,
        blocks: pool.buffer("point_blocks", pixels)?,
        points: pool.buffer("points", 1)?,
        sums: pool.buffer("point_sums", pixels)?,
        coverage: pool.buffer("point_coverage", pixels)?,
        pyramid,
    };
    context.recorder.clear(&points.at)?;
    context.recorder.clear(&points.marks)?;
    point_pixels::begin(context, gbuffer, &points)?;
    let mut first = 0;
    for level in (0..=pyramid.coarsest).rev() {
        points.pyramid = pyramid.at(level);
        let count = listed(context, &points)?;
        if count == 0 {
            break;
        }
        check_fits(context, first as usize + count as usize)?;
        points.points = context.grown("points", first as usize, (first + count) as usize)?;
        let params =
            PointParams { reach: reach(context), first, count, covered: if level == 1 { ALONE } else { COVERED } };
        gather(context, gbuffer, &points, &params)?;
        let held = point_smooth::record(context, &points, &params)?;
        context.recorder.clear(&points.marks)?;
        point_pixels::interpolate(context, gbuffer, &points, &held, &params)?;
        first += count;
    }
    point_pixels::finish(context, gbuffer, &points)
}

fn check_fits(context: &Context<'_, '_>, count: usize) -> Result<()> {
    let (bytes, most) =
        (count * size_of::<GatherPoint>(), context.recorder.gpu().limits().max_storage_buffer_binding_size);
    if bytes as u64 <= most {
        return Ok(());
    }
    let [level, reach] = [context.settings.int("gather_level").to_string(), reach(context).to_string()];
    Err(Error::Settings(format!(
        "{count} points gather with gather_level={level} and gather_reach={reach}, {bytes} bytes in one binding; this adapter \
         allows {most} (max_storage_buffer_binding_size): larger values of either, or a smaller image, need fewer"
    )))
}

fn reach(context: &Context<'_, '_>) -> f32 {
    context.settings.float("gather_reach").unwrap_or(0.6) as f32
}

/// How many blocks of the level gather; their list.
fn listed(context: &mut Context<'_, '_>, points: &Points) -> Result<u32> {
    let blocks = points.pyramid.levels[points.pyramid.level as usize][3] as usize;
    let arguments = context.resources.buffer_for("point_arguments", 4, Usage::Indirect)?;
    let marked = 1 << 31;
    compact::record(context, "point_list", &points.marks, blocks, marked, marked, &points.blocks, &arguments)?;
    Ok(context.recorder.fetch(&[&arguments])?[0][3])
}

/// Rays of a point `below` levels from the coarsest: its noise spreads over a quarter of the pixels, and its neighbours lie
/// nearer, so that each is worth the root of two less.
fn rays_of(rays: u32, below: u32) -> u32 {
    let share = 0.5_f64.powf(f64::from(below) / 2.0);
    ((f64::from(rays) * share).round() as u32).max(LEAST_RAYS.min(rays))
}

fn gather(context: &mut Context<'_, '_>, gbuffer: &GBuffer, points: &Points, params: &PointParams) -> Result<()> {
    point_rays::begin(context, gbuffer, points, params)?;
    let rays = rays_of(context.settings.int("gather_rays"), points.pyramid.coarsest - points.pyramid.level);
    let waves = waves(context, [params.count, 1], params.count.div_ceil(TILE_PIXELS), rays);
    let lists = Lists::new(context, waves.iter().map(GatherWave::size).max().unwrap_or(0))?;
    for wave in waves {
        gather_wave(context, gbuffer, (points, params), wave, &lists)?;
    }
    Ok(())
}

fn gather_wave(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    (points, params): (&Points, &PointParams),
    mut wave: GatherWave,
    lists: &Lists,
) -> Result<()> {
    let bounces = context.settings.int("bounces");
    let count = wave.size();
    point_rays::record(context, gbuffer, (points, params), &wave, lists)?;
    for bounce in 0..bounces {
        (wave.bounce, wave.last) = (bounce, u32::from(bounce + 1 == bounces));
        context.rays += context.tracer.closest(context.recorder, "trace", &lists.rays, &lists.hits, 0..count)?;
        if bounce == 0 {
            point_sums::distances(context, (points, params), &wave, lists)?;
        }
        gather_hits::record(context, &wave, lists, true)?;
        context.rays +=
            context.tracer.any(context.recorder, "shadow", &lists.shadow_rays, &lists.occluded, 0..count)?;
        point_sums::light(context, (points, params), &wave, lists)?;
    }
    Ok(())
}
