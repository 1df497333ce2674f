//! From a snapshot to the records that shaders and traces read: everything in scene space, float32.

use std::collections::BTreeMap;
use std::sync::{Arc, LazyLock};

use bytemuck::{Pod, Zeroable};
use glam::{DMat4, DVec3, DVec4, Vec3};

use super::light::{AreaLight, Radiance, SpotLight};
use super::material::Texture;
use super::mesh::{Mesh, MeshInput};
use super::snapshot::{Instance, Snapshot};

/// Rows of the lights' table a light; twin of `LIGHT_ROWS` in `shaders/common/light.wgsl`.
pub const LIGHT_ROWS: usize = 6;
/// The row of a light that holds its radiance.
pub const RADIANCE_ROW: usize = 4;
/// `InstanceRecord::light` of a surface that is no light.
pub const NO_LIGHT: u32 = u32::MAX;
const SMOOTH: u32 = 1;
const COLORS: u32 = 2;
const TEXTURE: u32 = 4;
const LIGHT: u32 = 8;

/// The unit square that every visible light is an instance of: lit side +z.
static UNIT_QUAD: LazyLock<Arc<Mesh>> = LazyLock::new(|| {
    let corner = |x: f64, y: f64| DVec3::new(x, y, 0.0);
    let positions = vec![corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
    let input = MeshInput { positions, triangles: vec![[0, 1, 2], [0, 2, 3]], ..Default::default() };
    Arc::new(Mesh::new("unit quad of a light", input).expect("two proper triangles"))
});

/// Twin of `Instance` in `shaders/common/surface.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct InstanceRecord {
    /// Rows of the affine transform.
    pub scene_from_object: [[f32; 4]; 3],
    /// Rows of its inverse.
    pub object_from_scene: [[f32; 4]; 3],
    /// Constant factor of the albedo.
    pub albedo: [f32; 3],
    /// Smooth, vertex colours, texture, light.
    pub flags: u32,
    /// First word of the triangles in the geometry arena.
    pub triangles: u32,
    /// First word of the positions.
    pub positions: u32,
    /// First word of the normals.
    pub normals: u32,
    /// First word of the texture coordinates.
    pub uvs: u32,
    /// First word of the vertex colours.
    pub colors: u32,
    /// First texel of the base-colour texture.
    pub texture: u32,
    /// Columns.
    pub texture_width: u32,
    /// Rows.
    pub texture_height: u32,
    /// The light that this surface is, or `NO_LIGHT`.
    pub light: u32,
    /// Largest coordinate of the placed object's middle: part of the bound of a position's error (N5).
    pub extent: f32,
    /// Unused.
    pub pad0: u32,
    /// Unused.
    pub pad1: u32,
}

/// A mesh placed in scene space, for the records and for the trace.
#[derive(Debug, Clone)]
pub struct Placed {
    /// Shared geometry.
    pub mesh: Arc<Mesh>,
    /// Exact, before rounding.
    pub scene_from_object: DMat4,
    /// The light that it is.
    pub light: Option<u32>,
    /// Base-colour texture.
    pub texture: Option<Arc<Texture>>,
    /// All but the arena offsets.
    pub record: InstanceRecord,
    /// Specular reflectance and exponent.
    pub lobe: [f32; 4],
}

/// A snapshot in scene space.
#[derive(Debug, Clone)]
pub struct Prepared {
    /// World position of the scene space's origin.
    pub anchor: DVec3,
    /// Meshes, then visible lights.
    pub placed: Vec<Placed>,
    /// The lights' table without texels: area lights, then spots.
    pub light_rows: Vec<[f32; 4]>,
    /// For each light the texture whose texels follow in the table.
    pub light_textures: BTreeMap<usize, Arc<Texture>>,
    /// How many lights.
    pub lights: usize,
    /// How many of them are area lights.
    pub area_lights: usize,
}

impl Prepared {
    /// Whether a light emits nothing.
    pub fn is_dark(&self, light: usize) -> bool {
        self.light_rows[light * LIGHT_ROWS + RADIANCE_ROW][..3].iter().all(|&channel| channel <= 0.0)
    }

    /// What shaders must be able to do for the instances: twins of `SMOOTH`, `COLORS`, `TEXTURE` in
    /// `shaders/common/surface.wgsl`.
    pub fn features(&self) -> u32 {
        self.placed.iter().fold(0, |all, placed| all | placed.record.flags) & (SMOOTH | COLORS | TEXTURE)
    }

    /// `snapshot` must have passed its check.
    pub fn new(snapshot: &Snapshot) -> Self {
        let anchor = snapshot.anchor();
        let mut placed: Vec<Placed> = snapshot.instances.iter().map(|i| place(i, anchor)).collect();
        let mut light_rows = Vec::new();
        let mut light_textures = BTreeMap::new();
        for (index, light) in snapshot.area_lights.iter().enumerate() {
            if light.visible {
                placed.push(place_light(light, index as u32, anchor));
            }
            if let Radiance::Textured(texture) = &light.radiance {
                light_textures.insert(index, Arc::clone(texture));
            }
            light_rows.extend(area_light_rows(light, anchor));
        }
        light_rows.extend(snapshot.spot_lights.iter().flat_map(|s| spot_light_rows(s, anchor)));
        let mut first_texel = light_rows.len();
        for (&index, texture) in &light_textures {
            light_rows[index * LIGHT_ROWS + 5][0] = first_texel as f32;
            first_texel += texture.texels.len();
        }
        Self {
            anchor,
            placed,
            light_rows,
            light_textures,
            lights: snapshot.light_count(),
            area_lights: snapshot.area_lights.len(),
        }
    }

    /// How many triangles, instances counted each.
    pub fn triangles(&self) -> usize {
        self.placed.iter().map(|p| p.mesh.triangles.len()).sum()
    }
}

fn rows(m: DMat4) -> [[f32; 4]; 3] {
    [m.row(0), m.row(1), m.row(2)].map(|r| r.as_vec4().to_array())
}

fn record(scene_from_object: DMat4, albedo: Vec3, flags: u32) -> InstanceRecord {
    InstanceRecord {
        scene_from_object: rows(scene_from_object),
        object_from_scene: rows(scene_from_object.inverse()),
        albedo: albedo.to_array(),
        flags,
        light: NO_LIGHT,
        extent: scene_from_object.w_axis.truncate().abs().max_element() as f32,
        ..InstanceRecord::zeroed()
    }
}

/// The mesh's own origin and the scene's anchor are folded in, in float64 (N7).
fn place(instance: &Instance, anchor: DVec3) -> Placed {
    let mesh = &instance.mesh;
    let scene_from_object =
        DMat4::from_translation(-anchor) * instance.world_from_object * DMat4::from_translation(mesh.origin);
    let flag = |on: bool, bit: u32| if on { bit } else { 0 };
    let flags = flag(instance.smooth && mesh.normals.is_some(), SMOOTH)
        | flag(instance.vertex_colors && mesh.colors.is_some(), COLORS)
        | flag(instance.texture.is_some(), TEXTURE);
    Placed {
        mesh: Arc::clone(mesh),
        scene_from_object,
        light: None,
        texture: instance.texture.clone(),
        record: record(scene_from_object, instance.albedo, flags),
        lobe: instance.lobe,
    }
}

fn place_light(light: &AreaLight, index: u32, anchor: DVec3) -> Placed {
    let mesh = &*UNIT_QUAD;
    // Any third axis out of the plane makes the transform invertible; one of the light's size keeps it well scaled.
    let axis = light.normal() * light.area().sqrt();
    let columns = [light.edge_u.extend(0.0), light.edge_v.extend(0.0), axis.extend(0.0)];
    let corner = (light.corner - anchor).extend(1.0);
    let scene_from_object = DMat4::from_cols(columns[0], columns[1], columns[2], corner);
    let scene_from_object = scene_from_object * DMat4::from_translation(mesh.origin);
    let mut record = record(scene_from_object, Vec3::ZERO, LIGHT);
    record.light = index;
    Placed { mesh: Arc::clone(mesh), scene_from_object, light: Some(index), texture: None, record, lobe: [0.0; 4] }
}

fn row(v: DVec3, w: f64) -> [f32; 4] {
    DVec4::new(v.x, v.y, v.z, w).as_vec4().to_array()
}

/// Twin of `light_at` in `shaders/common/light.wgsl`.
fn area_light_rows(light: &AreaLight, anchor: DVec3) -> [[f32; 4]; LIGHT_ROWS] {
    let (width, height) = match &light.radiance {
        Radiance::Constant(_) => (0, 0),
        Radiance::Textured(texture) => (texture.width, texture.height),
    };
    [
        row(light.corner - anchor, 0.0),
        row(light.edge_u, f64::from(u8::from(light.two_sided))),
        row(light.edge_v, 0.0),
        row(light.normal(), light.area()),
        light.mean_radiance().extend(-2.0).to_array(),
        [0.0, width as f32, height as f32, f32::from(u8::from(light.linear_filter))],
    ]
}

fn spot_light_rows(light: &SpotLight, anchor: DVec3) -> [[f32; 4]; LIGHT_ROWS] {
    [
        row(light.position - anchor, 1.0),
        row(DVec3::ZERO, 1.0),
        row(DVec3::ZERO, 0.0),
        row(light.axis(), 1.0),
        light.intensity.extend(light.cutoff_degrees.to_radians().cos() as f32).to_array(),
        [0.0; 4],
    ]
}

/// nu × nv = n with cells as square as they can be on a light of these edge lengths.
pub fn strata_grid(n: u32, length_u: f64, length_v: f64) -> [u32; 2] {
    let aspect = (length_u / length_v).max(1e-30);
    (1..=n)
        .filter(|nu| n.is_multiple_of(*nu))
        .map(|nu| [nu, n / nu])
        .min_by(|a, b| {
            let stretch = |[nu, nv]: &[u32; 2]| (aspect * f64::from(*nv) / f64::from(*nu)).ln().abs();
            stretch(a).total_cmp(&stretch(b))
        })
        .unwrap_or([n, 1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strata_are_square_where_they_can_be() {
        assert_eq!(strata_grid(256, 1.0, 1.0), [16, 16]);
        assert_eq!(strata_grid(64, 4.0, 1.0), [16, 4]);
        assert_eq!(strata_grid(7, 1.0, 1.0)[0] * strata_grid(7, 1.0, 1.0)[1], 7);
        assert_eq!(strata_grid(1, 1.0, 9.0), [1, 1]);
    }

    #[test]
    fn far_scenes_are_rebased_exactly() {
        let far = DVec3::new(1e6, -2e6, 3e6);
        let light = |offset: DVec3| AreaLight {
            name: "l".into(),
            corner: DVec3::new(0.25, 0.5, 0.75) + offset,
            edge_u: DVec3::X,
            edge_v: DVec3::Z,
            radiance: Radiance::Constant(Vec3::ONE),
            two_sided: false,
            visible: true,
            linear_filter: false,
        };
        let near = Prepared::new(&Snapshot { area_lights: vec![light(DVec3::ZERO)], ..Default::default() });
        let moved = Prepared::new(&Snapshot { area_lights: vec![light(far)], ..Default::default() });
        assert_eq!(near.light_rows, moved.light_rows);
        assert_eq!(near.placed[0].record, moved.placed[0].record);
        assert_ne!(near.anchor, moved.anchor);
    }
}
