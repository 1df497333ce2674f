//! Sample points of each light and what they stand for.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::error::Result;
use crate::gpu::{Buffer, Slice};
use crate::passes::Context;
use crate::passes::visibility::shadow::ShadowLight;
use crate::scene::material::Texture;
use crate::scene::prepare::{LIGHT_ROWS, strata_grid};

/// Sets of jittered points; a pixel uses one by its hash. Enough that neighbours rarely share one, few enough that a
/// light's table stays in a cache.
const PATTERNS: u32 = 64;
/// A shadow ray ends just short of its sample, whose own rounding moves its surface (N5).
const T_MAX: f32 = 0.9999;

/// Twin of `LightSamplesParams` in `shaders/passes/lights/light_samples.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct LightSamplesParams {
    /// Which light.
    pub light: u32,
    /// Strata along edge u.
    pub strata_u: u32,
    /// Strata along edge v.
    pub strata_v: u32,
    /// Sets of points.
    pub patterns: u32,
    /// The user's seed.
    pub seed: u32,
    /// 0: the middle of each stratum.
    pub jittered: u32,
    /// Written as the points' fourth number.
    pub t_max: f32,
    /// Sets that samples are dealt to: 1 or 4.
    pub classes: u32,
}

/// The samples of one light.
#[derive(Debug, Clone)]
pub struct LightSamples {
    /// Which light.
    pub light: u32,
    /// Samples a pattern; of an interleaved light, of each of its sets.
    pub strata: u32,
    /// Strata along edge u.
    pub strata_u: u32,
    /// Interleaved sets, one after the other in each pattern: 1 or 4; 1 of a spot.
    pub classes: u32,
    /// Sets of points.
    pub patterns: u32,
    /// patterns × strata points, fourth number the largest t of a ray to it.
    pub points: Buffer<[f32; 4]>,
    /// For each stratum its mean radiance times its area.
    pub radiance: Buffer<[f32; 4]>,
    /// Of the lit side, or a spot's axis.
    pub normal: Vec3,
    /// Lit from both sides; true for spots.
    pub two_sided: bool,
    /// Cosine of a spot's half-angle, −2 for area lights.
    pub cos_cutoff: f32,
    /// Two bits for each of 16 blocks of strata: 0 it is dim, 1 as bright as most, 2 bright.
    pub boosts: u32,
}

impl LightSamples {
    /// An area light, not a spot.
    pub fn is_area(&self) -> bool {
        self.cos_cutoff < -1.0
    }

    /// How far apart in a set two samples are that lie above each other on the light: a row, or one of a 4 x 4 block.
    pub fn row(&self) -> u32 {
        let in_blocks = self.strata_u.is_multiple_of(4) && (self.strata / self.strata_u).is_multiple_of(4);
        match (self.classes, in_blocks) {
            (1, true) => 4,
            (1, false) => self.strata_u,
            _ => self.strata_u / 2,
        }
    }

    /// As shadow rays see it.
    pub fn shadow_light(&self) -> ShadowLight<'_> {
        ShadowLight {
            points: &self.points,
            strata: self.strata,
            light_normal: self.normal.to_array(),
            two_sided: self.two_sided,
            cone_axis: self.normal.to_array(),
            cos_cutoff: self.cos_cutoff,
        }
    }
}

/// How many sets of points a pattern setting needs.
pub fn patterns(context: &Context<'_, '_>) -> u32 {
    if context.settings.is("light_pattern", "jittered") { PATTERNS } else { 1 }
}

/// Samples every light.
///
/// # Errors
/// Those of the device.
pub fn record(context: &mut Context<'_, '_>) -> Result<Vec<LightSamples>> {
    interleaved(context, 1)
}

/// Samples every light; those of area lights are dealt to `classes` (1 or 4) sets, one of each 2 x 2 strata to each set
/// [KH01].
///
/// # Errors
/// Those of the device.
pub fn interleaved(context: &mut Context<'_, '_>, classes: u32) -> Result<Vec<LightSamples>> {
    let prepared = context.prepared;
    let side = if classes > 1 { 2 } else { 1 };
    (0..prepared.lights)
        .map(|light| {
            if light >= prepared.area_lights {
                return spot(context, light, classes);
            }
            let [length_u, length_v] = lengths(context, light);
            let of_a_set = context.settings.int("light_samples") / classes;
            let grid = strata_grid(of_a_set, length_u, length_v).map(|along| side * along);
            area(context, light, grid, classes)
        })
        .collect()
}

/// Corner and edges of a light; of a spot only its position means anything.
pub fn edges(context: &Context<'_, '_>, light: usize) -> [[f32; 3]; 3] {
    let rows = rows(context, light);
    [0, 1, 2].map(|row| xyz(rows[row]).to_array())
}

/// Lengths of a light's edges.
pub fn lengths(context: &Context<'_, '_>, light: usize) -> [f64; 2] {
    let [_, edge_u, edge_v] = edges(context, light).map(Vec3::from);
    [edge_u, edge_v].map(|edge| f64::from(edge.length()))
}

/// A light with 256 samples a pattern in 16 blocks of 4 × 4, as `shaders/common/strata.wgsl` wants them.
///
/// # Errors
/// Those of the device.
pub fn blocks(context: &mut Context<'_, '_>, light: usize) -> Result<LightSamples> {
    if light >= context.prepared.area_lights {
        return spot(context, light, 1);
    }
    let [length_u, length_v] = lengths(context, light);
    let [blocks_u, blocks_v] = strata_grid(16, length_u, length_v);
    let mut samples = area(context, light, [4 * blocks_u, 4 * blocks_v], 1)?;
    if let Some(texture) = context.prepared.light_textures.get(&light) {
        samples.boosts = boosts(texture, [blocks_u, blocks_v]);
    }
    Ok(samples)
}

/// [`LightSamples::boosts`] of a light of one colour.
const AS_MOST: u32 = 0x5555_5555;
/// Mean radiance of a block over the light's from which on it is bright, and up to which it is dim.
const BRIGHT: f32 = 1.5;
const DIM: f32 = 0.4;
/// Texels that are looked at along each edge of a block.
const PROBES: usize = 16;

/// Which blocks of a picture are bright.
fn boosts(texture: &Texture, [blocks_u, blocks_v]: [u32; 2]) -> u32 {
    let across = [blocks_u as usize * PROBES, blocks_v as usize * PROBES];
    let (width, height) = (texture.width as usize, texture.height as usize);
    let mut sums = [0.0_f32; 16];
    for row in 0..across[1] {
        for column in 0..across[0] {
            let x = (2 * column + 1) * width / (2 * across[0]);
            // Row 0 of the picture lies at b = 1.
            let y = height - 1 - (2 * row + 1) * height / (2 * across[1]);
            let texel = texture.texels[y * width + x];
            sums[row / PROBES * blocks_u as usize + column / PROBES] += texel[0] + texel[1] + texel[2];
        }
    }
    let mean = sums.iter().sum::<f32>() / 16.0;
    let boost = |sum: f32| 1 + u32::from(sum > BRIGHT * mean) - u32::from(sum < DIM * mean);
    sums.iter().enumerate().fold(0, |all, (block, &sum)| all | boost(sum) << (2 * block))
}

fn parameters(context: &Context<'_, '_>, light: usize, grid: [u32; 2], classes: u32) -> LightSamplesParams {
    let patterns = patterns(context);
    LightSamplesParams {
        light: light as u32,
        strata_u: grid[0],
        strata_v: grid[1],
        patterns,
        seed: context.settings.int("seed"),
        jittered: u32::from(patterns > 1),
        t_max: T_MAX,
        classes,
    }
}

/// Mean radiance times area of each stratum.
fn radiance(context: &mut Context<'_, '_>, params: &LightSamplesParams, to: Slice<'_>) -> Result<()> {
    let kernel = context.kernel("lights/light_samples", "radiance")?;
    let lights = context.scene.lights()?;
    let pass = context.recorder.pass("light_samples", &kernel).uniform("params", params);
    pass.bind("lights", lights).bind("light_radiance", to).dispatch_groups((params.strata_u * params.strata_v) as usize)
}

/// Mean radiance times area of each of `across` x `across` equal parts of an area light; in the order of its strata.
///
/// # Errors
/// Those of the device.
pub fn parts(context: &mut Context<'_, '_>, light: usize, across: u32, to: Slice<'_>) -> Result<()> {
    let params = parameters(context, light, [across; 2], 1);
    radiance(context, &params, to)
}

/// The rows of a light's table.
pub(super) fn rows<'p>(context: &Context<'p, '_>, light: usize) -> &'p [[f32; 4]] {
    &context.prepared.light_rows[light * LIGHT_ROWS..][..LIGHT_ROWS]
}

/// A row without its fourth number.
pub(super) fn xyz(row: [f32; 4]) -> Vec3 {
    Vec3::new(row[0], row[1], row[2])
}

fn area(context: &mut Context<'_, '_>, light: usize, grid: [u32; 2], classes: u32) -> Result<LightSamples> {
    let rows = rows(context, light);
    let params = parameters(context, light, grid, classes);
    let (strata, patterns) = (grid[0] * grid[1], params.patterns);
    let count = (patterns * strata) as usize;
    let points = context.resources.buffer(&format!("light_points/{light}"), count)?;
    let to = context.resources.buffer(&format!("light_radiance/{light}"), strata as usize)?;
    let kernel = context.kernel("lights/light_samples", "points")?;
    let lights = context.scene.lights()?;
    let pass = context.recorder.pass("light_samples", &kernel).uniform("params", &params);
    pass.bind("lights", lights).bind("light_points", &points).dispatch(count)?;
    radiance(context, &params, (&to).into())?;
    Ok(LightSamples {
        light: light as u32,
        strata: strata / classes,
        strata_u: grid[0],
        classes,
        patterns: patterns * classes,
        points,
        radiance: to,
        normal: xyz(rows[3]),
        two_sided: rows[1][3] != 0.0,
        cos_cutoff: -2.0,
        boosts: AS_MOST,
    })
}

/// A spot is one point in every pattern.
fn spot(context: &mut Context<'_, '_>, light: usize, classes: u32) -> Result<LightSamples> {
    let rows = rows(context, light);
    let patterns = patterns(context) * classes;
    let points = context.resources.buffer(&format!("light_points/{light}"), patterns as usize)?;
    let radiance = context.resources.buffer(&format!("light_radiance/{light}"), 1)?;
    let gpu = context.recorder.gpu();
    points.write(gpu, 0, &vec![xyz(rows[0]).extend(T_MAX).to_array(); patterns as usize])?;
    radiance.write(gpu, 0, &[xyz(rows[4]).extend(0.0).to_array()])?;
    Ok(LightSamples {
        light: light as u32,
        strata: 1,
        strata_u: 1,
        classes: 1,
        patterns,
        points,
        radiance,
        normal: xyz(rows[3]),
        two_sided: true,
        cos_cutoff: rows[4][3],
        boosts: AS_MOST,
    })
}
