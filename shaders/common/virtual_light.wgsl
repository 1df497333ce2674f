// Virtual lights: what reflects light that came straight from a light [Kel97; DS05]. One is a texel of a reflective
// shadow map, or a square of 2^k x 2^k of them. The same record serves lists and the tree.

struct VirtualLight {
    position: vec3f,    // mean by flux
    area: f32,          // of the surfaces that it stands for
    normal: vec3f,      // mean by flux, towards the light: its length says how alike the normals are
    radius: f32,        // of a ball about `position` that holds all of them
    flux: vec3f,        // reflected, W; zero: it is none
    solid_angle: f32,   // as the light sees it, see rsm.wgsl
    spread: f32,        // |n - m| of its normals at most, m the unit mean
    thickness: f32,     // distance of its points to the plane through `position` at most
    block: u32,         // first column and row of its texels, 16 bits each
    extent: u32,        // texels along an edge, 16 bits; number of its map, 16 bits
}

// Column and row that a Morton number stands for: its even and its odd bits.
fn even_bits(number: u32) -> u32 {
    var x = number & 0x55555555u;
    x = (x | (x >> 1u)) & 0x33333333u;
    x = (x | (x >> 2u)) & 0x0f0f0f0fu;
    x = (x | (x >> 4u)) & 0x00ff00ffu;
    return (x | (x >> 8u)) & 0x0000ffffu;
}

fn from_morton(number: u32) -> vec2u {
    return vec2u(even_bits(number), even_bits(number >> 1u));
}

// The tree, one flat buffer [NSW09 Sec. 3.5]: level by level from the root (level 0: the whole map) on, map by map, in
// Morton order, so that the four children of a node lie side by side. Level k has 4^k nodes a map.
fn tree_level_first(level: u32, maps: u32) -> u32 {
    return ((1u << (2u * level)) - 1u) / 3u * maps;
}

fn tree_node(level: u32, maps: u32, map: u32, morton: u32) -> u32 {
    return tree_level_first(level, maps) + (map << (2u * level)) + morton;
}

// Of the node below `node` that comes first; `level` that of `node`.
fn tree_child(level: u32, maps: u32, node: u32) -> u32 {
    return tree_level_first(level + 1u, maps) + 4u * (node - tree_level_first(level, maps));
}
