// BVH: rays through two levels of binary trees, one over the instances and one in each mesh.
// In     top_nodes, instances (in the order of the top level's leaves), mesh_nodes, triangles (in leaf order)
// Rule   nearer child first, one stack for both levels; boxes are entered with a margin that covers the roundings of
//        the slabs [Ize13] and of the triangle test, so that no hit of a triangle is culled. A hit counts when
//        t_min < t < t_max; a tie goes to the smaller instance, then to the smaller triangle.
// Limits the stack holds STACK entries; the host sees to it that no tree is deeper.

import package::common::ray::{Hit, MISS, Ray};
import package::common::triangle::{Shear, cross_triangle, shear_of};

struct Node {
    lo: vec3<f32>,
    first: u32, // inner: first of two children, side by side; leaf: first triangle, or the instance
    hi: vec3<f32>,
    count: u32, // triangles of a leaf; 0: inner
}

struct Placed {
    row_x: vec3<f32>, // linear part of object_from_scene, by rows
    node: u32,        // root in mesh_nodes; children count from it
    row_y: vec3<f32>,
    triangle: u32,    // first of the mesh's triangles
    row_z: vec3<f32>,
    id: u32,          // as hits name it
    center: vec3<f32>, // the object's origin in scene space
    reach: f32,       // largest coordinate in object space, or below zero: the linear part is the identity
}

struct Triangle {
    a: vec3<f32>,
    id: u32, // index in its mesh
    b: vec3<f32>,
    pad_b: u32,
    c: vec3<f32>,
    pad_c: u32,
}

struct TopLevel {
    nodes: u32, // 0: nothing to hit
}

@group(1) @binding(0) var<storage, read> top_nodes: array<Node>;
@group(1) @binding(1) var<storage, read> instances: array<Placed>;
@group(1) @binding(2) var<storage, read> mesh_nodes: array<Node>;
@group(1) @binding(3) var<storage, read> triangles: array<Triangle>;
@group(1) @binding(4) var<uniform> top_level: TopLevel;

// Entries of the stack: one a level, and one for the way back from a mesh.
const STACK: u32 = 64u;
// A node on the stack: its level, its count and its first child, triangle or instance (2^28 of each at most).
const TOP: u32 = 0x80000000u;
const COUNT_SHIFT: u32 = 28u;
const COUNT_MASK: u32 = 7u;
const FIRST_MASK: u32 = 0x0fffffffu;
// On the stack: the ray leaves the mesh.
const LEAVE: u32 = 0xffffffffu;

// A direction's component below this share of the largest is raised to it for the boxes (2^-32): no reciprocal is
// infinite, and the shift is far inside MARGIN.
const FLAT: f32 = 2.3283064365386963e-10;
// Margin of the boxes as a share of |origin| + |box|: 16 units in the last place.
const MARGIN: f32 = 9.5367431640625e-7;
// Stands for an endless ray: devices may not know infinity.
const FAR: f32 = 3.0e38;

// A ray as a tree sees it.
struct Local {
    origin: vec3<f32>,
    inverse: vec3<f32>,
    near: vec3<f32>, // a near plane at p is reached at p * inverse + near, not later
    far: vec3<f32>,  // a far plane at p * inverse + far, not sooner
}

fn local_ray(origin: vec3<f32>, direction: vec3<f32>, reach: f32) -> Local {
    let size = abs(direction);
    let floor = max(max(size.x, size.y), size.z) * FLAT;
    let inverse = 1.0 / select(direction, vec3<f32>(floor), size < vec3<f32>(floor));
    let out = abs(origin);
    let margin = (max(max(out.x, out.y), out.z) + reach) * MARGIN;
    let at = -origin * inverse;
    let slack = margin * abs(inverse);
    return Local(origin, inverse, at - slack, at + slack);
}

// Where a ray enters a box, FAR when it does not before `end`.
fn enter_box(node: Node, ray: Local, start: f32, end: f32) -> f32 {
    let back = ray.inverse < vec3<f32>(0.0);
    let near = fma(select(node.lo, node.hi, back), ray.inverse, ray.near);
    let far = fma(select(node.hi, node.lo, back), ray.inverse, ray.far);
    let first = max(max(near.x, near.y), max(near.z, start));
    let last = min(min(far.x, far.y), min(far.z, end));
    return select(FAR, first, first <= last);
}

fn usable(value: vec3<f32>) -> bool {
    // By bits: compilers may take it that nothing is infinite or NaN.
    let exponent = vec3<u32>(0x7f800000u);
    return all((bitcast<vec3<u32>>(value) & exponent) != exponent);
}

// True when the ray can hit something by the rules of the trace.
fn active_ray(ray: Ray) -> bool {
    return usable(ray.origin) && usable(ray.direction) && any(ray.direction != vec3<f32>(0.0)) && ray.t_min < ray.t_max;
}

fn rotate(v: vec3<f32>, placed: Placed) -> vec3<f32> {
    let x = fma(v.x, placed.row_x.x, fma(v.y, placed.row_x.y, v.z * placed.row_x.z));
    let y = fma(v.x, placed.row_y.x, fma(v.y, placed.row_y.y, v.z * placed.row_y.z));
    let z = fma(v.x, placed.row_z.x, fma(v.y, placed.row_z.y, v.z * placed.row_z.z));
    return vec3<f32>(x, y, z);
}

// A ray on its way: the space that it is in, what it has met, and what is left to visit.
struct Walk {
    local: Local,
    shear: Shear,
    hit: Hit,
    instance: u32,
    mesh_node: u32,     // first node and first triangle of the mesh that it is in
    mesh_triangle: u32,
    depth: u32,
    stack: array<u32, STACK>,
}

// A node as the stack keeps it: what the next step needs, without loading it again.
fn packed(node: Node, top: u32) -> u32 {
    return top | (node.count << COUNT_SHIFT) | node.first;
}

fn push(walk: ptr<function, Walk>, entry: u32) {
    (*walk).stack[(*walk).depth] = entry;
    (*walk).depth++;
}

// The nearer of two children that the ray enters, the other one on the stack; LEAVE when it enters none.
fn descend(walk: ptr<function, Walk>, start: f32, top: u32, first: u32) -> u32 {
    var left: Node;
    var right: Node;
    if top != 0u {
        left = top_nodes[first];
        right = top_nodes[first + 1u];
    } else {
        left = mesh_nodes[(*walk).mesh_node + first];
        right = mesh_nodes[(*walk).mesh_node + first + 1u];
    }
    let to_left = enter_box(left, (*walk).local, start, (*walk).hit.t);
    let to_right = enter_box(right, (*walk).local, start, (*walk).hit.t);
    let swap = to_right < to_left;
    if max(to_left, to_right) < FAR {
        push(walk, select(packed(right, top), packed(left, top), swap));
    }
    let near = select(packed(left, top), packed(right, top), swap);
    return select(LEAVE, near, min(to_left, to_right) < FAR);
}

// Takes the ray into an instance; returns the root of its mesh.
fn enter_mesh(walk: ptr<function, Walk>, ray: Ray, slot: u32) -> u32 {
    let placed = instances[slot];
    var direction = ray.direction;
    var origin = ray.origin - placed.center;
    if placed.reach >= 0.0 {
        direction = rotate(direction, placed);
        origin = rotate(origin, placed);
    }
    (*walk).local = local_ray(origin, direction, abs(placed.reach));
    (*walk).shear = shear_of(direction);
    (*walk).instance = placed.id;
    (*walk).mesh_node = placed.node;
    (*walk).mesh_triangle = placed.triangle;
    push(walk, LEAVE);
    return packed(mesh_nodes[placed.node], 0u);
}

fn test_triangles(walk: ptr<function, Walk>, t_min: f32, first: u32, count: u32) {
    let instance = (*walk).instance;
    let origin = (*walk).local.origin;
    for (var i = 0u; i < count; i++) {
        let t = triangles[(*walk).mesh_triangle + first + i];
        let c = cross_triangle(t.a - origin, t.b - origin, t.c - origin, (*walk).shear);
        let best = (*walk).hit;
        let tie = c.t == best.t && best.instance != MISS
            && (instance < best.instance || (instance == best.instance && t.id < best.triangle));
        if c.hit && c.t > t_min && (c.t < best.t || tie) {
            (*walk).hit = Hit(c.t, c.u, c.v, instance, t.id);
        }
    }
}

// What an active ray meets first; with `first_found`, any hit as soon as there is one.
fn trace_ray(ray: Ray, first_found: bool) -> Hit {
    var walk: Walk;
    walk.hit = Hit(min(ray.t_max, FAR), 0.0, 0.0, MISS, MISS);
    if top_level.nodes == 0u {
        return walk.hit;
    }
    let reach = max(abs(top_nodes[0].lo), abs(top_nodes[0].hi));
    let scene = local_ray(ray.origin, ray.direction, max(max(reach.x, reach.y), reach.z));
    walk.local = scene;
    var at = packed(top_nodes[0], TOP);
    loop {
        let top = at & TOP;
        let count = (at >> COUNT_SHIFT) & COUNT_MASK;
        let first = at & FIRST_MASK;
        at = LEAVE;
        if count == 0u {
            at = descend(&walk, ray.t_min, top, first);
        } else if top != 0u {
            at = enter_mesh(&walk, ray, first);
        } else {
            test_triangles(&walk, ray.t_min, first, count);
            if first_found && walk.hit.instance != MISS {
                return walk.hit;
            }
        }
        while at == LEAVE {
            if walk.depth == 0u {
                return walk.hit;
            }
            walk.depth--;
            at = walk.stack[walk.depth];
            if at == LEAVE {
                walk.local = scene;
            }
        }
    }
    return walk.hit;
}
