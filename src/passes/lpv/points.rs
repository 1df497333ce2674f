//! Surface samples where they are in the scene, sorted by the cells in which they leave their light; kept as long as
//! nothing moves.

use std::collections::BTreeMap;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::{DMat3, DVec3, UVec3, Vec3};

use super::Volume;
use crate::error::Result;
use crate::gpu::{Buffer, Gpu};
use crate::scene::prepare::{self, Prepared};
use crate::scene::surface_samples::{self, SurfaceSample};
use crate::settings::Settings;

/// Twin of `CLEAR` in `shaders/common/lpv_volume.wgsl`.
pub const CLEAR: f32 = 1.1;
/// Twin of `NOWHERE` in `shaders/common/lpv_volume.wgsl`.
pub const NOWHERE: f32 = 2.0;

/// Twin of `LpvPoint` in `shaders/common/lpv_point.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct LpvPoint {
    /// Unit, of the triangle, on this side.
    pub normal: [f32; 3],
    /// That it stands for.
    pub area: f32,
    /// Placed mesh.
    pub instance: u32,
    /// Of the mesh.
    pub triangle: u32,
    /// Weight of vertex 1.
    pub u: f32,
    /// Weight of vertex 2.
    pub v: f32,
}

/// Twin of `LpvCell` in `shaders/common/lpv_point.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct LpvCell {
    /// Number of the cell.
    pub cell: u32,
    /// First of its points.
    pub first: u32,
    /// How many they are.
    pub count: u32,
    /// Unused.
    pub pad: u32,
}

/// Both sides of all samples, on the device.
pub struct Placed {
    /// Where they are.
    pub volume: Volume,
    /// By cell.
    pub points: Buffer<LpvPoint>,
    /// Sides of samples.
    pub count: usize,
    /// Cells with points.
    pub cells: Buffer<LpvCell>,
    /// How many.
    pub occupied: usize,
    /// Where the ways between the middles of cells meet surfaces, see `blockers`.
    pub met: Buffer<f32>,
    /// A mask of open faces a cell.
    pub open: Buffer<u32>,
}

/// What samples depend on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Asked {
    /// How many samples.
    pub samples: u32,
    /// Cells along the longest edge.
    pub resolution: u32,
    /// The user's seed.
    pub seed: u32,
    /// Whether surfaces block light.
    pub blocked: bool,
}

impl Asked {
    /// As the settings say.
    pub fn of(settings: &Settings) -> Self {
        Self {
            samples: settings.int("lpv_samples"),
            resolution: settings.int("lpv_resolution"),
            seed: settings.int("seed"),
            blocked: settings.is("indirect_visibility", "on"),
        }
    }
}

/// Mesh, shape after its transform, number of samples, seed.
type Key = (u64, [i64; 6], usize, u32);

/// What is kept between frames.
#[derive(Default)]
pub struct Kept {
    samples: BTreeMap<Key, Arc<Vec<SurfaceSample>>>,
    placed: Option<(Asked, Arc<Placed>)>,
    version: u64,
}

impl Kept {
    /// Forgets what lies elsewhere when the placed scene has another version.
    pub fn follow(&mut self, version: u64) {
        if version != self.version {
            self.placed = None;
            self.version = version;
        }
    }

    /// Points for what is asked, where they are kept.
    pub fn placed(&self, asked: Asked) -> Option<Arc<Placed>> {
        self.placed.as_ref().filter(|(known, _)| *known == asked).map(|(_, placed)| Arc::clone(placed))
    }

    /// Points for what is asked in a volume whose faces are known.
    ///
    /// # Errors
    /// Those of the device.
    pub fn place(
        &mut self,
        gpu: &Gpu,
        prepared: &Prepared,
        asked: Asked,
        (volume, met, open): (Volume, Buffer<f32>, Buffer<u32>),
    ) -> Result<Arc<Placed>> {
        self.placed = None;
        let cells_of = Cells { volume, met: gpu.read(&met)? };
        let sides = self.sides(prepared, &cells_of, asked);
        let points: Vec<LpvPoint> = sides.iter().map(|(_, point)| *point).collect();
        let cells = cells(&sides);
        let placed = Arc::new(Placed {
            volume,
            points: gpu.upload("lpv_points", &points)?,
            count: points.len(),
            cells: gpu.upload("lpv_cells", &cells)?,
            occupied: cells.len(),
            met,
            open,
        });
        Ok(placed)
    }

    /// Keeps what [`Kept::place`] made, complete now.
    pub fn keep(&mut self, asked: Asked, placed: Arc<Placed>) {
        self.placed = Some((asked, placed));
    }

    /// Both sides of each sample with the cell before it, by cell.
    fn sides(&mut self, prepared: &Prepared, cells: &Cells, asked: Asked) -> Vec<(u32, LpvPoint)> {
        let shapes: Vec<Shape> = prepared.placed.iter().map(Shape::of).collect();
        let whole: f64 = shapes.iter().map(|shape| shape.area).sum();
        let mut used = BTreeMap::new();
        let mut sides = Vec::new();
        for (instance, (placed, shape)) in prepared.placed.iter().zip(&shapes).enumerate() {
            if shape.area <= 0.0 {
                continue;
            }
            // A mesh that is too small for one still has one, which stands for its own area and no more.
            let count = ((f64::from(asked.samples) * shape.area / whole).round() as usize).max(1);
            let key = (placed.mesh.id, shape.rounded, count, asked.seed);
            let made = || {
                let (mesh, seed) = (&placed.mesh, u64::from(asked.seed));
                Arc::new(surface_samples::sample(&mesh.positions, &mesh.triangles, shape.map, count, seed))
            };
            let samples = self.samples.remove(&key).or_else(|| used.get(&key).cloned()).unwrap_or_else(made);
            for sample in samples.iter() {
                sides.extend(both_sides(placed, instance as u32, sample, cells));
            }
            used.insert(key, samples);
        }
        self.samples = used;
        sides.sort_by_key(|(cell, _)| *cell);
        sides
    }
}

/// The shape of a placed mesh: the same however it is turned and moved.
struct Shape {
    map: DMat3,
    rounded: [i64; 6],
    area: f64,
}

impl Shape {
    fn of(placed: &prepare::Placed) -> Self {
        let linear = DMat3::from_mat4(placed.scene_from_object);
        let gram = linear.transpose() * linear;
        // Rounding of a rotation must not choose other samples.
        let unit = (gram.x_axis.x + gram.y_axis.y + gram.z_axis.z) * 2.0_f64.powi(-40);
        let [x, y, z] = [gram.x_axis, gram.y_axis, gram.z_axis];
        let rounded = [x.x, y.y, z.z, y.x, z.x, z.y].map(|entry| (entry / unit).round() as i64);
        // A visible light reflects nothing.
        if placed.light.is_some() {
            return Self { map: linear, rounded, area: 0.0 };
        }
        let map = cholesky(rounded.map(|entry| entry as f64 * unit)).unwrap_or(linear);
        Self { map, rounded, area: surface_samples::area(&placed.mesh.positions, &placed.mesh.triangles, map) }
    }
}

/// The upper triangle U with UᵀU = G, of G = (xx, yy, zz, xy, xz, yz).
fn cholesky([xx, yy, zz, xy, xz, yz]: [f64; 6]) -> Option<DMat3> {
    let a = xx.sqrt();
    let (b, c) = (xy / a, xz / a);
    let d = (yy - b * b).sqrt();
    let e = (yz - b * c) / d;
    let f = (zz - c * c - e * e).sqrt();
    let found = DMat3::from_cols(DVec3::new(a, 0.0, 0.0), DVec3::new(b, d, 0.0), DVec3::new(c, e, f));
    (found.is_finite() && f > 0.0).then_some(found)
}

/// A sample from both sides, each with the cell in which it leaves its light.
fn both_sides(placed: &prepare::Placed, instance: u32, sample: &SurfaceSample, cells: &Cells) -> [(u32, LpvPoint); 2] {
    let &SurfaceSample { triangle, u, v, area } = sample;
    let corner = |v: u32| placed.scene_from_object.transform_point3(placed.mesh.positions[v as usize].as_dvec3());
    let [a, b, c] = placed.mesh.triangles[triangle as usize].map(corner);
    let position = a + f64::from(u) * (b - a) + f64::from(v) * (c - a);
    let normal = (b - a).cross(c - a).normalize_or_zero();
    [normal, -normal].map(|normal| {
        let normal = normal.as_vec3();
        let cell = cells.cell_before(position.as_vec3(), normal);
        (cell, LpvPoint { normal: normal.to_array(), area: area as f32, instance, triangle, u, v })
    })
}

/// The volume as the host sees it.
struct Cells {
    volume: Volume,
    met: Vec<f32>,
}

impl Cells {
    /// The cell half a cell before a surface, whose middle lies clear of it and on the same side of what closes faces; as
    /// `seen_from` in `shaders/passes/lpv/look_up.wgsl`.
    fn cell_before(&self, position: Vec3, normal: Vec3) -> u32 {
        let Volume { corner, edge, size, cells } = self.volume;
        let before = 0.5 * CLEAR * normal.abs().element_sum();
        let place = (position - Vec3::from(corner)) / edge + before * normal;
        let most = UVec3::from(size) - 1;
        let mut own = place.max(Vec3::ZERO).as_uvec3().min(most);
        let number = |at: UVec3| ((at.z * size[1] + at.y) * size[0] + at.x) as usize;
        for axis in 0..3 {
            let middle = own[axis] as f32 + 0.5;
            let up = place[axis] > middle;
            if own[axis] == if up { most[axis] } else { 0 } {
                continue;
            }
            let mut lower = own;
            lower[axis] -= u32::from(!up);
            let surface = self.met[axis * cells as usize + number(lower)];
            let at = lower[axis] as f32 + 0.5 + surface;
            if surface != NOWHERE && if up { place[axis] > at } else { place[axis] < at } {
                own[axis] = if up { own[axis] + 1 } else { lower[axis] };
            }
        }
        number(own) as u32
    }
}

/// Runs of points of one cell.
fn cells(sides: &[(u32, LpvPoint)]) -> Vec<LpvCell> {
    let mut cells: Vec<LpvCell> = Vec::new();
    for (place, (cell, _)) in sides.iter().enumerate() {
        match cells.last_mut().filter(|last| last.cell == *cell) {
            Some(last) => last.count += 1,
            None => cells.push(LpvCell { cell: *cell, first: place as u32, count: 1, pad: 0 }),
        }
    }
    cells
}
