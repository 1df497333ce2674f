//! Surface samples where they are in the scene, sorted by the cells in which they leave their light; kept as long as
//! nothing moves.

use std::collections::BTreeMap;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::{DMat3, DVec3, UVec3, Vec3};

use super::Volume;
use super::nested::MOST;
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
    /// Of a volume inside of another: the cell of that with which it begins.
    pub first: Option<[u32; 3]>,
    /// By cell.
    pub points: Buffer<LpvPoint>,
    /// Sides of samples.
    pub count: usize,
    /// Of the scene.
    pub samples: u32,
    /// Cells with points.
    pub held: Vec<LpvCell>,
    /// The same on the device.
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
    /// Of a volume inside of another: the cell of that with which it begins.
    pub first: Option<[u32; 3]>,
}

impl Asked {
    /// As the settings say.
    pub fn of(settings: &Settings) -> Self {
        Self {
            samples: settings.int("lpv_samples"),
            resolution: settings.int("lpv_resolution"),
            seed: settings.int("seed"),
            blocked: settings.is("indirect_visibility", "on"),
            first: None,
        }
    }
}

/// Mesh, shape after its transform, number of samples, seed.
type Key = (u64, [i64; 6], usize, u32);

/// What is kept between frames.
#[derive(Default)]
pub struct Kept {
    samples: [BTreeMap<Key, Arc<Vec<SurfaceSample>>>; MOST],
    placed: [Option<(Asked, Arc<Placed>)>; MOST],
    version: u64,
}

impl Kept {
    /// Forgets what lies elsewhere when the placed scene has another version.
    pub fn follow(&mut self, version: u64) {
        if version != self.version {
            self.placed = Default::default();
            self.version = version;
        }
    }

    /// Points for what is asked of a level, where they are kept.
    pub fn placed(&self, level: usize, asked: Asked) -> Option<Arc<Placed>> {
        let placed = self.placed.get(level)?.as_ref();
        placed.filter(|(known, _)| *known == asked).map(|(_, placed)| Arc::clone(placed))
    }

    /// Points for what is asked of a level, in a volume whose faces are known.
    ///
    /// # Errors
    /// Those of the device.
    pub fn place(
        &mut self,
        gpu: &Gpu,
        prepared: &Prepared,
        (level, asked): (usize, Asked),
        (volume, met, open): (Volume, Buffer<f32>, Buffer<u32>),
    ) -> Result<Arc<Placed>> {
        let cells_of = Cells { volume, met: gpu.read(&met)? };
        let sides = self.sides(prepared, &cells_of, (level, asked));
        let points: Vec<LpvPoint> = sides.iter().map(|(_, point)| *point).collect();
        let cells = cells(&sides);
        let placed = Arc::new(Placed {
            volume,
            first: asked.first,
            points: gpu.upload("lpv_points", &points)?,
            count: points.len(),
            samples: asked.samples,
            cells: gpu.upload("lpv_cells", &cells)?,
            occupied: cells.len(),
            held: cells,
            met,
            open,
        });
        Ok(placed)
    }

    /// Keeps what [`Kept::place`] made, complete now.
    pub fn keep(&mut self, level: usize, asked: Asked, placed: Arc<Placed>) {
        if let Some(kept) = self.placed.get_mut(level) {
            *kept = Some((asked, placed));
        }
    }

    /// Both sides of each sample with the cell before it, by cell; of a volume inside of another those in it.
    fn sides(&mut self, prepared: &Prepared, cells: &Cells, (level, asked): (usize, Asked)) -> Vec<(u32, LpvPoint)> {
        let mut known = std::mem::take(&mut self.samples[level]);
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
            let samples = known.remove(&key).or_else(|| used.get(&key).cloned()).unwrap_or_else(made);
            for sample in samples.iter() {
                let both = both_sides(placed, instance as u32, sample, cells);
                sides.extend(both.into_iter().filter(|(cell, _)| *cell != OUTSIDE));
            }
            used.insert(key, samples);
        }
        self.samples[level] = used;
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
        let cell = cells.inside(position.as_vec3()).then(|| cells.cell_before(position.as_vec3(), normal));
        let cell = cell.unwrap_or(OUTSIDE);
        (cell, LpvPoint { normal: normal.to_array(), area: area as f32, instance, triangle, u, v })
    })
}

/// Cell of what lies outside of the volume.
const OUTSIDE: u32 = u32::MAX;

/// The volume as the host sees it.
struct Cells {
    volume: Volume,
    met: Vec<f32>,
}

impl Cells {
    fn inside(&self, position: Vec3) -> bool {
        let place = (position - Vec3::from(self.volume.corner)) / self.volume.edge;
        place.cmpge(Vec3::ZERO).all() && place.cmplt(UVec3::from(self.volume.size).as_vec3()).all()
    }

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::mesh::{Mesh, MeshInput};
    use crate::scene::snapshot::{Instance, Snapshot};
    use glam::{DMat4, DQuat};

    const ASKED: Asked = Asked { samples: 500, resolution: 16, seed: 0, blocked: true, first: None };

    /// Two triangles of 2 x 1 placed so.
    fn placed(transforms: &[DMat4]) -> Prepared {
        let positions = vec![DVec3::ZERO, 2.0 * DVec3::X, DVec3::new(2.0, 1.0, 0.0), DVec3::Y];
        let input = MeshInput { positions, triangles: vec![[0, 1, 2], [0, 2, 3]], ..MeshInput::default() };
        let mesh = Arc::new(Mesh::new("sheet", input).expect("two proper triangles"));
        let instance = |world_from_object: &DMat4| Instance {
            name: "sheet".into(),
            mesh: Arc::clone(&mesh),
            world_from_object: *world_from_object,
            smooth: false,
            albedo: Vec3::ONE,
            texture: None,
            vertex_colors: false,
            lobe: [0.0; 4],
        };
        Prepared::new(&Snapshot { instances: transforms.iter().map(instance).collect(), ..Snapshot::default() })
    }

    fn sides(prepared: &Prepared) -> Vec<(u32, LpvPoint)> {
        let volume = Volume::of(prepared, ASKED.resolution);
        let met = vec![NOWHERE; 3 * volume.cells as usize];
        Kept::default().sides(prepared, &Cells { volume, met }, (0, ASKED))
    }

    fn area(sides: &[(u32, LpvPoint)], instance: u32) -> f64 {
        sides.iter().filter(|(_, p)| p.instance == instance).map(|(_, p)| f64::from(p.area)).sum()
    }

    #[test]
    fn each_mesh_has_points_by_its_area_in_the_scene() {
        let stretched = DMat4::from_quat(DQuat::from_rotation_y(0.7)) * DMat4::from_scale(DVec3::new(3.0, 0.5, 9.0));
        let small = DMat4::from_translation(DVec3::Z) * DMat4::from_scale(DVec3::splat(1e-3));
        let sides = sides(&placed(&[DMat4::IDENTITY, stretched, small]));
        // Both sides of 2, 3 and 2e-6.
        for (instance, expected) in [4.0, 6.0, 4e-6].into_iter().enumerate() {
            let found = area(&sides, instance as u32);
            assert!((found / expected - 1.0).abs() < 1e-5, "{instance}: {found} instead of {expected}");
        }
        let counts = [0, 1, 2].map(|i| sides.iter().filter(|(_, p)| p.instance == i).count());
        assert_eq!(counts, [400, 600, 2]);
        assert!(sides.is_sorted_by_key(|(cell, _)| *cell));
    }

    #[test]
    fn points_move_and_turn_with_their_mesh() {
        let key = |sides: Vec<(u32, LpvPoint)>| {
            let bits = |(_, p): &(u32, LpvPoint)| (p.triangle, p.u.to_bits(), p.v.to_bits(), p.area.to_bits());
            let mut points: Vec<_> = sides.iter().map(bits).collect();
            points.sort_unstable();
            points
        };
        let still = key(sides(&placed(&[DMat4::IDENTITY])));
        let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 1.0, -2.0);
        let turned = DMat4::from_rotation_translation(turn, DVec3::new(3.0, -7.0, 1.0));
        assert_eq!(still, key(sides(&placed(&[turned]))));
        let stretched = DMat4::from_scale(DVec3::new(1.0, 4.0, 1.0));
        assert_ne!(still, key(sides(&placed(&[stretched]))));
    }

    #[test]
    fn light_is_left_before_the_surface_and_before_what_stands_on_it() {
        let prepared = placed(&[DMat4::IDENTITY]);
        let volume = Volume::of(&prepared, ASKED.resolution);
        let mut cells = Cells { volume, met: vec![NOWHERE; 3 * volume.cells as usize] };
        let size = UVec3::from(volume.size);
        let middle = |cell: u32| {
            let at = UVec3::new(cell % size.x, cell / size.x % size.y, cell / (size.x * size.y));
            Vec3::from(volume.corner) + (at.as_vec3() + 0.5) * volume.edge
        };
        let normals = [Vec3::Z, -Vec3::Z, Vec3::ONE.normalize(), Vec3::new(0.3, -1.0, 0.5).normalize()];
        for (number, normal) in normals.into_iter().enumerate() {
            let place = Vec3::new(0.013, 0.1, 0.02 * number as f32);
            let before = middle(cells.cell_before(place, normal)) - place;
            assert!(before.dot(normal) > 0.0 && before.length() < 2.0 * volume.edge, "{before} {normal}");
        }
        // A sheet between this cell and the lower one, 0.9 of the way up: what lies below it belongs to the lower one.
        let cell = cells.cell_before(Vec3::ZERO, Vec3::Z);
        let place = middle(cell) - Vec3::new(0.3 * volume.edge, 0.0, 0.55 * volume.edge);
        assert_eq!(cells.cell_before(place, Vec3::Z), cell);
        cells.met[cell as usize - 1] = 0.9;
        assert_eq!(cells.cell_before(place, Vec3::Z), cell - 1);
        cells.met[cell as usize - 1] = 0.6;
        assert_eq!(cells.cell_before(place, Vec3::Z), cell);
    }
}
