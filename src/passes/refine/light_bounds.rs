//! Where the pixels of each tile lie as a light sees them.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::{Context, GBuffer, TILE};
use crate::scene::prepare::LIGHT_ROWS;

/// Twin of `LightBoundsParams` in `shaders/passes/refine/light_bounds.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct LightBoundsParams {
    /// Internal columns.
    pub width: u32,
    /// Internal rows.
    pub height: u32,
    /// Which light.
    pub light: u32,
    /// 1: nothing can lie between.
    pub unshadowed: u32,
}

/// A light's own affine coordinates; twin of `LightFrame` in `shaders/common/light_frame.wgsl`. With q = p − corner a
/// point has a = q · dual_u, b = q · dual_v, h = q · normal: the light is a ∈ [0, extent_a], b ∈ [0, extent_b], h = 0.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct LightFrame {
    /// Scene-space point at a = b = h = 0.
    pub corner: [f32; 3],
    /// 1 for an area light, 0 for a spot.
    pub extent_a: f32,
    /// In the light's plane; 1 along edge u, 0 along edge v.
    pub dual_u: [f32; 3],
    /// 1 for an area light, 0 for a spot.
    pub extent_b: f32,
    /// In the light's plane; 0 along edge u, 1 along edge v.
    pub dual_v: [f32; 3],
    /// 1: both sides emit.
    pub two_sided: u32,
    /// Unit normal of the lit side; a spot's axis.
    pub normal: [f32; 3],
    /// Cosine of a spot's half-angle; −2: an area light.
    pub cos_cutoff: f32,
}

impl LightFrame {
    /// Of a parallelogram.
    pub fn area(corner: Vec3, edge_u: Vec3, edge_v: Vec3, normal: Vec3, two_sided: bool) -> Self {
        let (u, v, n) = (edge_u.as_dvec3(), edge_v.as_dvec3(), normal.as_dvec3());
        let dual = |along: DVec3, across: DVec3| {
            let d = across.cross(n);
            (d / d.dot(along)).as_vec3().to_array()
        };
        Self {
            corner: corner.to_array(),
            extent_a: 1.0,
            dual_u: dual(u, v),
            extent_b: 1.0,
            dual_v: dual(v, u),
            two_sided: two_sided.into(),
            normal: normal.to_array(),
            cos_cutoff: -2.0,
        }
    }

    /// Of light `index` of the scene.
    pub fn of(context: &Context<'_, '_>, index: usize) -> Self {
        let rows = &context.prepared.light_rows[index * LIGHT_ROWS..][..LIGHT_ROWS];
        let xyz = |row: usize| Vec3::new(rows[row][0], rows[row][1], rows[row][2]);
        if index < context.prepared.area_lights {
            Self::area(xyz(0), xyz(1), xyz(2), xyz(3), rows[1][3] != 0.0)
        } else {
            Self::spot(xyz(0), xyz(3), rows[4][3])
        }
    }

    /// Of a spot: a point, in any orthonormal frame about its axis.
    pub fn spot(position: Vec3, axis: Vec3, cos_cutoff: f32) -> Self {
        let (u, v) = axis.any_orthonormal_pair();
        Self {
            corner: position.to_array(),
            extent_a: 0.0,
            dual_u: u.to_array(),
            extent_b: 0.0,
            dual_v: v.to_array(),
            two_sided: 0,
            normal: axis.to_array(),
            cos_cutoff,
        }
    }
}

/// Where the facing pixels of a tile lie in a light's frame; twin of `TileBounds` in `shaders/common/light_frame.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct TileBounds {
    /// Least a, b, h of the ray origins.
    pub lo: [f32; 3],
    /// Pixels that face the light.
    pub facing: u32,
    /// Largest a, b, h.
    pub hi: [f32; 3],
    /// Unused.
    pub pad: u32,
}

/// Bits of `tile_flags`; twins of those in `shaders/common/light_frame.wgsl`.
pub mod flags {
    /// Some pixel faces the light.
    pub const FACING: u32 = 1;
    /// Some pixel sees a surface.
    pub const SURFACE: u32 = 2;
    /// All facing pixels lie behind a two-sided light; h is given negated.
    pub const BACK: u32 = 4;
    /// Facing pixels on both sides of a two-sided light.
    pub const MIXED_SIDES: u32 = 8;
    /// Some facing pixel's horizon crosses the light.
    pub const CLIPPED: u32 = 16;
    /// Some facing pixel is nearer than five light sizes.
    pub const NEAR: u32 = 32;
    /// Some facing pixel is farther than that.
    pub const FAR: u32 = 64;
    /// Not all of its pixels face the light, but some.
    pub const PARTLY: u32 = 128;
    /// Proven: nothing lies between a facing pixel and the light.
    pub const LIT: u32 = 256;
    /// Proven: no facing pixel sees any of the light.
    pub const DARK: u32 = 512;
}

/// What is known of the tiles, for one light.
#[derive(Debug, Clone)]
pub struct Tiles {
    /// How many.
    pub count: usize,
    /// Where their facing pixels lie.
    pub bounds: Buffer<TileBounds>,
    /// See [`flags`].
    pub flags: Buffer<u32>,
}

/// Finds bounds and flags of all tiles; adds to what `pixel_lights` says of each pixel and to `facing_count`.
///
/// # Errors
/// Those of the device.
pub fn record(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    frame: &LightFrame,
    light: u32,
    pixel_lights: &Buffer<u32>,
    facing_count: &Buffer<u32>,
) -> Result<Tiles> {
    let count = context.view.tiled as usize / (TILE * TILE) as usize;
    let tiles = Tiles {
        count,
        bounds: context.resources.buffer("tile_bounds", count)?,
        flags: context.resources.buffer("tile_flags", count)?,
    };
    let unshadowed = context.settings.is("visibility", "none").into();
    let params = LightBoundsParams { width: context.view.width, height: context.view.height, light, unshadowed };
    let kernel = context.kernel("refine/light_bounds", "main")?;
    context
        .recorder
        .pass("light_bounds", &kernel)
        .uniform("params", &params)
        .uniform("frame", frame)
        .bind("g_position", &gbuffer.position)
        .bind("g_normal", &gbuffer.normal)
        .bind("g_geometric", &gbuffer.geometric)
        .bind("lights", context.scene.lights()?)
        .bind("tile_bounds", &tiles.bounds)
        .bind("tile_flags", &tiles.flags)
        .bind("pixel_lights", pixel_lights)
        .bind("facing_count", facing_count)
        .dispatch_cut(count * TILE as usize, 400.0)?;
    Ok(tiles)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_frame_of_a_skewed_light_has_unit_coordinates_at_its_corners() {
        let (corner, u, v) = (Vec3::new(1.0, 2.0, 3.0), Vec3::new(2.0, 0.0, 0.5), Vec3::new(1.0, 0.0, 3.0));
        let normal = u.cross(v).normalize();
        let frame = LightFrame::area(corner, u, v, normal, false);
        let at = |p: Vec3| {
            let q = p - corner;
            [frame.dual_u, frame.dual_v, frame.normal].map(|axis| q.dot(Vec3::from_array(axis)))
        };
        for (a, b) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.25, 0.75)] {
            let found = at(corner + a * u + b * v - 2.0 * normal);
            for (x, y) in found.into_iter().zip([a, b, -2.0]) {
                assert!((x - y).abs() < 1e-5, "{found:?} at {a}, {b}");
            }
        }
    }
}
