// From a hit to a surface: position, normals, albedo. Imported by every pass that shades a hit.

import package::common::ray::{Hit, MISS};

const SMOOTH: u32 = 1u;
const COLORS: u32 = 2u;
const TEXTURE: u32 = 4u;
const LIGHT: u32 = 8u;
const NO_LIGHT: u32 = 0xffffffffu;

// How far a ray starts off its surface, as a share of the largest coordinate of the triangle (N5), however near to the
// middle of it the ray starts: 32 roundings of 2^-24 for the barycentric sum, the transform to scene space, the way back
// and the corners relative to the origin. Of 400,000 random rays all are clear of their triangle from 8 on, and in a
// transform that squeezes 100 : 1 from 24 on.
const ORIGIN_ERROR: f32 = 1.9073486e-6;

struct Instance {
    scene_from_object: array<vec4f, 3>,
    object_from_scene: array<vec4f, 3>,
    albedo: vec3f,
    flags: u32,
    triangles: u32,
    positions: u32,
    normals: u32,
    uvs: u32,
    colors: u32,
    texture: u32,
    texture_width: u32,
    texture_height: u32,
    light: u32,
    extent: f32,
    pad0: u32,
    pad1: u32,
}

struct Surface {
    position: vec3f,
    origin_error: f32,
    normal_geo: vec3f,
    light: u32,
    normal_shade: vec3f,
    front: bool,
    albedo: vec3f,
    uv: vec2f,
}

@group(0) @binding(20) var<storage, read> geometry: array<u32>;
@group(0) @binding(21) var<storage, read> instances: array<Instance>;
@group(0) @binding(22) var<storage, read> texels: array<vec2u>;

fn geometry_vec2(offset: u32, vertex: u32) -> vec2f {
    let i = offset + 2u * vertex;
    return vec2f(bitcast<f32>(geometry[i]), bitcast<f32>(geometry[i + 1u]));
}

fn geometry_vec3(offset: u32, vertex: u32) -> vec3f {
    let i = offset + 3u * vertex;
    return vec3f(bitcast<f32>(geometry[i]), bitcast<f32>(geometry[i + 1u]), bitcast<f32>(geometry[i + 2u]));
}

fn texel(base: u32, width: u32, column: i32, row: i32, height: u32) -> vec3f {
    // Repeat, also for negative places.
    let c = u32(((column % i32(width)) + i32(width)) % i32(width));
    let r = u32(((row % i32(height)) + i32(height)) % i32(height));
    let packed = texels[base + r * width + c];
    return vec3f(unpack2x16float(packed.x), unpack2x16float(packed.y).x);
}

// Bilinear, repeating; v = 0 is the bottom of the picture, whose row 0 is the top.
fn texture_color(at: Instance, uv: vec2f) -> vec3f {
    let size = vec2f(f32(at.texture_width), f32(at.texture_height));
    let wrapped = uv - floor(uv);
    let p = vec2f(wrapped.x, 1.0 - wrapped.y) * size - 0.5;
    let corner = floor(p);
    let f = p - corner;
    let c = i32(corner.x);
    let r = i32(corner.y);
    let w = at.texture_width;
    let h = at.texture_height;
    let top = mix(texel(at.texture, w, c, r, h), texel(at.texture, w, c + 1, r, h), f.x);
    let bottom = mix(texel(at.texture, w, c, r + 1, h), texel(at.texture, w, c + 1, r + 1, h), f.x);
    return mix(top, bottom, f.y);
}

fn scene_direction(at: Instance, v: vec3f) -> vec3f {
    return vec3f(
        dot(at.scene_from_object[0].xyz, v),
        dot(at.scene_from_object[1].xyz, v),
        dot(at.scene_from_object[2].xyz, v),
    );
}

// Largest coordinate in scene space, relative to the object's origin, of points whose coordinates reach to `corner`.
fn scene_reach(at: Instance, corner: vec3f) -> f32 {
    let x = dot(abs(at.scene_from_object[0].xyz), corner);
    let y = dot(abs(at.scene_from_object[1].xyz), corner);
    let z = dot(abs(at.scene_from_object[2].xyz), corner);
    return max(x, max(y, z));
}

// Unit even where the squares of the components would underflow.
fn safe_normalize(v: vec3f) -> vec3f {
    let largest = max(abs(v.x), max(abs(v.y), abs(v.z)));
    return select(vec3f(0.0, 0.0, 1.0), normalize(v / largest), largest > 0.0);
}

fn barycentric(a: vec3f, b: vec3f, c: vec3f, u: f32, v: f32) -> vec3f {
    return a + u * (b - a) + v * (c - a);
}

fn surface_albedo(at: Instance, flags: u32, corners: vec3u, u: f32, v: f32, uv: vec2f) -> vec3f {
    var albedo = at.albedo;
    if (flags & COLORS) != 0u {
        albedo *= barycentric(
            geometry_vec3(at.colors, corners.x),
            geometry_vec3(at.colors, corners.y),
            geometry_vec3(at.colors, corners.z), u, v);
    }
    if (flags & TEXTURE) != 0u {
        albedo *= texture_color(at, uv);
    }
    return albedo;
}

// The surface at `hit`, seen along `direction`: the geometric normal is turned towards the viewer, and so is the
// shading normal, each by its own sign, as Mitsuba's `twosided` does (N10).
fn surface_at(hit: Hit, direction: vec3f) -> Surface {
    return surface_with(hit, direction, SMOOTH | COLORS | TEXTURE);
}

// The same where no instance has other features than `features`: given as a constant, it leaves out the code and the
// loads of the others, which a device without branches would execute for every hit.
fn surface_with(hit: Hit, direction: vec3f, features: u32) -> Surface {
    let at = instances[hit.instance];
    let flags = at.flags & features;
    let first = at.triangles + 3u * hit.triangle;
    let corners = vec3u(geometry[first], geometry[first + 1u], geometry[first + 2u]);
    let a = geometry_vec3(at.positions, corners.x);
    let b = geometry_vec3(at.positions, corners.y);
    let c = geometry_vec3(at.positions, corners.z);
    let e1 = b - a;
    let e2 = c - a;
    let local = a + hit.u * e1 + hit.v * e2;

    var s: Surface;
    s.position = scene_direction(at, local)
        + vec3f(at.scene_from_object[0].w, at.scene_from_object[1].w, at.scene_from_object[2].w);
    s.origin_error = ORIGIN_ERROR * (scene_reach(at, max(abs(a), max(abs(b), abs(c)))) + at.extent);
    let geometric = safe_normalize(cross(safe_normalize(scene_direction(at, e1)), safe_normalize(scene_direction(at, e2))));
    s.front = dot(geometric, direction) <= 0.0;
    s.normal_geo = select(-geometric, geometric, s.front);

    var shading = geometric;
    if (flags & SMOOTH) != 0u {
        let n = barycentric(
            geometry_vec3(at.normals, corners.x),
            geometry_vec3(at.normals, corners.y),
            geometry_vec3(at.normals, corners.z), hit.u, hit.v);
        let turned = at.object_from_scene[0].xyz * n.x + at.object_from_scene[1].xyz * n.y
            + at.object_from_scene[2].xyz * n.z;
        // Opposite vertex normals cancel: then the face's own.
        shading = select(geometric, safe_normalize(turned), dot(n, n) > 1e-12);
    }
    s.normal_shade = select(-shading, shading, dot(shading, direction) <= 0.0);
    s.light = at.light;
    s.uv = vec2f(hit.u, hit.v);
    if (flags & TEXTURE) != 0u {
        let ta = geometry_vec2(at.uvs, corners.x);
        s.uv = ta + hit.u * (geometry_vec2(at.uvs, corners.y) - ta) + hit.v * (geometry_vec2(at.uvs, corners.z) - ta);
    }
    s.albedo = surface_albedo(at, flags, corners, hit.u, hit.v, s.uv);
    return s;
}

// A ray's origin, moved off its surface along the geometric normal by the bound of the position's error.
fn offset_origin(position: vec3f, normal_geo: vec3f, origin_error: f32) -> vec3f {
    return position + normal_geo * origin_error;
}
