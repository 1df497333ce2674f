// What the ray lists hold; the host twins are in src/passes/visibility.

const MISS: u32 = 0xffffffffu;

struct Ray {
    origin: vec3f,
    t_min: f32,
    direction: vec3f,
    t_max: f32,
}

// Scalars only, so that the stride is 20 bytes. p = (1 - u - v) p0 + u p1 + v p2.
struct Hit {
    t: f32,
    u: f32,
    v: f32,
    instance: u32,
    triangle: u32,
}

struct Receiver {
    origin: vec3f,
    pattern: u32,
    normal_geo: vec3f,
    flags: u32,
    normal_shade: vec3f,
    pixel: u32,
}

fn inactive_ray() -> Ray {
    return Ray(vec3f(0.0), 1.0, vec3f(0.0, 0.0, 1.0), 0.0);
}
