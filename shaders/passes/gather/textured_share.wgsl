// What a textured light's picture makes of its share: the factor int L w / (L_mean int w), w = cos_s cos_l / d^2, a
// channel each, wherever the light is seen whole. w is smooth where L is not, so only w is interpolated, by polynomials
// through nodes, and the picture is integrated against these beforehand: a node carries a moment of the picture beside
// its weight (product integration) [Deviation: of the picture's means over 32 x 32 cells].
//   moments  in: rule and basis of the nodes, means of the cells. Out: nodes.
//   factor   in: nodes, G-buffer, lists of tiles, flags, classes. In and out: share a pixel.

import package::common::grid::{group_index, not_uniform};
import package::common::light_pixel::{
    LightPixel, PART, UNSEEN, cell_state, g_geometric, g_normal, g_position, light_pixel, params, tile_flags, tile_list,
};

struct LightNode {
    place: vec2f,       // a, b
    pad: vec2f,
    moment: vec4f,      // of the picture over its mean; w: of a light without a picture
}

struct MomentsParams {
    mean: vec3f,        // radiance
    cell_area: f32,     // scene units
    fine: u32,          // nodes along an edge, first of the fine, then of the coarse table
    coarse: u32,
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(12) var<uniform> texture: MomentsParams;
@group(0) @binding(7) var<storage, read> rule: array<vec4f>;         // a, b and weight of a node
@group(0) @binding(8) var<storage, read> basis: array<f32>;          // integral of a node's polynomial over each cell
@group(0) @binding(9) var<storage, read> radiance_cells: array<vec4f>;
@group(0) @binding(10) var<storage, read_write> light_nodes: array<LightNode>;
@group(0) @binding(11) var<storage, read_write> share: array<vec4f>;

const CELLS: u32 = 32u;

// Place in `radiance_cells` of a cell: they come in blocks of 4 x 4 (light_samples.wgsl).
fn stratum_of(column: u32, row: u32) -> u32 {
    return ((row / 4u) * (CELLS / 4u) + column / 4u) * 16u + (row % 4u) * 4u + column % 4u;
}

var<workgroup> sums: array<vec3f, 64>;

// One workgroup a node.
@compute @workgroup_size(64)
fn moments(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let k = group_index(group, groups);
    let fine = texture.fine * texture.fine;
    let nodes = fine + texture.coarse * texture.coarse;
    let node = min(k, nodes - 1u);
    // Rows of `basis`: along a and along b alike.
    let along = select(texture.coarse, texture.fine, node < fine);
    let within = select(node - fine, node, node < fine);
    let head = select(texture.fine, 0u, node < fine);
    let across_a = (head + within % along) * CELLS;
    let across_b = (head + within / along) * CELLS;
    var sum = vec3f(0.0);
    for (var cell = lane; cell < CELLS * CELLS; cell += 64u) {
        let column = cell % CELLS;
        let row = cell / CELLS;
        sum += basis[across_a + column] * basis[across_b + row] * radiance_cells[stratum_of(column, row)].xyz;
    }
    sums[lane] = sum;
    workgroupBarrier();
    for (var half = 32u; half > 0u; half /= 2u) {
        if lane < half {
            sums[lane] += sums[lane + half];
        }
        workgroupBarrier();
    }
    if lane == 0u && k < nodes {
        // Cells hold radiance times area; where a channel is black its factor does not matter.
        let scale = 1.0 / max(texture.mean * texture.cell_area, vec3f(1e-37));
        light_nodes[k] = LightNode(rule[k].xy, vec2f(0.0), vec4f(sums[0] * scale, rule[k].z));
    }
}

// cos_s / d^4 towards a place on the light; its height is the same everywhere and cancels.
fn weight_at(p: LightPixel, place: vec2f) -> f32 {
    let y = p.corner + vec3f(place.x * params.edge.x + place.y * params.edge.y, place.y * params.edge.z, 0.0);
    let cos_s = dot(p.n, y);
    let inverse = 1.0 / max(dot(y, y), 1e-18);
    return select(0.0, cos_s * inverse * inverse, cos_s > 0.0 && dot(p.g, y) > 0.0);
}

fn write(p: LightPixel, seen: vec4f) {
    if p.live && p.seen != UNSEEN {
        // Between the nodes of a sliver above the horizon: the mean.
        let part = select(vec3f(1.0), max(seen.xyz / max(seen.w, 1e-37), vec3f(0.0)), seen.w > 0.0);
        let visible = select(vec3f(1.0), share[p.at].xyz, p.seen == PART);
        share[p.at] = vec4f(part * visible, 0.0);
    }
}

// One workgroup takes four tiles, because to load a node costs more than to use it.
@compute @workgroup_size(64)
fn factor(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let first = 4u * group_index(group, groups);
    let p0 = light_pixel(first, lane);
    let p1 = light_pixel(first + 1u, lane);
    let p2 = light_pixel(first + 2u, lane);
    let p3 = light_pixel(first + 3u, lane);
    var seen0 = vec4f(0.0);
    var seen1 = vec4f(0.0);
    var seen2 = vec4f(0.0);
    var seen3 = vec4f(0.0);
    let end = not_uniform(params.first_node + params.nodes, first);
    for (var k = params.first_node; k < end; k++) {
        let place = light_nodes[k].place;
        let moment = light_nodes[k].moment;
        seen0 += weight_at(p0, place) * moment;
        seen1 += weight_at(p1, place) * moment;
        seen2 += weight_at(p2, place) * moment;
        seen3 += weight_at(p3, place) * moment;
    }
    write(p0, seen0);
    write(p1, seen1);
    write(p2, seen2);
    write(p3, seen3);
}
