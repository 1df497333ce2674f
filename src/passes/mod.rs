//! The passes of a frame. One stem each: Rust here, WGSL in `shaders/passes`, numpy reference and test in
//! `tests/passes`.

pub mod arena;
pub mod composite;
pub mod gather;
pub mod gather_points;
pub mod geometry;
pub mod indirect;
pub mod lights;
pub mod lobes;
pub mod lpv;
pub mod refine;
pub mod scene_buffers;
pub mod specular;
pub mod upsample;
pub mod visibility;

use bytemuck::{Pod, Zeroable};
use glam::DVec3;

use crate::error::Result;
use crate::gpu::{Buffer, Kernel, Recorder, Resources};
use crate::scene::camera::Camera;
use crate::scene::prepare::Prepared;
use crate::settings::Settings;
use scene_buffers::SceneBuffers;
use visibility::trace::Tracer;

/// Pixels along an edge of a tile of work; twin of `TILE` in `shaders/common/tiles.wgsl`.
pub const TILE: u32 = 8;
/// Pixels of a tile.
pub const TILE_PIXELS: u32 = TILE * TILE;

/// Twin of `View` in `shaders/common/view.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct View {
    /// Eye in scene space.
    pub eye: [f32; 3],
    /// Internal columns.
    pub width: u32,
    /// Unit axis.
    pub right: [f32; 3],
    /// Internal rows.
    pub height: u32,
    /// Unit axis.
    pub up: [f32; 3],
    /// Focal length, internal pixels.
    pub fx: f32,
    /// Unit axis against the view.
    pub backward: [f32; 3],
    /// Focal length, internal pixels.
    pub fy: f32,
    /// Principal point, internal pixels.
    pub cx: f32,
    /// Principal point, internal pixels.
    pub cy: f32,
    /// Place in the tile order where a list of rays begins.
    pub first: u32,
    /// Pixels of the tiles that cover the image.
    pub tiled: u32,
}

impl View {
    /// The internal view: `camera` is already supersampled.
    pub fn new(camera: &Camera, anchor: DVec3) -> Self {
        let [right, up, backward] = camera.axes().map(|axis| axis.as_vec3().to_array());
        let tiles = camera.width.div_ceil(TILE) * camera.height.div_ceil(TILE);
        Self {
            eye: (camera.position() - anchor).as_vec3().to_array(),
            width: camera.width,
            right,
            height: camera.height,
            up,
            fx: camera.fx as f32,
            backward,
            fy: camera.fy as f32,
            cx: camera.cx as f32,
            cy: camera.cy as f32,
            first: 0,
            tiled: tiles * TILE_PIXELS,
        }
    }

    /// Internal pixels.
    pub fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }
}

/// The G-buffer: four rows of four words a pixel, see `shaders/common/gbuffer.wgsl`.
#[derive(Debug, Clone)]
pub struct GBuffer {
    /// Scene-space position and the bound of its error.
    pub position: Buffer<[u32; 4]>,
    /// Shading normal and what is seen.
    pub normal: Buffer<[u32; 4]>,
    /// Geometric normal and triangle.
    pub geometric: Buffer<[u32; 4]>,
    /// Albedo and instance.
    pub albedo: Buffer<[u32; 4]>,
}

/// What every pass of a frame can see.
pub struct Context<'f, 'a> {
    /// Where work is recorded.
    pub recorder: &'f mut Recorder<'a>,
    /// Buffers by name, kept between frames.
    pub resources: &'f mut Resources,
    /// The scene on the device.
    pub scene: &'f SceneBuffers,
    /// Answers rays.
    pub tracer: &'f Tracer,
    /// The scene on the host.
    pub prepared: &'f Prepared,
    /// What the user asked for.
    pub settings: &'f Settings,
    /// The internal camera.
    pub view: View,
    /// What light propagation volumes keep between frames.
    pub volumes: &'f mut lpv::points::Kept,
    /// Rays traced so far.
    pub rays: u64,
}

impl Context<'_, '_> {
    /// Names of the stages inside `work` start with `scope/`.
    ///
    /// # Errors
    /// Those of `work`.
    pub fn scoped<R>(&mut self, scope: &str, work: impl FnOnce(&mut Self) -> Result<R>) -> Result<R> {
        let outer = self.recorder.enter(scope);
        let result = work(self);
        self.recorder.leave(outer);
        result
    }

    /// The buffer `name` with room for `len` elements; its first `kept` stay as they are.
    ///
    /// # Errors
    /// `Device`.
    pub fn grown<T: Pod>(&mut self, name: &str, kept: usize, len: usize) -> Result<Buffer<T>> {
        let (buffer, old) = self.resources.grow(name, len)?;
        if let Some(old) = old {
            self.recorder.copy(&old, &buffer, kept.min(old.len()))?;
        }
        Ok(buffer)
    }

    /// The kernel of `shaders/passes/<stem>.wgsl`.
    ///
    /// # Errors
    /// `Shader`.
    pub fn kernel(&self, stem: &str, entry: &str) -> Result<std::sync::Arc<Kernel>> {
        self.kernel_with(stem, entry, &[])
    }

    /// The same with values of its override constants.
    ///
    /// # Errors
    /// `Shader`.
    pub fn kernel_with(&self, stem: &str, entry: &str, overrides: &[(&str, f64)]) -> Result<std::sync::Arc<Kernel>> {
        self.recorder.gpu().kernel(&format!("passes/{stem}"), entry, overrides)
    }
}
