// Radiance towards the eye. In: G-buffer, irradiance, specular radiance. Out: three images.
//   main      emitted + albedo/pi (E_direct + E_indirect)
//   specular  adds what lobes reflect of the lights; of virtual lights with the indirect image bound as `direct`
//   modulate  darkens indirect light by a max(v . n, 0) + 1 - a [NW09 Sec. 4.2]: a look that has no physics

import package::common::basis::PI;
import package::common::gbuffer::{FIRST_LIGHT, NOTHING, SURFACE, floats};
import package::common::grid::{Grid, item_index};
import package::common::light::{light_at, light_radiance_at, lights};

struct CompositeParams {
    direct: u32,
    indirect: u32,
    pad0: u32,
    pad1: u32,
}

struct ModulateParams {
    eye: vec3f,
    modulation: f32,
}

// Whether some light has a picture: if not, nothing of one is loaded.
override PICTURES: bool = true;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: CompositeParams;
@group(0) @binding(9) var<uniform> look: ModulateParams;
@group(0) @binding(10) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(1) var<storage, read> g_normal: array<vec4u>;
@group(0) @binding(2) var<storage, read> g_albedo: array<vec4u>;
@group(0) @binding(3) var<storage, read> direct_irradiance: array<vec4f>;
@group(0) @binding(4) var<storage, read> indirect_irradiance: array<vec4f>;
@group(0) @binding(8) var<storage, read> specular_radiance: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> image: array<vec4f>;
@group(0) @binding(6) var<storage, read_write> direct: array<vec4f>;
@group(0) @binding(7) var<storage, read_write> indirect: array<vec4f>;

fn emitted(kind: u32, seen: vec3f) -> vec3f {
    let light = light_at(kind - FIRST_LIGHT);
    let lit = light.two_sided || seen.z > 0.5;
    if PICTURES {
        return select(vec3f(0.0), light_radiance_at(light, seen.xy), lit);
    }
    return select(vec3f(0.0), light.radiance, lit);
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let kind = g_normal[i].w;
    let color = floats(g_albedo[i]);
    var out = vec3f(0.0);
    var out_direct = vec3f(0.0);
    var out_indirect = vec3f(0.0);
    if kind >= FIRST_LIGHT {
        out = emitted(kind, color);
    } else if kind == SURFACE {
        if params.direct != 0u {
            out_direct = color / PI * direct_irradiance[i].xyz;
        }
        if params.indirect != 0u {
            out_indirect = color / PI * indirect_irradiance[i].xyz;
        }
        out = out_direct + out_indirect;
    }
    image[i] = vec4f(out, 1.0);
    direct[i] = vec4f(out_direct, 1.0);
    if params.indirect != 0u {
        indirect[i] = vec4f(out_indirect, 1.0);
    }
}

@compute @workgroup_size(64)
fn specular(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i < grid.end {
        let reflected = vec4f(specular_radiance[i].xyz, 0.0);
        image[i] += reflected;
        direct[i] += reflected;
    }
}

@compute @workgroup_size(64)
fn modulate(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i < grid.end && g_normal[i].w == SURFACE {
        let towards = normalize(look.eye - floats(g_position[i]));
        let kept = 1.0 - look.modulation * (1.0 - max(dot(towards, floats(g_normal[i])), 0.0));
        let lost = vec4f((1.0 - kept) * indirect[i].xyz, 0.0);
        indirect[i] -= lost;
        image[i] -= lost;
    }
}
