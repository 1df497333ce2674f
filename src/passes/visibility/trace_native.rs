//! The native form of `trace`: any-hit and closest-hit rays on all cores, in SIMD packets.
//!
//! Answers do not depend on the instruction set, the number of threads or the neighbours of a ray: a ray meets a
//! triangle by one fixed sequence of roundings [WBW13], boxes are entered with a margin that covers those roundings
//! [Ize13], and a tie in `t` goes to the smaller instance, then to the smaller triangle.
//!
//! Rules
//! - A hit counts when `t_min < t < t_max`, both ends open; both sides of a triangle count.
//! - A ray with a NaN or infinite origin or direction, a zero direction or `t_min >= t_max` answers a miss.
//! - Inside one mesh nothing leaks through an edge or a vertex: the edge test is exact in sign (see `native::triangle`).
//! - A ray enters an instance as `M (o - c)`, with `M` the linear part of `object_from_scene` and `c` the translation
//!   of `scene_from_object`: the rounding is relative to the distance from the object, not from the scene's middle.
use super::native::{dispatch, instance::Placed};
use crate::scene::bvh::{Blas, Bounds, Tlas};
use bytemuck::{Pod, Zeroable};
use glam::{Affine3A, DMat3, Mat3A};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A ray in scene space; the direction need not be unit.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Ray {
    /// Start.
    pub origin: [f32; 3],
    /// Hits at this `t` or before do not count.
    pub t_min: f32,
    /// Direction; its length is the unit of `t`.
    pub direction: [f32; 3],
    /// Hits at this `t` or behind do not count; below `t_min`: an inactive ray.
    pub t_max: f32,
}

/// What a ray meets first.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Hit {
    /// Position along the ray; `f32::INFINITY` for a miss.
    pub t: f32,
    /// Weight of vertex 1.
    pub u: f32,
    /// Weight of vertex 2: p = (1 - u - v) p0 + u p1 + v p2.
    pub v: f32,
    /// Instance; `u32::MAX` for a miss.
    pub instance: u32,
    /// Triangle of its mesh; `u32::MAX` for a miss.
    pub triangle: u32,
}

impl Hit {
    /// Nothing was met.
    pub const MISS: Self = Self { t: f32::INFINITY, u: 0.0, v: 0.0, instance: u32::MAX, triangle: u32::MAX };

    /// True when something was met.
    pub fn is_hit(&self) -> bool {
        self.instance != u32::MAX
    }
}

/// One shading point that asks which samples of one light it sees: 48 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Receiver {
    /// Start of its rays, already offset off the surface.
    pub origin: [f32; 3],
    /// Row of the sample table; `u32::MAX`: inactive.
    pub pattern: u32,
    /// Geometric normal.
    pub normal_geo: [f32; 3],
    /// Free for the caller.
    pub flags: u32,
    /// Shading normal.
    pub normal_shade: [f32; 3],
    /// Free for the caller.
    pub pixel: u32,
}

/// Sample positions of one light.
#[derive(Clone, Copy, Debug)]
pub struct SampleTable<'a> {
    /// Patterns × strata: a scene-space point on the light, and the largest `t` (just under 1).
    pub points: &'a [[f32; 4]],
    /// Samples of a pattern.
    pub strata: u32,
    /// Unit normal of the light.
    pub light_normal: [f32; 3],
    /// Both sides emit; also true for spots.
    pub two_sided: bool,
    /// Unit axis of the cone, from the light into the scene.
    pub cone_axis: [f32; 3],
    /// Cosine of the cone's half-angle; -2: no cone.
    pub cos_cutoff: f32,
}

impl SampleTable<'_> {
    /// Words of visibility bits that a receiver has.
    pub fn words(&self) -> usize {
        (self.strata as usize).div_ceil(32)
    }
}

/// A mesh placed in the scene.
#[derive(Clone, Debug)]
pub struct TraceInstance {
    /// Its linear part takes directions and offsets into object space.
    pub object_from_scene: Affine3A,
    /// Its translation is the object's origin in scene space; it also places the boxes of the top level.
    pub scene_from_object: Affine3A,
    /// Triangles in object space.
    pub blas: Arc<Blas>,
}

impl TraceInstance {
    /// Places a mesh; the inverse is taken in f64 and rounded once. A singular transform is never hit.
    pub fn new(scene_from_object: Affine3A, blas: Arc<Blas>) -> Self {
        let forward = scene_from_object.matrix3;
        let columns = [forward.x_axis, forward.y_axis, forward.z_axis].map(|c| c.as_dvec3());
        let inverse = DMat3::from_cols(columns[0], columns[1], columns[2]).inverse();
        let columns = [inverse.x_axis, inverse.y_axis, inverse.z_axis].map(|c| c.as_vec3a());
        let linear = Mat3A::from_cols(columns[0], columns[1], columns[2]);
        let translation = -(inverse * scene_from_object.translation.as_dvec3());
        let object_from_scene = Affine3A { matrix3: linear, translation: translation.as_vec3a() };
        Self { object_from_scene, scene_from_object, blas }
    }
}

/// Instruction sets of the native trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SimdWidth {
    /// Plain arrays.
    Portable,
    /// AVX2 and FMA, 8 rays.
    Avx2,
    /// AVX-512, 16 rays.
    Avx512,
}

impl SimdWidth {
    /// Those that this CPU has, slowest first.
    pub fn available() -> Vec<Self> {
        dispatch::available()
    }
}

/// A scene that rays can be traced through.
#[derive(Debug)]
pub struct TraceScene {
    pub(super) placed: Vec<Placed>,
    pub(super) tlas: Tlas,
    pub(super) width: SimdWidth,
}

impl TraceScene {
    /// Builds the top level; the meshes bring theirs. An instance whose transform is singular or not finite, or whose
    /// mesh is empty, is never hit.
    pub fn new(instances: Vec<TraceInstance>) -> Self {
        let placed: Vec<Placed> = instances.into_iter().map(Placed::new).collect();
        let reach = placed.iter().fold(Bounds::EMPTY, |all, p| all.union(p.bounds)).max_abs();
        let boxes: Vec<Bounds> = placed.iter().map(|p| p.padded_bounds(reach)).collect();
        Self { placed, tlas: Tlas::build(&boxes), width: dispatch::best() }
    }

    /// The same with a chosen instruction set; `None` where the CPU lacks it.
    pub fn with_width(mut self, width: SimdWidth) -> Option<Self> {
        self.width = width;
        SimdWidth::available().contains(&width).then_some(self)
    }

    /// Instruction set in use.
    pub fn width(&self) -> SimdWidth {
        self.width
    }

    /// Box of everything that can be hit, with a margin.
    pub fn bounds(&self) -> Bounds {
        self.tlas.bounds()
    }

    /// The first thing that each ray meets. `hits` is as long as `rays`. Once `cancel` is set the rest of the answers
    /// is left as it was.
    ///
    /// # Panics
    /// When the lengths differ.
    pub fn closest(&self, rays: &[Ray], hits: &mut [Hit], cancel: &AtomicBool) {
        assert_eq!(rays.len(), hits.len(), "one hit per ray");
        dispatch::closest(self, rays, hits, cancel);
    }

    /// Whether anything is in the way of each ray: bit `i % 32` of word `i / 32` is set when ray `i` is occluded; spare
    /// bits of the last word are cleared.
    ///
    /// # Panics
    /// When `occluded_bits` has not `rays.len().div_ceil(32)` words.
    pub fn any(&self, rays: &[Ray], occluded_bits: &mut [u32], cancel: &AtomicBool) {
        assert_eq!(occluded_bits.len(), rays.len().div_ceil(32), "one bit per ray");
        dispatch::any(self, rays, occluded_bits, cancel);
    }

    /// Which samples of a light each receiver sees; returns the number of rays traced.
    ///
    /// `bits` holds `table.words()` words per receiver. Bit `k` is set when, with `d = point - origin`,
    /// - stratum `k` faces the surface: `dot(n_geo, d)` and `dot(n_shade, d)` are positive,
    /// - the light emits towards it: `dot(light_normal, -d)` is positive or the light two-sided, and
    ///   `dot(cone_axis, -d) >= cos_cutoff |d|`,
    /// - and nothing is in between, `t` in (0, w).
    ///
    /// Only rays that pass the facing tests are traced. An inactive receiver, one whose pattern is not in the table, and
    /// a sample with `w <= 0` get no bit. Quickest when runs of 16 to 32 strata are compact: Morton order.
    ///
    /// # Panics
    /// When `bits` has the wrong length, or `points` is no whole number of patterns.
    pub fn shadow(&self, receivers: &[Receiver], table: &SampleTable, bits: &mut [u32], cancel: &AtomicBool) -> u64 {
        assert_eq!(bits.len(), receivers.len() * table.words(), "one bit per sample");
        if table.strata == 0 {
            return 0;
        }
        assert_eq!(table.points.len() % table.strata as usize, 0, "whole patterns");
        dispatch::shadow(self, receivers, table, bits, cancel)
    }

    /// As [`TraceScene::shadow`] for some samples only, with the same answers; returns the number of rays traced.
    ///
    /// On entry bit `k` says that stratum `k` is asked. It stays when nothing hides the sample, and also when the sample
    /// does not face the surface or the light does not emit towards it: such a sample is not traced. It is cleared when
    /// the sample is hidden, or faces and can not be traced (`w <= 0`, not finite). An inactive receiver gets no bit.
    /// Quickest when runs of 64 receivers, from a multiple of 64 on, lie close together, and those of 4 closest.
    ///
    /// # Panics
    /// When `bits` has the wrong length, or `points` is no whole number of patterns.
    pub fn shadow_asked(
        &self,
        receivers: &[Receiver],
        table: &SampleTable,
        bits: &mut [u32],
        cancel: &AtomicBool,
    ) -> u64 {
        assert_eq!(bits.len(), receivers.len() * table.words(), "one bit per sample");
        if table.strata == 0 {
            return 0;
        }
        assert_eq!(table.points.len() % table.strata as usize, 0, "whole patterns");
        dispatch::shadow_asked(self, receivers, table, bits, cancel)
    }
}
