// A cut through the tree of virtual lights [NSW09 Sec. 3.5.1; WFA05]: the nodes that stand for all lights at one point,
// each as coarse as its error allows. Without a stack: nodes are visited in Morton order, and the one after a node that
// ends a group of four is the one after their parent. A plain list is a tree of one level.

import package::common::basis::PI;
import package::common::form_factor::{Lit, disc_irradiance, mean_of, unit_normal};
import package::common::near_lights::virtual_lights;
import package::common::virtual_light::tree_level_first;

const BOUND_PAPER: u32 = 0u;
const BOUND_CONTRIBUTION: u32 = 1u;
const BOUND_ERROR: u32 = 2u;

struct CutParams {
    roots: u32,         // end of the nodes of the coarsest level in use, of all maps
    coarsest: u32,
    finest: u32,
    maps: u32,
    bound: u32,
    threshold: f32,
    reach: f32,         // of a virtual light
    rays: u32,          // of a receiver
    seed: u32,
    maps_size: u32,     // texels along an edge of a map
    reference: u32,     // level that the irradiance is estimated at
    first_root: u32,    // of this part; `roots`: one past its last
    part: u32,
    parts: u32,         // of the coarsest level
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(10) var<uniform> params: CutParams;
@group(0) @binding(12) var<storage, read> ranges: array<vec4f>;

// Mesa's software renderer ends a loop after 65,535 rounds: nodes visited after so many are not split.
const MOST_VISITS: u32 = 40000u;

struct Visit {
    level: u32,
    number: u32,    // in its level, of all maps
    end: bool,
    count: u32,     // nodes visited before
}

fn first_visit(root: u32) -> Visit {
    return Visit(params.coarsest, root, root >= params.roots, 0u);
}

fn node_of(visit: Visit) -> u32 {
    return tree_level_first(visit.level, params.maps) + visit.number;
}

fn below(visit: Visit) -> Visit {
    return Visit(visit.level + 1u, 4u * visit.number, false, visit.count + 1u);
}

// Of the coarsest nodes every `step`-th is visited.
fn after(visit: Visit, step: u32) -> Visit {
    let number = visit.number + 1u;
    let up = min(firstTrailingBit(number) / 2u, visit.level - params.coarsest);
    let level = visit.level - up;
    let is_root = level == params.coarsest;
    let place = (number >> (2u * up)) + select(0u, step - 1u, is_root);
    return Visit(level, place, is_root & (place >= params.roots), visit.count + 1u);
}

// As coarse as possible: what thresholds are relative to. Of every `step`-th node from `start` on.
fn reference_irradiance(at: Lit, start: u32, step: u32) -> f32 {
    var sum = 0.0;
    let first = tree_level_first(params.reference, params.maps);
    let end = first + (params.maps << (2u * params.reference));
    for (var node = first + start; node < end; node += step) {
        let row = 4u * node;
        sum += mean_of(disc_irradiance(
            at, virtual_lights[row], virtual_lights[row + 1u], virtual_lights[row + 2u].xyz, true, params.reach));
    }
    return sum;
}

// Least and largest irradiance that the points of a node may give, as points or discs that together have its area, a unit
// of flux.
fn irradiance_bounds(at: Lit, place: vec4f, facing: vec4f, spread: f32, thickness: f32) -> vec2f {
    let d = place.xyz - at.position;
    let far = length(d);
    let radius = facing.w;
    let nearest = max(far - radius, 0.0);
    let turned = dot(at.normal_shade, facing.xyz);
    // Its points fill a slab in a ball: how far they reach along the lit point's normal.
    let along = min(radius, radius * sqrt(max(1.0 - turned * turned, 0.0)) + thickness * abs(turned));
    let height = dot(at.normal_shade, d);
    let behind = -dot(facing.xyz, d);
    let outermost = far + radius;
    let least_i = clamp((height - along) / outermost, 0.0, 1.0);
    let most_i = select(clamp((height + along) / nearest, 0.0, 1.0), 1.0, height + along >= nearest);
    let least_j = clamp((behind - thickness) / outermost - spread, 0.0, 1.0);
    let across = behind + thickness;
    let facing_most = select(across / select(nearest, outermost, across < 0.0), 1.0, across >= nearest);
    let most_j = clamp(facing_most + spread, 0.0, 1.0);
    let least = least_i * least_j / max(PI * outermost * outermost + place.w, 1e-37);
    let most = select(most_i * most_j, 0.0, height + along <= 0.0) / max(PI * nearest * nearest, 1e-37);
    return vec2f(min(least, most), most);
}

// What is known of a node at a lit point: whether it is to be split, and what a unit of its flux may give at most.
struct Judged {
    split: bool,
    most: f32,
}

// BOUND_PAPER [NSW09 Eq. 8]: |V_ij|^2 <= T_l |V_j|^2 with the node's largest distance from the
// light; Deviation: T_l goes by the node's own solid angle, not by that of the finest, and by its own flux (its B is
// flux / (pi d^2 / A' + 1), A' = omega |V_j|^2).
fn judged(at: Lit, visit: Visit, scale: f32) -> Judged {
    let node = node_of(visit);
    let row = 4u * node;
    let place = virtual_lights[row];
    let mean_normal = virtual_lights[row + 1u];
    let facing = vec4f(unit_normal(mean_normal), mean_normal.w);
    let flux = virtual_lights[row + 2u];
    let shape = virtual_lights[row + 3u];
    let power = mean_of(flux.xyz);
    let bounds = irradiance_bounds(at, place, facing, shape.x, shape.y);
    var split = false;
    if params.bound == BOUND_PAPER {
        let d = place.xyz - at.position;
        let depth = ranges[2u * node + 1u].w;
        let projected = flux.w * depth * depth;
        // flux A' / (pi d^2 + A') / A' > tau
        split = power > params.threshold * (PI * dot(d, d) + projected);
    } else {
        let most = select(bounds.y - bounds.x, bounds.y, params.bound == BOUND_CONTRIBUTION);
        split = power * most > params.threshold * scale;
    }
    let may = (power > 0.0) & (visit.level < params.finest) & (visit.count < MOST_VISITS);
    return Judged(split & may, bounds.y);
}
