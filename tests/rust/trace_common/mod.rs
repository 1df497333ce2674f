//! Geometry, random numbers and a float64 brute force for the tests of the native trace.
#![allow(dead_code, unreachable_pub, reason = "each test binary uses its own part")]
pub mod tiles;

use glam::{Affine3A, DAffine3, DVec3, Mat3, Quat, Vec3};
use miplight::passes::visibility::trace_native::{Ray, TraceInstance};
use miplight::scene::bvh::Blas;
use std::collections::HashMap;
use std::sync::Arc;

/// PCG32.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }
    pub fn bits(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let x = (((self.0 >> 18) ^ self.0) >> 27) as u32;
        x.rotate_right((self.0 >> 59) as u32)
    }
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 8) as f32 / 16_777_216.0
    }
    pub fn range(&mut self, lo: f32, hi: f32) -> f32 {
        lo + (hi - lo) * self.unit()
    }
    pub fn below(&mut self, n: usize) -> usize {
        self.bits() as usize % n
    }
    pub fn cube(&mut self, half: f32) -> Vec3 {
        Vec3::new(self.range(-half, half), self.range(-half, half), self.range(-half, half))
    }
    pub fn direction(&mut self) -> Vec3 {
        loop {
            let v = self.cube(1.0);
            if v.length_squared() > 0.01 && v.length_squared() < 1.0 {
                return v.normalize();
            }
        }
    }
}

#[derive(Clone, Default)]
pub struct Mesh {
    pub positions: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    pub fn blas(&self) -> Arc<Blas> {
        Arc::new(Blas::build(&self.positions, &self.triangles))
    }
}

/// Icosahedron, each triangle cut in four `levels` times; radius disturbed by `bump`.
pub fn sphere(levels: u32, bump: f32) -> Mesh {
    let g = (1.0 + 5.0_f32.sqrt()) / 2.0;
    let corners = [
        [-1.0, g, 0.0],
        [1.0, g, 0.0],
        [-1.0, -g, 0.0],
        [1.0, -g, 0.0],
        [0.0, -1.0, g],
        [0.0, 1.0, g],
        [0.0, -1.0, -g],
        [0.0, 1.0, -g],
        [g, 0.0, -1.0],
        [g, 0.0, 1.0],
        [-g, 0.0, -1.0],
        [-g, 0.0, 1.0],
    ];
    let mut positions: Vec<Vec3> = corners.iter().map(|&c| Vec3::from(c).normalize()).collect();
    let mut triangles: Vec<[u32; 3]> = vec![
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    for _ in 0..levels {
        let mut middle = HashMap::new();
        let mut next = Vec::with_capacity(triangles.len() * 4);
        for t in &triangles {
            let mut mid = |a: u32, b: u32| {
                *middle.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    positions.push(((positions[a as usize] + positions[b as usize]) * 0.5).normalize());
                    positions.len() as u32 - 1
                })
            };
            let (ab, bc, ca) = (mid(t[0], t[1]), mid(t[1], t[2]), mid(t[2], t[0]));
            next.extend([[t[0], ab, ca], [t[1], bc, ab], [t[2], ca, bc], [ab, bc, ca]]);
        }
        triangles = next;
    }
    for p in &mut positions {
        *p *= 1.0 + bump * ((7.0 * p.x).sin() * (5.0 * p.y).cos() + (9.0 * p.z).sin());
    }
    Mesh { positions, triangles }
}

/// Flat square of `n` × `n` quads in the plane z = 0, corners at whole multiples of 1 / n.
pub fn grid(n: u32) -> Mesh {
    let row = n + 1;
    let positions = (0..row * row).map(|i| Vec3::new((i % row) as f32, (i / row) as f32, 0.0) / n as f32).collect();
    let mut triangles = Vec::new();
    for i in 0..n * n {
        let a = i / n * row + i % n;
        triangles.extend([[a, a + 1, a + row + 1], [a, a + row + 1, a + row]]);
    }
    Mesh { positions, triangles }
}

/// The six sides of a cube of side 2 around the origin, `n` × `n` quads each, vertices shared only in position.
pub fn cube(n: u32) -> Mesh {
    let flat = grid(n);
    let mut mesh = Mesh::default();
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let base = mesh.positions.len() as u32;
            let place = |p: &Vec3| {
                let mut q = Vec3::ZERO;
                (q[axis], q[(axis + 1) % 3], q[(axis + 2) % 3]) = (side, 2.0 * p.x - 1.0, 2.0 * p.y - 1.0);
                q
            };
            mesh.positions.extend(flat.positions.iter().map(place));
            mesh.triangles.extend(flat.triangles.iter().map(|t| t.map(|i| i + base)));
        }
    }
    mesh
}

/// Triangles at random.
pub fn soup(count: usize, size: f32, random: &mut Random) -> Mesh {
    let mut mesh = Mesh::default();
    for i in 0..count as u32 {
        let middle = random.cube(1.0);
        mesh.positions.extend([0, 1, 2].map(|_| middle + random.cube(size)));
        mesh.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    mesh
}

/// A mesh with its place.
pub struct Object {
    pub mesh: Mesh,
    pub place: Affine3A,
}

/// Rotated, scaled, mirrored, sheared and plainly shifted places.
pub fn places(random: &mut Random) -> Vec<Affine3A> {
    let turn = |random: &mut Random| Quat::from_axis_angle(random.direction(), random.range(0.0, 6.0));
    let mut shear = Mat3::IDENTITY;
    shear.y_axis.x = 0.7;
    vec![
        Affine3A::IDENTITY,
        Affine3A::from_translation(Vec3::new(1.7, -0.4, 0.3)),
        Affine3A::from_rotation_translation(turn(random), random.cube(2.0)),
        Affine3A::from_scale_rotation_translation(Vec3::new(0.5, 2.0, 1.3), turn(random), random.cube(2.0)),
        Affine3A::from_scale_rotation_translation(Vec3::new(-1.0, 1.0, 0.7), turn(random), random.cube(2.0)),
        Affine3A::from_mat3_translation(shear, random.cube(2.0)),
        Affine3A::from_scale_rotation_translation(Vec3::splat(0.02), turn(random), random.cube(2.0)),
    ]
}

pub fn instances(objects: &[Object]) -> Vec<TraceInstance> {
    objects.iter().map(|o| TraceInstance::new(o.place, o.mesh.blas())).collect()
}

/// Answer of the brute force, with how far the ray is from changing its mind.
#[derive(Clone, Copy, Debug)]
pub struct Reference {
    pub t: f64,
    pub instance: u32,
    /// Smallest distance of any candidate from an edge (barycentric) or from an end of the ray (relative `t`).
    pub margin: f64,
}

/// Every triangle in float64, Möller–Trumbore.
pub fn brute_force(objects: &[Object], ray: &Ray) -> Reference {
    let o = Vec3::from(ray.origin).as_dvec3();
    let d = Vec3::from(ray.direction).as_dvec3();
    let mut best = Reference { t: f64::INFINITY, instance: u32::MAX, margin: f64::INFINITY };
    for (index, object) in objects.iter().enumerate() {
        let place = DAffine3::from_cols(
            object.place.matrix3.x_axis.as_dvec3(),
            object.place.matrix3.y_axis.as_dvec3(),
            object.place.matrix3.z_axis.as_dvec3(),
            object.place.translation.as_dvec3(),
        );
        for triangle in &object.mesh.triangles {
            let [a, b, c] = triangle.map(|i| place.transform_point3(object.mesh.positions[i as usize].as_dvec3()));
            let Some((t, slack)) = cross(a - o, b - a, c - a, d) else { continue };
            let ends = ((t - f64::from(ray.t_min)) / t.abs().max(1e-9)).abs();
            let ends = ends.min(((f64::from(ray.t_max) - t) / t.abs().max(1e-9)).abs());
            let inside = t > f64::from(ray.t_min) && t < f64::from(ray.t_max);
            if slack > -0.01 {
                best.margin = best.margin.min(slack.abs().min(ends));
            }
            if slack >= 0.0 && inside && t < best.t {
                best.t = t;
                best.instance = index as u32;
            }
        }
    }
    best
}

/// `t`, and the smallest barycentric weight (negative outside).
fn cross(a: DVec3, e1: DVec3, e2: DVec3, d: DVec3) -> Option<(f64, f64)> {
    let p = d.cross(e2);
    let det = e1.dot(p);
    if det.abs() < 1e-12 * e1.length() * e2.length() * d.length() {
        return None;
    }
    let s = -a;
    let u = s.dot(p) / det;
    let q = s.cross(e1);
    let v = d.dot(q) / det;
    Some((e2.dot(q) / det, u.min(v).min(1.0 - u - v)))
}

pub fn ray(origin: Vec3, direction: Vec3) -> Ray {
    Ray { origin: origin.into(), t_min: 0.0, direction: direction.into(), t_max: f32::INFINITY }
}
