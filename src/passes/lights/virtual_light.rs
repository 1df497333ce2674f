//! What the passes of virtual lights share: reflective shadow maps, virtual lights, their tree.

use bytemuck::{Pod, Zeroable};

use crate::gpu::Buffer;

/// Rows of a texel; twin of `RSM_ROWS` in `shaders/common/rsm.wgsl`.
pub const RSM_ROWS: usize = 3;

/// Twin of `RsmMap` in `shaders/common/rsm.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct RsmMap {
    /// A spot's position; an area light's corner.
    pub origin: [f32; 3],
    /// 0 spot, 1 area light.
    pub kind: u32,
    /// Unit: what the map looks along.
    pub axis: [f32; 3],
    /// Spot: half of the frustum's width at distance 1.
    pub tan_half: f32,
    /// Area light.
    pub edge_u: [f32; 3],
    /// Spot: cosine of the cone's half-angle.
    pub cos_cutoff: f32,
    /// Area light.
    pub edge_v: [f32; 3],
    /// How far off the light rays start.
    pub offset: f32,
    /// Hemispheres along an edge of an area light's map; spot: 1.
    pub tiles: u32,
    /// Texels along an edge of the map.
    pub resolution: u32,
    /// Spot: solid angle that every texel is given; 0: each its own.
    pub equal: f32,
    /// Its number.
    pub map: u32,
}

/// Twin of `VirtualLight` in `shaders/common/virtual_light.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct VirtualLight {
    /// Mean by flux.
    pub position: [f32; 3],
    /// Of the surfaces that it stands for.
    pub area: f32,
    /// Mean by flux of unit normals: 1 long where they are all one.
    pub normal: [f32; 3],
    /// Of a ball about the position that holds them.
    pub radius: f32,
    /// Reflected, W.
    pub flux: [f32; 3],
    /// As the light sees it.
    pub solid_angle: f32,
    /// Largest difference of a normal from the mean.
    pub spread: f32,
    /// Largest distance to the mean plane.
    pub thickness: f32,
    /// First column and row, 16 bits each.
    pub block: u32,
    /// Texels along an edge and number of the map, 16 bits each.
    pub extent: u32,
}

/// The reflective shadow maps of all lights.
#[derive(Debug, Clone)]
pub struct Rsm {
    /// Out of which lights they look.
    pub maps: Vec<RsmMap>,
    /// The same on the device.
    pub table: Buffer<RsmMap>,
    /// Texels along an edge of each.
    pub resolution: u32,
    /// [`RSM_ROWS`] rows a texel, map by map.
    pub texels: Buffer<[f32; 4]>,
}

impl Rsm {
    /// Level of the tree whose nodes are texels.
    pub fn finest(&self) -> u32 {
        self.resolution.trailing_zeros()
    }
}

/// All virtual lights from texels up to whole maps; laid out as `shaders/common/virtual_light.wgsl` says.
#[derive(Debug, Clone)]
pub struct Tree {
    /// Nodes.
    pub nodes: Buffer<VirtualLight>,
    /// Two rows a node: xyz least normal, w least distance from the light | xyz largest normal, w largest distance, of
    /// texels with flux; that distance is `RSM_FAR` where one of its texels lies in the light and sees no surface.
    pub ranges: Buffer<[f32; 4]>,
}

/// Nodes of all levels above `level`, and of none below.
pub fn level_first(level: u32, maps: usize) -> usize {
    ((1_usize << (2 * level)) - 1) / 3 * maps
}

/// Virtual lights that all light every fragment.
#[derive(Debug, Clone)]
pub struct VirtualLights {
    /// The packed list [NSW09 Sec. 3.2.2].
    pub lights: Buffer<VirtualLight>,
    /// How many there are.
    pub count: usize,
}
