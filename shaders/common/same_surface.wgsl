// Whether a pixel lies on the surface that another one sees: near its tangent plane, facing its way.

import package::common::alike::MOST_TURNED;
import package::common::gbuffer::{SURFACE, floats};
import package::common::illumination::MOST_OFF;
import package::common::pyramid::pyramid;
import package::common::view::View;

@group(0) @binding(1) var<uniform> view: View;
@group(0) @binding(3) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(4) var<storage, read> g_normal: array<vec4u>;
@group(0) @binding(5) var<storage, read> g_geometric: array<vec4u>;

// What a pixel sees, and how far off its plane something may lie.
struct Surface {
    position: vec3f,
    normal: vec3f,
    across: vec3f,
    reach: f32,
}

// That of a pixel of a fragment of this level.
fn surface_at(at: u32, level: u32) -> Surface {
    let p = floats(g_position[at]);
    let depth = max(dot(view.eye - p, view.backward), 1e-30);
    let reach = MOST_OFF * f32(1u << level) * pyramid.pixel_width * depth;
    return Surface(p, floats(g_normal[at]), floats(g_geometric[at]), reach);
}

fn lies_on(s: Surface, at: u32) -> bool {
    let facing = g_normal[at];
    let off = abs(dot(s.across, floats(g_position[at]) - s.position));
    let turned = floats(facing) - s.normal;
    return facing.w == SURFACE && off < s.reach && dot(turned, turned) < MOST_TURNED * MOST_TURNED;
}
