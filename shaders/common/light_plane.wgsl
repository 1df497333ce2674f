// Irradiance of a parallelogram of unit radiance in its own plane's coordinates: what polygon.wgsl gives in any place,
// in three forms without arrays or branches, each for points of one kind only. x runs along edge u, y across it in the
// plane, z along the normal of the lit side, and the longer edge has length 1. The point is the origin; `corner` is
// a = b = 0 as seen from there, so that z < 0 on the lit side. Edge u is (edge.x, 0), edge v is (edge.y, edge.z), of
// length edge.w and direction `along_v`.

const GAUSS: f32 = 0.774596669;
// Normals that differ by less share a horizon: what lies between the two adds less than half the square of it.
const SAME_HORIZON: f32 = 1e-4;
// Heights below this share of the distance are rounding and count as zero: of a light in the plane of a floor there is
// nothing else, and its outline would fold.
const LEVEL: f32 = 1e-6;
const HALF_PI: f32 = 1.5707964;
// atan(r) = r + r^3 P(r^2) on [0, 1], minimax: 2e-8 relative. Built-in ones are allowed 4,096 units in the last place.
const ATAN = array<f32, 8>(
    -0.33333153, 0.19993773, -0.14211054, 0.10666003, -0.075522102, 0.043211807, -0.016367894, 0.0029206832);

// Angle of (x, y) from the x axis, y >= 0.
fn angle_of(y: f32, x: f32) -> f32 {
    let size = abs(x);
    let r = min(y, size) / max(max(y, size), 1e-37);
    let s = r * r;
    var p = ATAN[6] + s * ATAN[7];
    p = ATAN[5] + s * p;
    p = ATAN[4] + s * p;
    p = ATAN[3] + s * p;
    p = ATAN[2] + s * p;
    p = ATAN[1] + s * p;
    p = ATAN[0] + s * p;
    let within = r + r * (s * p);
    let quarter = select(within, HALF_PI - within, y > size);
    return select(quarter, 2.0 * HALF_PI - quarter, x < 0.0);
}

// Twice what an edge of length l adds that starts at `along` and lies at `across` to the side: with
// r^2 = across^2 + z^2 the unit normal of its plane has n . (a x b) / |a x b| = (n_across z - n_z across) / r.
fn edge_term(n_across: f32, n_z: f32, along: f32, across: f32, z: f32, l: f32) -> f32 {
    let r2 = across * across + z * z;
    let inverse = inverseSqrt(max(r2, 1e-36));
    return (n_across * z - n_z * across) * inverse * angle_of(l * (r2 * inverse), r2 + along * (along + l));
}

// Near and whole: the contour [Lam60; Arv95], opposite edges as one and the same. Negative below n's horizon.
fn whole_near(n: vec3f, corner: vec3f, edge: vec4f, along_v: vec2f) -> f32 {
    let z = corner.z;
    let beside = vec2f(corner.x + edge.x, corner.y);
    let left = vec2f(-along_v.y, along_v.x);
    let n_left = dot(n.xy, left);
    let sum = edge_term(n.y, n.z, corner.x, corner.y, z, edge.x)
        - edge_term(n.y, n.z, corner.x + edge.y, corner.y + edge.z, z, edge.x)
        + edge_term(n_left, n.z, dot(beside, along_v), dot(beside, left), z, edge.w)
        - edge_term(n_left, n.z, dot(corner.xy, along_v), dot(corner.xy, left), z, edge.w);
    return 0.5 * select(-sum, sum, z > 0.0);
}

// Far and whole: 3 x 3 Gauss points, cos_l being the same height |z| over the distance for all of them (N3).
fn whole_far(n: vec3f, corner: vec3f, edge: vec4f) -> f32 {
    let middle = corner.xy + 0.5 * vec2f(edge.x + edge.y, edge.z);
    let z2 = corner.z * corner.z;
    var sum = 0.0;
    for (var i = -1; i <= 1; i++) {
        for (var j = -1; j <= 1; j++) {
            let weight = select(5.0, 8.0, i == 0) * select(5.0, 8.0, j == 0) / 324.0;
            let y = middle + 0.5 * GAUSS * (f32(i) * vec2f(edge.x, 0.0) + f32(j) * edge.yz);
            let inverse = 1.0 / (dot(y, y) + z2);
            sum += weight * max(0.0, dot(n.xy, y) + n.z * corner.z) * inverse * inverse;
        }
    }
    return sum * edge.x * edge.z * abs(corner.z);
}

// What is known of an outline so far: twice its contour, and where it leaves the horizon of n and enters again (with the
// height over the horizon of g), and that of g.
struct Outline {
    sum: f32,
    exit: vec3f,
    entry: vec3f,
    exit_g: vec2f,
    entry_g: vec2f,
}

fn height(n: vec3f, p: vec2f, z: f32, level: f32) -> f32 {
    let h = dot(n.xy, p) + n.z * z;
    return select(h, 0.0, abs(h) < level);
}

// Adds the part above both horizons of the edge of length l from p along d; its ends are `high` over n's and `high_g`
// over g's. Points on the edge are kept as places along it, so that its plane stays exact.
fn cut_edge(o: Outline, n: vec3f, p: vec2f, d: vec2f, l: f32, z: f32, high: vec2f, high_g: vec2f) -> Outline {
    var cut = o;
    let above = high >= vec2f(0.0);
    let crosses = above.x != above.y;
    let t = select(0.0, high.x / (high.x - high.y), crosses);
    let at = vec3f(p + t * l * d, high_g.x + t * (high_g.y - high_g.x));
    cut.exit = select(o.exit, at, crosses && above.x);
    cut.entry = select(o.entry, at, crosses && above.y);
    // Wholly below: drawn together into its start, t = 0.
    let t0 = select(t, 0.0, above.x);
    let t1 = select(t, 1.0, above.y);
    let g0 = select(at.z, high_g.x, above.x);
    let g1 = select(at.z, high_g.y, above.y);
    let crosses_g = (g0 >= 0.0) != (g1 >= 0.0);
    let tg = t0 + select(0.0, g0 / (g0 - g1), crosses_g) * (t1 - t0);
    let at_g = p + tg * l * d;
    cut.exit_g = select(o.exit_g, at_g, crosses_g && g0 >= 0.0);
    cut.entry_g = select(o.entry_g, at_g, crosses_g && g1 >= 0.0);
    let s0 = select(tg, t0, g0 >= 0.0);
    let s1 = select(tg, t1, g1 >= 0.0);
    let left = vec2f(-d.y, d.x);
    cut.sum += edge_term(dot(n.xy, left), n.z, dot(p, d) + s0 * l, dot(p, left), z, (s1 - s0) * l);
    return cut;
}

fn angle_between(a: vec2f, b: vec2f, z: f32) -> f32 {
    let e = b - a;
    let c = a.x * e.y - a.y * e.x;
    return angle_of(sqrt(z * z * dot(e, e) + c * c), dot(a, b) + z * z);
}

// Near and cut by the horizons of n and of the geometric normal g (N4): the edges above both, the chord that closes them
// along n's horizon, and the one that closes all that along g's. A sum needs no order, so no list of corners is made;
// the planes of the chords are the horizons themselves.
fn cut_near(n: vec3f, g: vec3f, corner: vec3f, edge: vec4f, along_v: vec2f) -> f32 {
    let z = corner.z;
    let p0 = corner.xy;
    let p1 = p0 + vec2f(edge.x, 0.0);
    let p2 = p1 + edge.yz;
    let p3 = p0 + edge.yz;
    let level = LEVEL * (abs(p0.x) + abs(p0.y) + abs(z) + edge.x + edge.w);
    let h = vec4f(height(n, p0, z, level), height(n, p1, z, level), height(n, p2, z, level), height(n, p3, z, level));
    let own = vec4f(height(g, p0, z, level), height(g, p1, z, level), height(g, p2, z, level), height(g, p3, z, level));
    let turned = n - g;
    let q = select(own, vec4f(1.0), dot(turned, turned) < SAME_HORIZON * SAME_HORIZON);
    var o: Outline;
    o = cut_edge(o, n, p0, vec2f(1.0, 0.0), edge.x, z, h.xy, q.xy);
    o = cut_edge(o, n, p1, along_v, edge.w, z, h.yz, q.yz);
    o = cut_edge(o, n, p2, vec2f(-1.0, 0.0), edge.x, z, h.zw, q.zw);
    o = cut_edge(o, n, p3, -along_v, edge.w, z, h.wx, q.wx);
    let above = vec2f(o.exit.z, o.entry.z) >= vec2f(0.0);
    let crosses = above.x != above.y;
    let t = select(0.0, o.exit.z / (o.exit.z - o.entry.z), crosses);
    let at = o.exit.xy + t * (o.entry.xy - o.exit.xy);
    let a = select(at, o.exit.xy, above.x);
    let b = select(at, o.entry.xy, above.y);
    let exit_g = select(o.exit_g, at, crosses && above.x);
    let entry_g = select(o.entry_g, at, crosses && above.y);
    return 0.5 * (select(-o.sum, o.sum, z > 0.0) + angle_between(a, b, z) + dot(n, g) * angle_between(exit_g, entry_g, z));
}
