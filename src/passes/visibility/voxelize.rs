//! The scene as voxels of the camera's view, one bit a slice [NPW10 Sec. 3.3].
//!
//! Slices are of equal depth along the view [NPW10 Fig. 2], between the nearest and the farthest thing in it. Lights
//! are not in the voxels: a sample would be hidden by its own light.

use bytemuck::{Pod, Zeroable};
use glam::{DMat4, DVec3};

use super::{voxel_blocks, voxel_depths};
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Usage};
use crate::passes::{Context, View};
use crate::scene::camera::Camera;
use crate::settings::Settings;

/// Triangles of a block; twin of `BLOCK` in `shaders/passes/visibility/voxelize.wgsl`.
const BLOCK: usize = 256;
/// Cells along an edge of a tile; twin of `TILE` there.
const TILE: u32 = 8;
/// Tiles of a batch at most, so that their number stays a small one for a dispatch.
const MOST_TILES: usize = 1 << 30;
/// Triangles of a batch at most.
const MOST_TRIANGLES: usize = 1 << 22;

/// Twin of `Voxels` in `shaders/common/voxels.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Voxels {
    /// Eye in scene space.
    pub eye: [f32; 3],
    /// Cells along x.
    pub columns: u32,
    /// Unit axis.
    pub right: [f32; 3],
    /// Cells along y.
    pub rows: u32,
    /// Unit axis.
    pub up: [f32; 3],
    /// Words of bits a cell, 32 slices each.
    pub words: u32,
    /// Unit axis against the view.
    pub backward: [f32; 3],
    /// Depth at which the first slice begins.
    pub near: f32,
    /// Cells for each unit of x/z and y/z.
    pub scale: [f32; 2],
    /// Place of the view's axis, cells from the grid's corner.
    pub center: [f32; 2],
    /// Depth at which the last slice ends.
    pub far: f32,
    /// Slices for each unit of depth.
    pub slices_per_depth: f32,
    /// Voxels between a surface and the end of a marched ray.
    pub bias: f32,
    /// Steps of a marched ray.
    pub steps: u32,
}

/// Twin of `VoxelizeParams` in `shaders/passes/visibility/voxelize.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct VoxelizeParams {
    /// First triangle of the batch, all instances counted.
    pub first: u32,
    /// Triangles of the batch.
    pub triangles: u32,
    /// Instances.
    pub instances: u32,
    /// Blocks of triangles.
    pub blocks: u32,
}

/// The voxels of a frame.
pub struct VoxelGrid {
    /// Where they are.
    pub voxels: Voxels,
    /// `words` words a cell, row by row, and behind them those of the blocks.
    pub bits: Buffer<u32>,
}

/// Cells along x and y of an image of this size, and of the margin on each side: square, so many to the longer side.
fn cells(width: u32, height: u32, settings: &Settings) -> ([u64; 2], [u64; 2]) {
    let resolution = u64::from(settings.int("voxel_resolution"));
    let (size, longer) = ([width, height].map(u64::from), u64::from(width.max(height)));
    let across = size.map(|s| (s * resolution).div_ceil(longer));
    let margin = settings.float("voxel_margin").unwrap_or(0.0);
    // More than anyone can hold is refused by `check`.
    (across, across.map(|n| (n as f64 * margin).ceil().min(1e9) as u64))
}

/// Cells and blocks that have bits.
fn places(columns: u64, rows: u64) -> u64 {
    columns.saturating_mul(rows).saturating_add(voxel_blocks::count(columns, rows))
}

/// Whether the voxels of an image of this size fit into one binding of at most `most` bytes.
///
/// # Errors
/// `Settings`.
pub fn check(settings: &Settings, camera: &Camera, most: u64) -> Result<()> {
    let (across, margin) = cells(camera.width, camera.height, settings);
    let slices = settings.int("voxel_slices");
    let [columns, rows] = [0, 1].map(|axis| across[axis] + 2 * margin[axis]);
    let bytes = places(columns, rows).saturating_mul(u64::from(slices / 8));
    if bytes <= most {
        return Ok(());
    }
    Err(Error::Settings(format!(
        "voxel_resolution={} with voxel_slices={slices} and voxel_margin={} makes {columns} x {rows} x {slices} voxels, \
         {bytes} bytes; this adapter allows {most} (max_storage_buffer_binding_size)",
        settings.int("voxel_resolution"),
        settings.float("voxel_margin").unwrap_or(0.0),
    )))
}

/// Steps of a march: none longer than two cells or so, unless the user says how many.
fn steps(settings: &Settings) -> u32 {
    match settings.int("voxel_steps") {
        0 => (settings.int("voxel_resolution") / 2).max(128),
        steps => steps,
    }
}

/// Where the voxels are; depths from `near` to `far`.
fn place(view: &View, settings: &Settings, [near, far]: [f64; 2]) -> Voxels {
    let (across, margin) = cells(view.width, view.height, settings);
    let cell = f64::from(view.width.max(view.height)) / f64::from(settings.int("voxel_resolution"));
    let [columns, rows] = [0, 1].map(|axis| (across[axis] + 2 * margin[axis]) as u32);
    let center = [(view.cx, margin[0]), (view.cy, margin[1])].map(|(c, m)| (f64::from(c) / cell + m as f64) as f32);
    let slices = settings.int("voxel_slices");
    Voxels {
        eye: view.eye,
        columns,
        right: view.right,
        rows,
        up: view.up,
        words: slices / 32,
        backward: view.backward,
        near: near as f32,
        scale: [view.fx, view.fy].map(|f| (f64::from(f) / cell) as f32),
        center,
        far: far as f32,
        slices_per_depth: (f64::from(slices) / (far - near)) as f32,
        bias: settings.float("voxel_bias").unwrap_or(0.0) as f32,
        steps: steps(settings),
    }
}

/// Depths are along the camera's own axes: right, down, and into the view.
fn eye_from_scene(voxels: &Voxels) -> DMat4 {
    let axis = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    let (right, down, depth) = (axis(voxels.right), -axis(voxels.up), -axis(voxels.backward));
    let rotate = DMat4::from_cols(right.extend(0.0), down.extend(0.0), depth.extend(0.0), glam::DVec4::W).transpose();
    rotate * DMat4::from_translation(-axis(voxels.eye))
}

/// Marks the voxels of all placed meshes.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(context: &mut Context<'_, '_>) -> Result<VoxelGrid> {
    let meshes: Vec<_> = context.prepared.placed.iter().take_while(|p| p.light.is_none()).collect();
    let mut voxels = place(&context.view, context.settings, [1.0, 2.0]);
    let depths = voxel_depths::range(&voxels, eye_from_scene(&voxels), &meshes);
    voxels = place(&context.view, context.settings, depths);
    let places = places(voxels.columns.into(), voxels.rows.into()) as usize;
    let bits = context.resources.buffer("voxel_bits", places * voxels.words as usize)?;
    context.recorder.clear(&bits)?;
    let mut first = vec![0_u32];
    for placed in &meshes {
        first.push(first.last().copied().unwrap_or(0) + placed.mesh.triangles.len() as u32);
    }
    let triangles = first.pop().unwrap_or(0) as usize;
    let instances = first.len() as u32;
    let starts = context.resources.buffer("voxel_first_triangles", first.len())?;
    starts.write(context.recorder.gpu(), 0, &first)?;
    let grid = VoxelGrid { voxels, bits };
    let tiles = (voxels.columns.div_ceil(TILE) + 1) as usize * (voxels.rows.div_ceil(TILE) + 1) as usize;
    let len = (MOST_TILES / tiles).clamp(1, MOST_TRIANGLES);
    for first in (0..triangles).step_by(len) {
        let triangles = len.min(triangles - first);
        let blocks = triangles.div_ceil(BLOCK) as u32;
        let params = VoxelizeParams { first: first as u32, triangles: triangles as u32, instances, blocks };
        batch(context, &grid, &starts, params)?;
    }
    voxel_blocks::record(context, &grid)?;
    Ok(grid)
}

fn batch(context: &mut Context<'_, '_>, grid: &VoxelGrid, starts: &Buffer<u32>, params: VoxelizeParams) -> Result<()> {
    let kernel = |entry| context.kernel("visibility/voxelize", entry);
    let (count, scan, fill) = (kernel("count")?, kernel("scan")?, kernel("fill")?);
    let before: Buffer<u32> = context.resources.buffer("voxel_tiles_before", params.triangles as usize)?;
    let totals: Buffer<u32> = context.resources.buffer("voxel_tile_totals", params.blocks as usize + 1)?;
    let arguments = context.resources.buffer_for("voxel_arguments", 4, Usage::Indirect)?;
    let scene = context.scene;
    let pass = context.recorder.pass("voxelize", &count).uniform("params", &params).uniform("voxels", &grid.voxels);
    pass.bind("geometry", scene.geometry()?)
        .bind("instances", scene.instances()?)
        .bind("first_triangles", starts)
        .bind("before", &before)
        .bind("totals", &totals)
        .bind("bits", &grid.bits)
        .dispatch_cut(params.triangles as usize, 200.0)?;
    let pass = context.recorder.pass("voxelize", &scan).uniform("params", &params);
    pass.bind("totals", &totals).bind("arguments", &arguments).dispatch_groups(1)?;
    let pass = context.recorder.pass("voxelize", &fill).uniform("params", &params).uniform("voxels", &grid.voxels);
    pass.bind("geometry", scene.geometry()?)
        .bind("instances", scene.instances()?)
        .bind("first_triangles", starts)
        .bind("before", &before)
        .bind("totals", &totals)
        .bind("bits", &grid.bits)
        .dispatch_indirect(&arguments, 0)
}
