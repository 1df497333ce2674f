// One side of a surface sample.

struct LpvPoint {
    normal: vec3f,      // unit, of the triangle, on this side
    area: f32,          // that it stands for, scene units squared
    instance: u32,
    triangle: u32,
    u: f32,             // as in a hit
    v: f32,
}

// The points whose light is left in one cell.
struct LpvCell {
    cell: u32,
    first: u32,
    count: u32,
    pad: u32,
}
