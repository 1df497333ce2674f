// What the G-buffer holds a pixel: four rows of four words, floats as their bits.
//   g_position   xyz scene-space position, w bound of its error
//   g_normal     xyz shading normal turned to the viewer, w kind: 0 nothing, 1 surface, 2 + light index for a light
//   g_geometric  xyz geometric normal turned to the viewer, w triangle of the mesh, MISS for a light
//   g_albedo     rgb albedo (of a light: a, b, and 1 on its lit side), w instance

const NOTHING: u32 = 0u;
const SURFACE: u32 = 1u;
const FIRST_LIGHT: u32 = 2u;

fn words(v: vec3f, w: u32) -> vec4u {
    return vec4u(bitcast<vec3u>(v), w);
}

fn floats(v: vec4u) -> vec3f {
    return bitcast<vec3f>(v.xyz);
}
