//! The exact unshadowed irradiance of a light times the share of it that each pixel sees.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::textured_share::{self, Table};
use crate::error::Result;
use crate::gpu::{Buffer, Pass, Usage};
use crate::passes::{Context, GBuffer, TILE_PIXELS};
use crate::scene::prepare::LIGHT_ROWS;

/// Lists of tiles, each by the form of the integral that it needs: whole near, whole far, cut near, several.
const KINDS: usize = 4;
/// Entries behind each list that name no tile; twin of `MOST_ROWS` in `shaders/common/light_pixel.wgsl`.
const MOST_ROWS: usize = 64;
/// The kind of tiles that are far from the light.
const WHOLE_FAR: usize = 1;

/// Twin of `IrradianceParams` in `shaders/common/light_pixel.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct IrradianceParams {
    /// Scene-space corner of the light, or a spot's position.
    pub corner: [f32; 3],
    /// Columns of the image.
    pub width: u32,
    /// Unit, along edge u.
    pub axis_x: [f32; 3],
    /// Rows of the image.
    pub height: u32,
    /// Unit, in the light's plane.
    pub axis_y: [f32; 3],
    /// 1: both sides emit.
    pub two_sided: u32,
    /// Unit normal of the lit side, or a spot's axis.
    pub axis_z: [f32; 3],
    /// Tiles of the image.
    pub tiles: u32,
    /// Mean radiance, or a spot's intensity.
    pub radiance: [f32; 3],
    /// 1: `share` holds a factor wherever the light is seen.
    pub textured: u32,
    /// Edges in sizes: u = (x, 0), v = (y, z), |v| = w.
    pub edge: [f32; 4],
    /// Direction of edge v in the light's plane.
    pub along_v: [f32; 2],
    /// Length of the longer edge, scene units; 1 for a spot.
    pub size: f32,
    /// Cosine of a spot's half-angle; −2 for an area light.
    pub cos_cutoff: f32,
    /// Which list of tiles.
    pub kind: u32,
    /// First node of a textured light's table.
    pub first_node: u32,
    /// How many of them.
    pub nodes: u32,
    /// Unused.
    pub pad: u32,
}

/// What one light adds, and to what.
pub struct IrradianceWork<'w> {
    /// Which light.
    pub light: u32,
    /// Surfaces.
    pub gbuffer: &'w GBuffer,
    /// A word a tile; see `refine::light_bounds::flags`.
    pub tile_flags: &'w Buffer<u32>,
    /// A word a 2 × 2 cell in image order, bits 0–1: 0 nothing to light, 1 lit, 2 dark, 3 in the zone of penumbra.
    pub cell_state: &'w Buffer<u32>,
    /// A pixel each, image order; read in the zone, where it is relative to what the light would add unshadowed. For a
    /// textured light it is overwritten.
    pub share: &'w Buffer<[f32; 4]>,
    /// In image order; added to.
    pub irradiance: &'w Buffer<[f32; 4]>,
}

fn xyz(row: [f32; 4]) -> Vec3 {
    Vec3::new(row[0], row[1], row[2])
}

impl IrradianceParams {
    /// From a light's rows of the table, see `shaders/common/light.wgsl`.
    fn new(context: &Context<'_, '_>, light: u32) -> Self {
        let rows = &context.prepared.light_rows[light as usize * LIGHT_ROWS..][..LIGHT_ROWS];
        let is_spot = light as usize >= context.prepared.area_lights;
        let (u, v) = (xyz(rows[1]).as_dvec3(), xyz(rows[2]).as_dvec3());
        let mut made = Self {
            corner: xyz(rows[0]).to_array(),
            width: context.view.width,
            height: context.view.height,
            axis_z: xyz(rows[3]).to_array(),
            tiles: context.view.tiled / TILE_PIXELS,
            radiance: xyz(rows[4]).to_array(),
            ..Self::zeroed()
        };
        if is_spot {
            let (x, y) = xyz(rows[3]).any_orthonormal_pair();
            (made.axis_x, made.axis_y) = (x.to_array(), y.to_array());
            (made.size, made.cos_cutoff, made.two_sided) = (1.0, rows[4][3], 1);
            return made;
        }
        let normal = u.cross(v).normalize();
        let (x, size) = (u.normalize(), u.length().max(v.length()));
        let y = normal.cross(x);
        made.axis_x = x.as_vec3().to_array();
        made.axis_y = y.as_vec3().to_array();
        made.axis_z = normal.as_vec3().to_array();
        made.edge = [u.length(), v.dot(x), v.dot(y), v.length()].map(|l| (l / size) as f32);
        made.along_v = [v.dot(x), v.dot(y)].map(|l| (l / v.length()) as f32);
        (made.size, made.cos_cutoff) = (size as f32, -2.0);
        made.two_sided = u32::from(rows[1][3] != 0.0);
        made.textured = u32::from(rows[5][0] != 0.0);
        made
    }
}

/// Tiles that face the light, sorted by what they need.
pub(super) struct Lists {
    tiles: Buffer<u32>,
    /// Four words a kind: groups of one tile along x, y, z, and the number of tiles; then the same for groups of four.
    arguments: Buffer<u32>,
}

/// Adds the irradiance of one light to each pixel that sees some of it.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(context: &mut Context<'_, '_>, work: &IrradianceWork<'_>) -> Result<()> {
    let mut params = IrradianceParams::new(context, work.light);
    let lists = sort(context, work, &params)?;
    if params.cos_cutoff > -1.5 {
        return add(context, work, &params, &lists, "spot");
    }
    let table = if params.textured != 0 { Some(textured_share::record(context, &params, work.light)?) } else { None };
    for (kind, entry) in ["near", "far", "clipped", "any_kind"].into_iter().enumerate() {
        params.kind = kind as u32;
        if let Some(table) = &table {
            factor(context, work, &mut params, &lists, table)?;
        }
        add(context, work, &params, &lists, entry)?;
    }
    Ok(())
}

fn sort(context: &mut Context<'_, '_>, work: &IrradianceWork<'_>, params: &IrradianceParams) -> Result<Lists> {
    let lists = Lists {
        tiles: context.resources.buffer("tiles_by_kind", KINDS * (params.tiles as usize + MOST_ROWS))?,
        arguments: context.resources.buffer_for("tile_arguments", 8 * KINDS, Usage::Indirect)?,
    };
    let kernel = context.kernel("gather/irradiance", "sort")?;
    let pass = context.recorder.pass("irradiance", &kernel).uniform("params", params);
    pass.bind("tile_flags", work.tile_flags)
        .bind("tile_lists", &lists.tiles)
        .bind("arguments", &lists.arguments)
        .dispatch_groups(1)?;
    Ok(lists)
}

/// The bindings of `shaders/common/light_pixel.wgsl`.
fn bound<'r, 'a>(
    pass: Pass<'r, 'a>,
    work: &'r IrradianceWork<'_>,
    params: &IrradianceParams,
    lists: &'r Lists,
) -> Pass<'r, 'a> {
    pass.uniform("params", params)
        .bind("g_position", &work.gbuffer.position)
        .bind("g_normal", &work.gbuffer.normal)
        .bind("g_geometric", &work.gbuffer.geometric)
        .bind("tile_flags", work.tile_flags)
        .bind("cell_state", work.cell_state)
        .bind("tile_list", &lists.tiles)
}

fn add(
    context: &mut Context<'_, '_>,
    work: &IrradianceWork<'_>,
    params: &IrradianceParams,
    lists: &Lists,
    entry: &str,
) -> Result<()> {
    let kernel = context.kernel("gather/irradiance", entry)?;
    let pass = context.recorder.pass("irradiance", &kernel);
    bound(pass, work, params, lists)
        .bind("share", work.share)
        .bind("direct_irradiance", work.irradiance)
        .dispatch_indirect(&lists.arguments, 4 * params.kind as usize)
}

fn factor(
    context: &mut Context<'_, '_>,
    work: &IrradianceWork<'_>,
    params: &mut IrradianceParams,
    lists: &Lists,
    table: &Table,
) -> Result<()> {
    (params.first_node, params.nodes) = table.range(params.kind as usize == WHOLE_FAR);
    let kernel = context.kernel("gather/textured_share", "factor")?;
    let pass = context.recorder.pass("textured_share", &kernel);
    bound(pass, work, params, lists)
        .bind("light_nodes", &table.nodes)
        .bind("share", work.share)
        .dispatch_indirect(&lists.arguments, 4 * (KINDS + params.kind as usize))
}
