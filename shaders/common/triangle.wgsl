// Triangle: the watertight ray-triangle test [WBW13], safe on devices that contract a*b+c or do not.
// In     a ray sheared so that it runs along +z from the origin; a triangle in the same frame
// Out    t and the weights of its corners, or nothing
// Rule   a ray crosses when the three edge values agree in sign; both sides of a triangle count. An edge value is a
//        difference of products with its rounding error carried along (Kahan): where fma is fused its sign is exact,
//        where it is not the two triangles at an edge see opposite values. A compiler may mix the two, so values down
//        to -EDGE_SHARE of the products count as inside as well: nothing leaks, and a ray that passes within four
//        units in the last place of an edge may meet both triangles. Weights are then clamped, so that t stays
//        between the corners' and a triangle seen edge-on gives no wild t.
// Limits Deviation: the native form has no EDGE_SHARE; the two may differ at edges only.

// Share of the products that an edge value may be outside: 2^-22.
const EDGE_SHARE: f32 = 2.384185791015625e-7;
// Smallest normal number: covers products that underflow.
const EDGE_FLOOR: f32 = 1.1754943508222875e-38;

// The shear that takes a ray to the z axis of its largest component.
struct Shear {
    major: u32, // 0, 1, 2: x, y, z is largest
    by: vec3<f32>, // x and y over z, and 1 / z
}

struct Crossing {
    hit: bool,
    t: f32,
    u: f32,
    v: f32,
}

// Components in the order of the sheared frame: the largest last, handedness kept.
fn permute(major: u32, p: vec3<f32>) -> vec3<f32> {
    return select(select(p.yzx, p.zxy, major == 1u), p, major == 2u);
}

fn shear_of(direction: vec3<f32>) -> Shear {
    let size = abs(direction);
    var major = select(0u, 1u, size.x <= size.y);
    major = select(major, 2u, size.x <= size.z && size.y <= size.z);
    let d = permute(major, direction);
    let scale = 1.0 / d.z;
    return Shear(major, vec3<f32>(d.x * scale, d.y * scale, scale));
}

// cx * by - cy * bx, and how far below zero it still counts as inside.
fn edge(c: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    let q = c.y * b.x;
    let error = fma(-c.y, b.x, q);
    return vec2<f32>(fma(c.x, b.y, -q) + error, fma(abs(q), EDGE_SHARE, EDGE_FLOOR));
}

// Crosses the triangle with corners a, b, c, relative to the origin of the ray.
fn cross_triangle(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, shear: Shear) -> Crossing {
    let pa = permute(shear.major, a);
    let pb = permute(shear.major, b);
    let pc = permute(shear.major, c);
    let sa = fma(-shear.by.xy, pa.zz, pa.xy);
    let sb = fma(-shear.by.xy, pb.zz, pb.xy);
    let sc = fma(-shear.by.xy, pc.zz, pc.xy);
    let eu = edge(sc, sb);
    let ev = edge(sa, sc);
    let ew = edge(sb, sa);
    let values = vec3<f32>(eu.x, ev.x, ew.x);
    let slack = vec3<f32>(eu.y, ev.y, ew.y);
    let front = all(values >= -slack);
    let back = all(values <= slack);
    let weights = max(select(-values, values, front), vec3<f32>(0.0));
    let sum = weights.x + weights.y + weights.z;
    if !(front || back) || sum <= 0.0 {
        return Crossing(false, 0.0, 0.0, 0.0);
    }
    let t = fma(weights.x, pa.z, fma(weights.y, pb.z, weights.z * pc.z)) / sum * shear.by.z;
    return Crossing(true, t, weights.y / sum, weights.z / sum);
}
