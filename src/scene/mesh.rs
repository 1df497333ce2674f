//! Immutable triangle geometry: checked, rebased in float64, cleaned of triangles without area.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};

use glam::{DVec3, Vec2, Vec3};

use super::bvh::Blas;
use crate::error::{Error, Result};

/// A triangle whose doubled area is below this share of its longest edge squared is dropped: it has
/// no normal, and no ray can be said to hit it (N8). Needles of 1 : 1e6 stay.
const DEGENERATE_AREA: f64 = 1e-12;

static NEXT_ID: AtomicU64 = AtomicU64::new(1);

/// A number that no other mesh, tree or texture of this process has; caches are keyed by it.
pub(crate) fn next_id() -> u64 {
    NEXT_ID.fetch_add(1, Ordering::Relaxed)
}

/// What a mesh is made of, before any check.
#[derive(Debug, Clone, Default)]
pub struct MeshInput {
    /// Vertex positions, float64, in the mesh's own space.
    pub positions: Vec<DVec3>,
    /// Three vertex indices a triangle.
    pub triangles: Vec<[u32; 3]>,
    /// Vertex normals for smooth shading.
    pub normals: Option<Vec<Vec3>>,
    /// Texture coordinates; v = 0 is the bottom row of the image.
    pub uvs: Option<Vec<Vec2>>,
    /// Linear RGB a vertex.
    pub colors: Option<Vec<Vec3>>,
}

/// How many triangles were kept, and why the others were not.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct MeshReport {
    /// Triangles kept.
    pub triangles: usize,
    /// Dropped: no area.
    pub degenerate: usize,
    /// Dropped: a vertex is NaN or infinite.
    pub not_finite: usize,
}

/// Immutable geometry with its bottom-level BVH, built once, on first use.
#[derive(Debug)]
pub struct Mesh {
    /// Unique in this process.
    pub id: u64,
    /// What `positions` are relative to, in the mesh's own space (float64, N7).
    pub origin: DVec3,
    /// Vertex positions minus `origin`.
    pub positions: Vec<Vec3>,
    /// The triangles that were kept.
    pub triangles: Vec<[u32; 3]>,
    /// Unit vertex normals.
    pub normals: Option<Vec<Vec3>>,
    /// Texture coordinates.
    pub uvs: Option<Vec<Vec2>>,
    /// Linear RGB a vertex.
    pub colors: Option<Vec<Vec3>>,
    /// Smallest and largest corner of the kept triangles, in the mesh's own space.
    pub bounds: [DVec3; 2],
    /// What was kept and dropped.
    pub report: MeshReport,
    /// For each kept triangle its number among the triangles that were given.
    pub given_triangle: Vec<u32>,
    given: Vec<[u32; 3]>,
    blas: OnceLock<Arc<Blas>>,
}

impl Mesh {
    /// Checks, rebases and cleans `input`.
    ///
    /// # Errors
    /// `Scene` when an index is out of range, an attribute has another length than the positions,
    /// or no triangle is left.
    pub fn new(name: &str, input: MeshInput) -> Result<Self> {
        check_lengths(name, &input)?;
        let MeshInput { positions, triangles: given, normals, uvs, colors } = input;
        let (kept, report) = clean(&positions, &given);
        if kept.is_empty() {
            return Err(Error::Scene(format!(
                "mesh {name:?}: none of its {} triangles is left ({} have no area, {} have NaN or infinite \
                 vertices); at least one triangle with an area is needed",
                given.len(),
                report.degenerate,
                report.not_finite
            )));
        }
        let triangles: Vec<[u32; 3]> = kept.iter().map(|&i| given[i as usize]).collect();
        let bounds = bounds_of(&positions, &triangles);
        let origin = (bounds[0] + bounds[1]) * 0.5;
        // Vertices that no kept triangle uses may be NaN; they are never read, but must stay inert.
        let rebased = positions.iter().map(|&p| if p.is_finite() { (p - origin).as_vec3() } else { Vec3::ZERO });
        Ok(Self {
            id: next_id(),
            origin,
            positions: rebased.collect(),
            normals: normals.map(|n| unit_normals(&n, &positions, &triangles)),
            triangles,
            uvs,
            colors,
            bounds,
            report,
            given_triangle: kept,
            given,
            blas: OnceLock::new(),
        })
    }

    /// The same triangles with vertices elsewhere.
    ///
    /// # Errors
    /// As [`Mesh::new`].
    pub fn with_positions(&self, name: &str, positions: Vec<DVec3>, normals: Option<Vec<Vec3>>) -> Result<Self> {
        if positions.len() != self.positions.len() {
            return Err(Error::Scene(format!(
                "vertices of mesh {name:?}: {} given, but the mesh has {}",
                positions.len(),
                self.positions.len()
            )));
        }
        let (uvs, colors) = (self.uvs.clone(), self.colors.clone());
        Self::new(name, MeshInput { positions, triangles: self.given.clone(), normals, uvs, colors })
    }

    /// The bottom-level BVH; built at the first call, on all cores.
    pub fn blas(&self) -> &Arc<Blas> {
        self.blas.get_or_init(|| Arc::new(Blas::build(&self.positions, &self.triangles)))
    }

    /// Whether the BVH exists already.
    pub fn has_blas(&self) -> bool {
        self.blas.get().is_some()
    }
}

fn check_lengths(name: &str, input: &MeshInput) -> Result<()> {
    let count = input.positions.len();
    let lengths = [
        ("normals", input.normals.as_ref().map(Vec::len)),
        ("uvs", input.uvs.as_ref().map(Vec::len)),
        ("colors", input.colors.as_ref().map(Vec::len)),
    ];
    for (what, length) in lengths {
        if let Some(length) = length.filter(|&l| l != count) {
            return Err(Error::Scene(format!("{what} of mesh {name:?}: {length} given for {count} vertices")));
        }
    }
    if count > u32::MAX as usize / 4 || input.triangles.len() > u32::MAX as usize / 4 {
        return Err(Error::Scene(format!("mesh {name:?} has more than 2^30 vertices or triangles")));
    }
    for (i, triangle) in input.triangles.iter().enumerate() {
        if let Some(&bad) = triangle.iter().find(|&&v| v as usize >= count) {
            return Err(Error::Scene(format!(
                "triangles of mesh {name:?}: triangle {i} refers to vertex {bad}, but there are {count} vertices \
                 (allowed: 0 to {})",
                count.saturating_sub(1)
            )));
        }
    }
    Ok(())
}

/// The numbers of the triangles worth keeping, in order.
fn clean(positions: &[DVec3], triangles: &[[u32; 3]]) -> (Vec<u32>, MeshReport) {
    let mut report = MeshReport::default();
    let mut kept = Vec::with_capacity(triangles.len());
    for (i, triangle) in triangles.iter().enumerate() {
        let [a, b, c] = triangle.map(|v| positions[v as usize]);
        // A vertex that overflows float32 is as useless as an infinite one.
        if ![a, b, c].iter().all(|p| p.is_finite() && p.abs().max_element() < 1e30) {
            report.not_finite += 1;
            continue;
        }
        let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
        if (b - a).cross(c - a).length() <= DEGENERATE_AREA * longest {
            report.degenerate += 1;
            continue;
        }
        kept.push(i as u32);
    }
    report.triangles = kept.len();
    (kept, report)
}

fn bounds_of(positions: &[DVec3], triangles: &[[u32; 3]]) -> [DVec3; 2] {
    let mut bounds = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    for &v in triangles.iter().flatten() {
        bounds[0] = bounds[0].min(positions[v as usize]);
        bounds[1] = bounds[1].max(positions[v as usize]);
    }
    bounds
}

/// Given normals made unit; where one is zero or not finite, the area-weighted mean of the triangles
/// around the vertex (N8).
fn unit_normals(normals: &[Vec3], positions: &[DVec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let mut unit: Vec<Vec3> = normals.iter().map(|n| n.as_dvec3().normalize_or_zero().as_vec3()).collect();
    if unit.iter().all(|n| *n != Vec3::ZERO) {
        return unit;
    }
    let mut sums = vec![DVec3::ZERO; positions.len()];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|v| positions[v as usize]);
        for &v in triangle {
            sums[v as usize] += (b - a).cross(c - a);
        }
    }
    for (n, sum) in unit.iter_mut().zip(sums) {
        if *n == Vec3::ZERO {
            *n = sum.normalize_or(DVec3::Z).as_vec3();
        }
    }
    unit
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> MeshInput {
        MeshInput {
            positions: vec![
                DVec3::new(1e6, 0.0, 0.0),
                DVec3::new(1e6 + 1.0, 0.0, 0.0),
                DVec3::new(1e6 + 1.0, 1.0, 0.0),
                DVec3::new(1e6, f64::NAN, 0.0),
            ],
            triangles: vec![[0, 1, 2], [0, 2, 3], [0, 0, 1]],
            ..Default::default()
        }
    }

    #[test]
    fn drops_what_has_no_area_or_is_not_finite_and_rebases() {
        let mesh = Mesh::new("square", square()).unwrap();
        assert_eq!(mesh.report, MeshReport { triangles: 1, degenerate: 1, not_finite: 1 });
        assert_eq!(mesh.origin, DVec3::new(1e6 + 0.5, 0.5, 0.0));
        assert_eq!(mesh.positions[0], Vec3::new(-0.5, -0.5, 0.0));
        assert_eq!(mesh.given_triangle, vec![0]);
    }

    #[test]
    fn refuses_indices_out_of_range_and_empty_meshes() {
        let mut input = square();
        input.triangles[0][1] = 9;
        let message = Mesh::new("square", input).unwrap_err().to_string();
        assert!(message.contains("triangle 0") && message.contains("vertex 9"), "{message}");
        let message = Mesh::new("none", MeshInput::default()).unwrap_err().to_string();
        assert!(message.contains("none of its 0 triangles"), "{message}");
    }

    #[test]
    fn zero_normals_fall_back_to_the_triangles_around() {
        let mut input = square();
        input.normals = Some(vec![Vec3::ZERO, Vec3::new(0.0, 0.0, 5.0), Vec3::NAN, Vec3::X]);
        let mesh = Mesh::new("square", input).unwrap();
        assert_eq!(&mesh.normals.unwrap()[..3], &[Vec3::Z; 3]);
    }
}
