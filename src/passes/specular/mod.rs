//! What lobes reflect of the lights, beyond the papers: the integral of lobe and light, which has no samples to be seen,
//! times the share of it that is seen.

pub mod lobe_integral;
pub mod lobe_ratio;
pub mod lobe_rays;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::error::Result;
use crate::gpu::{Buffer, Usage};
use crate::passes::lights::light_samples;
use crate::passes::refine::compact;
use crate::passes::{Context, GBuffer};
use crate::scene::prepare::{LIGHT_ROWS, RADIANCE_ROW};

/// Rays that are made and answered at once.
const RAYS: usize = 1 << 20;
/// Samples of a patch along each axis: at first, and where those disagree.
const FEW: u32 = 6;
const MANY: u32 = 20;
/// The same with fewer than 64 `light_samples`.
const THRIFTY: u32 = 12;

/// What is left of a lobe where it is no longer integrated.
const LEAST: f32 = 1e-4;

/// Twin of `LobeLight` in `shaders/common/lobe_patch.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct LobeLight {
    /// Scene space.
    pub corner: [f32; 3],
    /// 1: both sides emit.
    pub two_sided: u32,
    /// From a = 0 to a = 1.
    pub edge_u: [f32; 3],
    /// Of the parallelogram.
    pub area: f32,
    /// From b = 0 to b = 1.
    pub edge_v: [f32; 3],
    /// Its number in the lights' table.
    pub light: u32,
    /// Of the lit side.
    pub normal: [f32; 3],
    /// The user's seed.
    pub seed: u32,
    /// In the plane: a of a point is its product with this.
    pub dual_u: [f32; 3],
    /// Columns of its picture; 0: one radiance.
    pub columns: u32,
    /// The same for b.
    pub dual_v: [f32; 3],
    /// Rows of its picture.
    pub rows: u32,
    /// Mean radiance.
    pub radiance: [f32; 3],
    /// Samples along each axis of a patch.
    pub side: u32,
    /// What is left of the lobe at the border of its patch.
    pub least: f32,
    /// Unused.
    pub pad0: u32,
    /// Unused.
    pub pad1: u32,
    /// Unused.
    pub pad2: u32,
}

impl LobeLight {
    pub(crate) fn of(context: &Context<'_, '_>, light: usize) -> Self {
        let rows = &context.prepared.light_rows[light * LIGHT_ROWS..][..LIGHT_ROWS];
        let [corner, u, v] = light_samples::edges(context, light).map(Vec3::from);
        let xyz = |row: [f32; 4]| Vec3::new(row[0], row[1], row[2]);
        let normal = xyz(rows[3]);
        // Dual edges in float64: slim lights have nearly parallel ones.
        let [u64_, v64, n64] = [u, v, normal].map(|x| x.as_dvec3());
        let (across_v, across_u) = (v64.cross(n64), n64.cross(u64_));
        let dual_u = (across_v / u64_.dot(across_v)).as_vec3();
        let dual_v = (across_u / v64.dot(across_u)).as_vec3();
        let texture = context.prepared.light_textures.get(&light);
        let few = context.settings.int("light_samples") < 64;
        Self {
            corner: corner.to_array(),
            two_sided: u32::from(rows[1][3] != 0.0),
            edge_u: u.to_array(),
            area: rows[3][3],
            edge_v: v.to_array(),
            light: light as u32,
            normal: normal.to_array(),
            seed: context.settings.int("seed"),
            dual_u: dual_u.to_array(),
            columns: texture.map_or(0, |t| t.width),
            dual_v: dual_v.to_array(),
            rows: texture.map_or(0, |t| t.height),
            radiance: xyz(rows[RADIANCE_ROW]).to_array(),
            side: if few { THRIFTY } else { MANY },
            least: LEAST,
            pad0: 0,
            pad1: 0,
            pad2: 0,
        }
    }

    /// Whether it emits a picture.
    pub fn picture(&self) -> bool {
        self.columns > 0
    }
}

/// Adds what lobes reflect of all area lights; `tiles`: for each light what is proven of the tiles of the image, if it was
/// asked.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    tiles: &[Option<Buffer<u32>>],
    specular: &Buffer<[f32; 4]>,
) -> Result<()> {
    let pixels = context.view.pixels();
    let surface: Buffer<[f32; 4]> = context.resources.buffer("lobe_surface", pixels)?;
    let lit: Buffer<[f32; 4]> = context.resources.buffer("lobe_light", pixels)?;
    lobe_integral::surfaces(context, gbuffer, &surface)?;
    for light in 0..context.prepared.area_lights {
        let source = LobeLight::of(context, light);
        if source.radiance == [0.0; 3] {
            continue;
        }
        lobe_integral::record(context, gbuffer, &source, &surface, &lit)?;
        let share = match context.settings.is("visibility", "none") {
            true => None,
            false => Some(ask(context, gbuffer, &source, [&surface, &lit], tiles.get(light).and_then(Option::as_ref))?),
        };
        lobe_ratio::record(context, gbuffer, &source, [&surface, &lit], share.as_ref(), specular)?;
    }
    Ok(())
}

/// The share of the light that each pixel's lobe sees: by a few samples, and where these disagree by many.
fn ask(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    source: &LobeLight,
    [surface, lit]: [&Buffer<[f32; 4]>; 2],
    tiles: Option<&Buffer<u32>>,
) -> Result<Buffer<[f32; 4]>> {
    let places = context.view.tiled as usize;
    let share = context.resources.buffer("lobe_share", context.view.pixels())?;
    let flags: Buffer<u32> = context.resources.buffer("lobe_flags", places)?;
    lobe_rays::flags(context, lit, tiles, &flags, &share)?;
    let first = LobeLight { side: FEW, ..*source };
    trace(context, gbuffer, &first, surface, &flags, &share)?;
    lobe_rays::again(context, &flags, &share)?;
    trace(context, gbuffer, source, surface, &flags, &share)?;
    Ok(share)
}

/// Asks for the pixels whose places are flagged.
fn trace(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    source: &LobeLight,
    surface: &Buffer<[f32; 4]>,
    flags: &Buffer<u32>,
    share: &Buffer<[f32; 4]>,
) -> Result<()> {
    let places = context.view.tiled as usize;
    let list: Buffer<u32> = context.resources.buffer("lobe_list", places)?;
    let arguments = context.resources.buffer_for("lobe_arguments", 4, Usage::Indirect)?;
    compact::record(context, "lobe_list", flags, places, 1, 1, &list, &arguments)?;
    let count = context.recorder.fetch(&[&arguments])?[0][3] as usize;
    let samples = (source.side * source.side) as usize;
    // Parts of the list are bound, which begin at multiples of 64 entries.
    let len = (RAYS / samples / 64 * 64).min(count.next_multiple_of(64)).max(64);
    let rays = context.resources.buffer("lobe_rays", len * samples)?;
    let weights = context.resources.buffer("lobe_weights", len * samples)?;
    let occluded: Buffer<u32> = context.resources.buffer("lobe_occluded", len * samples / 32)?;
    for first in (0..count).step_by(len) {
        let piece = Piece { source, surface, list: &list, first, count: (count - first).min(len) };
        lobe_rays::record(context, gbuffer, &piece, &rays, &weights)?;
        let range = 0..piece.count * samples;
        context.rays += context.tracer.any(context.recorder, "lobe_trace", &rays, &occluded, range)?;
        lobe_ratio::shares(context, &piece, &occluded, &weights, share)?;
    }
    Ok(())
}

/// A part of a list of pixels that ask about a light.
pub struct Piece<'p> {
    /// The light.
    pub source: &'p LobeLight,
    /// Reflectance and exponent a pixel.
    pub surface: &'p Buffer<[f32; 4]>,
    /// Places in the tile order.
    pub list: &'p Buffer<u32>,
    /// First entry.
    pub first: usize,
    /// Entries.
    pub count: usize,
}
