//! Rays are lists: one pass writes them, the trace answers, the next pass reads the answers.

pub mod trace;
pub mod trace_native;

use bytemuck::{Pod, Zeroable};

/// A ray; twin of `Ray` in `shaders/common/ray.wgsl`. `t_max <= t_min`: inactive, answered as a miss.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Ray {
    /// Scene space.
    pub origin: [f32; 3],
    /// Hits lie beyond it.
    pub t_min: f32,
    /// Of any length.
    pub direction: [f32; 3],
    /// Hits lie before it.
    pub t_max: f32,
}

/// The nearest hit of a ray; twin of `Hit` in `shaders/common/ray.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Hit {
    /// In units of the ray's direction.
    pub t: f32,
    /// Barycentric weight of the second vertex.
    pub u: f32,
    /// Barycentric weight of the third vertex.
    pub v: f32,
    /// Which placed mesh; `u32::MAX`: nothing was hit.
    pub instance: u32,
    /// Which of its kept triangles.
    pub triangle: u32,
}

/// A shading point that asks which samples of a light it sees; twin of `Receiver` in `shaders/common/ray.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Receiver {
    /// Already off its surface.
    pub origin: [f32; 3],
    /// Which set of sample points; `u32::MAX`: inactive.
    pub pattern: u32,
    /// Turned to the viewer.
    pub normal_geo: [f32; 3],
    /// Unused.
    pub flags: u32,
    /// Turned to the viewer.
    pub normal_shade: [f32; 3],
    /// Whose irradiance it is.
    pub pixel: u32,
}
