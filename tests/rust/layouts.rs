//! Host structs and constants equal their twins in the shaders; no struct that crosses the border is without one.

mod level_layouts;

use std::collections::BTreeSet;

use miplight::gpu::layout::{Layout, same, shader_layout};
use miplight::gpu::{self, Gpu, Usage, never};
use miplight::host_layout;
use miplight::passes::composite::composite::CompositeParams;
use miplight::passes::composite::downsample::DownsampleParams;
use miplight::passes::gather::fragment_receivers::FragmentReceiversParams;
use miplight::passes::gather::gather::GatherParams;
use miplight::passes::gather::irradiance::IrradianceParams;
use miplight::passes::gather::receivers::ReceiversParams;
use miplight::passes::gather::textured_share::{LightNode, MomentsParams};
use miplight::passes::indirect::{GatherPath, GatherWave};
use miplight::passes::lights::light_samples::LightSamplesParams;
use miplight::passes::refine::compact::CompactParams;
use miplight::passes::refine::light_bounds::{LightBoundsParams, LightFrame, TileBounds};
use miplight::passes::refine::list_params::{self, ListParams};
use miplight::passes::refine::one_pass::OnePassParams;
use miplight::passes::refine::penumbra::PenumbraParams;
use miplight::passes::refine::pyramid::Pyramid;
use miplight::passes::refine::uniform_levels::UniformLevelsParams;
use miplight::passes::visibility::prove::ProveParams;
use miplight::passes::visibility::{Hit, Ray, Receiver};
use miplight::passes::{TILE, TILE_PIXELS, View};
use miplight::scene::prepare::{InstanceRecord, LIGHT_ROWS, NO_LIGHT, Prepared};

/// Twins by their place in the shaders.
fn twins() -> Vec<(Layout, &'static str, &'static str)> {
    let ray = host_layout!(Ray { origin, t_min, direction, t_max });
    let hit = host_layout!(Hit { t, u, v, instance, triangle });
    let receiver = host_layout!(Receiver { origin, pattern, normal_geo, flags, normal_shade, pixel });
    let path = host_layout!(GatherPath { throughput, pixel, pending, stratum, slope, pad });
    let gather = host_layout!(GatherParams { strata, words, light, pad });
    let composite = host_layout!(CompositeParams { direct, indirect, pad0, pad1 });
    let downsample = host_layout!(DownsampleParams { width, height, factor, pad });
    let compact = host_layout!(CompactParams { items, mask, value, scanned });
    let fragments = host_layout!(FragmentReceiversParams { first, patterns, seed, pad });
    let pyramid = host_layout!(Pyramid { levels, coarsest, finest, level, pixel_width });
    let receivers = host_layout!(ReceiversParams { width, height, first, patterns, seed, pad0, pad1, pad2 });
    let node = host_layout!(LightNode { place, pad, moment });
    let moments = host_layout!(MomentsParams { mean, cell_area, fine, coarse, pad0, pad1 });
    let mut all = adaptive();
    all.extend(level_layouts::twins());
    all.extend(vec![
        (irradiance(), "common/light_pixel", "IrradianceParams"),
        (node, "passes/gather/textured_share", "LightNode"),
        (moments, "passes/gather/textured_share", "MomentsParams"),
        (ray, "common/ray", "Ray"),
        (hit, "common/ray", "Hit"),
        (receiver, "common/ray", "Receiver"),
        (path, "common/gather_path", "GatherPath"),
        (gather_wave(), "common/gather_path", "GatherWave"),
        (view(), "common/view", "View"),
        (instance(), "common/surface", "Instance"),
        (light_samples(), "passes/lights/light_samples", "LightSamplesParams"),
        (receivers, "passes/gather/receivers", "ReceiversParams"),
        (gather, "common/gather_params", "GatherParams"),
        (fragments, "passes/gather/fragment_receivers", "FragmentReceiversParams"),
        (pyramid, "common/pyramid", "Pyramid"),
        (one_pass(), "common/rough_texel", "OnePassParams"),
        (compact, "passes/refine/compact", "CompactParams"),
        (composite, "passes/composite/composite", "CompositeParams"),
        (downsample, "passes/composite/downsample", "DownsampleParams"),
    ]);
    all
}

/// Those of the passes that decide what is worth a ray.
fn adaptive() -> Vec<(Layout, &'static str, &'static str)> {
    let frame = host_layout!(LightFrame { corner, extent_a, dual_u, extent_b, dual_v, two_sided, normal, cos_cutoff });
    let bounds = host_layout!(TileBounds { lo, facing, hi, pad });
    let prove = host_layout!(ProveParams { width, height, pad0, pad1 });
    let list = host_layout!(ListParams {
        width,
        height,
        light,
        patterns,
        seed,
        first,
        blocks_u,
        reuse,
        boosts,
        pad0,
        pad1,
        pad2
    });
    let light_bounds = host_layout!(LightBoundsParams { width, height, light, unshadowed });
    let levels = host_layout!(UniformLevelsParams { width, height, slot, coarsest, own_pixels, again, last, pad });
    let penumbra = host_layout!(PenumbraParams {
        width,
        height,
        first,
        most_subs,
        light_size,
        untraced,
        one,
        four,
        narrow,
        wide,
        calm,
        pad
    });
    vec![
        (frame, "common/light_frame", "LightFrame"),
        (bounds, "common/light_frame", "TileBounds"),
        (prove, "passes/visibility/prove", "ProveParams"),
        (list, "common/list_params", "ListParams"),
        (light_bounds, "passes/refine/light_bounds", "LightBoundsParams"),
        (levels, "passes/refine/uniform_levels", "UniformLevelsParams"),
        (penumbra, "passes/refine/penumbra", "PenumbraParams"),
    ]
}

fn one_pass() -> Layout {
    host_layout!(OnePassParams { depth_threshold, normal_threshold, lights, pad })
}

fn view() -> Layout {
    host_layout!(View { eye, width, right, height, up, fx, backward, fy, cx, cy, first, tiled })
}

fn irradiance() -> Layout {
    host_layout!(IrradianceParams {
        corner,
        width,
        axis_x,
        height,
        axis_y,
        two_sided,
        axis_z,
        tiles,
        radiance,
        textured,
        edge,
        along_v,
        size,
        cos_cutoff,
        kind,
        first_node,
        nodes,
        pad
    })
}

fn gather_wave() -> Layout {
    host_layout!(GatherWave {
        width,
        height,
        first_tile,
        tiles,
        first_stratum,
        strata,
        strata_u,
        strata_v,
        lights,
        seed,
        bounce,
        last
    })
}

fn instance() -> Layout {
    host_layout!(InstanceRecord {
        scene_from_object,
        object_from_scene,
        albedo,
        flags,
        triangles,
        positions,
        normals,
        uvs,
        colors,
        texture,
        texture_width,
        texture_height,
        light,
        extent,
        pad0,
        pad1
    })
}

fn light_samples() -> Layout {
    host_layout!(LightSamplesParams { light, strata_u, strata_v, patterns, seed, jittered, t_max, classes })
}

#[test]
fn twins_have_the_same_layout() {
    for (host, stem, name) in twins() {
        let shader = shader_layout(stem, name).unwrap();
        same(&host, &shader).unwrap_or_else(|e| panic!("shaders/{stem}.wgsl: {e}"));
        // Negative control: fields in another order, a field more and a field less are all seen.
        let mut turned = host.clone();
        turned.fields.reverse();
        assert!(same(&turned, &shader).is_err(), "{name}");
        let mut short = host.clone();
        short.fields.pop();
        assert!(same(&short, &shader).is_err(), "{name}");
        let mut long = host;
        long.size += 16;
        assert!(same(&long, &shader).is_err(), "{name}");
    }
}

/// Structs of the trace, whose twins `trace_forms` and `gpu_base` prove.
const ELSEWHERE: [(&str, &str); 9] = [
    ("common/grid", "Grid"),
    ("common/bvh", "Node"),
    ("common/bvh", "Placed"),
    ("common/bvh", "Triangle"),
    ("common/bvh", "TopLevel"),
    ("common/shadow_query", "ShadowParams"),
    ("common/voxels", "Voxels"),
    ("passes/visibility/voxelize", "VoxelizeParams"),
    ("common/shadow_map", "MapParams"),
];

/// Names of the structs that the buffers of a shader hold.
fn bound_structs(stem: &str) -> BTreeSet<String> {
    use wgpu::naga::{AddressSpace, TypeInner};
    let module = gpu::compile(stem, None).unwrap().module;
    let bound = module
        .global_variables
        .iter()
        .filter(|(_, variable)| matches!(variable.space, AddressSpace::Storage { .. } | AddressSpace::Uniform));
    let held = bound.map(|(_, variable)| match module.types[variable.ty].inner {
        TypeInner::Array { base, .. } => base,
        _ => variable.ty,
    });
    let named = held.filter_map(|ty| match &module.types[ty].inner {
        TypeInner::Struct { .. } => module.types[ty].name.clone(),
        _ => None,
    });
    named.collect()
}

#[test]
fn every_struct_in_a_buffer_has_a_tested_twin() {
    let mut known: BTreeSet<(String, String)> =
        twins().iter().map(|(_, stem, name)| ((*stem).to_owned(), (*name).to_owned())).collect();
    known.extend(ELSEWHERE.map(|(stem, name)| (stem.to_owned(), name.to_owned())));
    let mut met = BTreeSet::new();
    for stem in gpu::files() {
        for name in bound_structs(&stem) {
            // Imported names carry their file: `Ray__common_ray`; the file's own are bare.
            let twin = known.iter().find(|(file, plain)| {
                (*file == stem && *plain == name)
                    || name.split_once("__").is_some_and(|(n, f)| n == plain && f == file.replace('/', "_"))
            });
            let twin = twin.unwrap_or_else(|| panic!("shaders/{stem}.wgsl binds {name}, whose layout no test proves"));
            met.insert(twin.clone());
        }
    }
    assert_eq!(met, known, "every twin is bound somewhere");
}

#[test]
fn constants_are_the_same_on_both_sides() {
    let text = "
import package::common::cells::{PLAN_TRACED, PLAN_ZONE, TILE_CELLS};
import package::common::gather_path::NO_PIXEL;
import package::common::light_frame::{BACK, CLIPPED, DARK, FACING, FAR, LIT, MIXED_SIDES, NEAR, ON_SURFACE};
import package::common::strata::{STRATA, WORDS};
import package::common::gbuffer::{FIRST_LIGHT, NOTHING, SURFACE};
import package::common::light::{AREA, LIGHT_ROWS, SPOT};
import package::common::ray::MISS;
import package::common::surface::{COLORS, LIGHT, NO_LIGHT, SMOOTH, TEXTURE};
import package::common::tiles::{TILE, TILE_PIXELS};
@group(0) @binding(0) var<storage, read_write> out: array<u32>;
@compute @workgroup_size(1)
fn main() {
    out[0] = TILE;
    out[1] = TILE_PIXELS;
    out[2] = LIGHT_ROWS;
    out[3] = NO_LIGHT;
    out[4] = MISS;
    out[5] = NO_PIXEL;
    out[6] = AREA;
    out[7] = SPOT;
    out[8] = SMOOTH | (COLORS << 8u) | (TEXTURE << 16u) | (LIGHT << 24u);
    out[9] = NOTHING | (SURFACE << 8u) | (FIRST_LIGHT << 16u);
    out[10] = STRATA | (WORDS << 16u) | (TILE_CELLS << 24u);
    out[11] = PLAN_ZONE | (PLAN_TRACED << 8u);
    out[12] = FACING | (ON_SURFACE << 8u) | (BACK << 16u) | (MIXED_SIDES << 24u);
    out[13] = CLIPPED | (NEAR << 8u) | (FAR << 16u);
    out[14] = LIT | (DARK << 16u);
}";
    let device = Gpu::new("auto").unwrap();
    let kernel = device.kernel_from_text("tests/constants", text, "main", &[]).unwrap();
    let out = device.buffer::<u32>("out", 15, Usage::Storage).unwrap();
    let mut recorder = device.record(never()).unwrap();
    recorder.pass("constants", &kernel).bind("out", &out).dispatch_groups(1).unwrap();
    recorder.finish().unwrap();
    let found = device.read(&out).unwrap();
    let [area, spot] = kinds();
    let flags = u32::from_le_bytes([1, 2, 4, 8]);
    let host =
        [TILE, TILE_PIXELS, LIGHT_ROWS as u32, NO_LIGHT, Hit::MISS.instance, u32::MAX, area, spot, flags, 0x0002_0100];
    assert_eq!(found[..10], host);
    assert_eq!(found[10..], adaptive_constants());
}

fn adaptive_constants() -> [u32; 5] {
    use miplight::passes::gather::adaptive::{PLAN_TRACED, PLAN_ZONE};
    use miplight::passes::refine::light_bounds::flags as f;
    let sizes = list_params::STRATA | (list_params::WORDS as u32) << 16 | (list_params::TILE_CELLS as u32) << 24;
    let facing = f::FACING | f::SURFACE << 8 | f::BACK << 16 | f::MIXED_SIDES << 24;
    let place = f::CLIPPED | f::NEAR << 8 | f::FAR << 16;
    [sizes, PLAN_ZONE | PLAN_TRACED << 8, facing, place, f::LIT | f::DARK << 16]
}

/// What the host writes as an area light's kind and as a spot's.
fn kinds() -> [u32; 2] {
    let prepared = lights();
    [prepared.light_rows[0][3] as u32, prepared.light_rows[LIGHT_ROWS][3] as u32]
}

fn lights() -> Prepared {
    use glam::{DVec3, Vec3};
    use miplight::scene::light::{AreaLight, Radiance, SpotLight};
    use miplight::scene::snapshot::Snapshot;
    let area = AreaLight {
        name: "area".into(),
        corner: DVec3::ZERO,
        edge_u: DVec3::X,
        edge_v: DVec3::Y,
        radiance: Radiance::Constant(Vec3::ONE),
        two_sided: false,
        visible: true,
        linear_filter: false,
    };
    let spot = SpotLight {
        name: "spot".into(),
        position: DVec3::Z,
        target: DVec3::ZERO,
        intensity: Vec3::ONE,
        cutoff_degrees: 60.0,
    };
    Prepared::new(&Snapshot { area_lights: vec![area], spot_lights: vec![spot], ..Default::default() })
}

#[test]
fn the_host_writes_flags_where_the_shaders_read_them() {
    use glam::{DMat4, DVec3, Vec2, Vec3};
    use miplight::scene::material::Texture;
    use miplight::scene::mesh::{Mesh, MeshInput};
    use miplight::scene::snapshot::{Instance, Snapshot};
    use std::sync::Arc;
    let input = MeshInput {
        positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
        triangles: vec![[0, 1, 2]],
        normals: Some(vec![Vec3::Z; 3]),
        uvs: Some(vec![Vec2::ZERO; 3]),
        colors: Some(vec![Vec3::ONE; 3]),
    };
    let mesh = Arc::new(Mesh::new("triangle", input).unwrap());
    let texture = Arc::new(Texture::new(1, 1, vec![[1.0; 3]]).unwrap());
    let flags = |smooth: bool, vertex_colors: bool, textured: bool| {
        let instance = Instance {
            name: "triangle".into(),
            mesh: Arc::clone(&mesh),
            world_from_object: DMat4::IDENTITY,
            smooth,
            albedo: Vec3::ONE,
            texture: textured.then(|| Arc::clone(&texture)),
            vertex_colors,
            lobe: [0.0; 4],
        };
        Prepared::new(&Snapshot { instances: vec![instance], ..Default::default() }).placed[0].record.flags
    };
    assert_eq!(flags(true, false, false), 1);
    assert_eq!(flags(false, true, false), 2);
    assert_eq!(flags(false, false, true), 4);
    assert_eq!(flags(true, true, true), 7);
    assert_eq!(lights().placed[0].record.flags, 8);
    assert_eq!(lights().placed[0].record.light, 0);
}
