// The lights' table: six rows a light, the texels of textured lights behind all of them.

const LIGHT_ROWS: u32 = 6u;
const AREA: u32 = 0u;
const SPOT: u32 = 1u;

@group(0) @binding(23) var<storage, read> lights: array<vec4f>;

struct Light {
    corner: vec3f,      // area: a = b = 0; spot: its position
    kind: u32,
    edge_u: vec3f,
    two_sided: bool,
    edge_v: vec3f,
    normal: vec3f,      // area: of the lit side; spot: axis of the cone
    area: f32,
    cos_cutoff: f32,
    radiance: vec3f,    // area: mean radiance; spot: intensity
    texels: u32,        // row of the first texel in `lights`; 0: constant
    width: u32,
    height: u32,
    linear: bool,
}

fn light_at(index: u32) -> Light {
    let i = index * LIGHT_ROWS;
    let texture = lights[i + 5u];
    return Light(
        lights[i].xyz, u32(lights[i].w),
        lights[i + 1u].xyz, lights[i + 1u].w != 0.0,
        lights[i + 2u].xyz,
        lights[i + 3u].xyz, lights[i + 3u].w, lights[i + 4u].w,
        lights[i + 4u].xyz,
        u32(texture.x), u32(texture.y), u32(texture.z), texture.w != 0.0,
    );
}

fn light_texel(light: Light, column: i32, row: i32) -> vec3f {
    let c = clamp(column, 0, i32(light.width) - 1);
    let r = clamp(row, 0, i32(light.height) - 1);
    return lights[light.texels + u32(r) * light.width + u32(c)].xyz;
}

// Radiance leaving the light at (a, b): row 0 of the picture lies at b = 1.
fn light_radiance_at(light: Light, ab: vec2f) -> vec3f {
    if light.texels == 0u {
        return light.radiance;
    }
    let p = vec2f(ab.x, 1.0 - ab.y) * vec2f(f32(light.width), f32(light.height));
    if !light.linear {
        return light_texel(light, i32(floor(p.x)), i32(floor(p.y)));
    }
    let corner = floor(p - 0.5);
    let f = p - 0.5 - corner;
    let c = i32(corner.x);
    let r = i32(corner.y);
    let top = mix(light_texel(light, c, r), light_texel(light, c + 1, r), f.x);
    return mix(top, mix(light_texel(light, c, r + 1), light_texel(light, c + 1, r + 1), f.x), f.y);
}
