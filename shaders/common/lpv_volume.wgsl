// The volume in which light propagates: cubic cells, and in each the flux that leaves it in a step as two bands of
// spherical harmonics, x: the mean, yzw: along the axes of the scene [KD10].

struct Volume {
    corner: vec3f,      // scene space, of cell 0
    edge: f32,          // of a cell, scene units
    size: vec3u,        // cells along each axis
    cells: u32,
}

// The mean's basis function.
const Y0: f32 = 0.28209479;
// What a flux of 1 about a normal has along it, over what it has in the mean: a clamped cosine in two bands.
const LOBE: f32 = 1.15470054;
const ROOT3: f32 = 1.73205081;
// Light below this is none.
const FAINTEST: f32 = 1e-30;
// How far in front of a surface, in half cells as wide as they are along its normal, its light is left and looked up: the
// middle of the cell there lies clear of the surface however the grid does.
const CLEAR: f32 = 1.1;
// Where the way between two middles meets a surface that is not there.
const NOWHERE: f32 = 2.0;

fn cell_number(volume: Volume, at: vec3u) -> u32 {
    return (at.z * volume.size.y + at.y) * volume.size.x + at.x;
}

fn cell_place(volume: Volume, cell: u32) -> vec3u {
    return vec3u(cell % volume.size.x, cell / volume.size.x % volume.size.y, cell / (volume.size.x * volume.size.y));
}

// Number of the cell one step along `axis`, in the sense of +1 or -1; it need not be there.
fn cell_beside(volume: Volume, cell: u32, axis: u32, up: bool) -> u32 {
    let stride = select(select(volume.size.x * volume.size.y, volume.size.x, axis == 1u), 1u, axis == 0u);
    return select(cell - stride, cell + stride, up);
}

// Bit of a face in a cell's mask of open ones.
fn face_bit(axis: u32, up: bool) -> u32 {
    return 1u << (2u * axis + select(0u, 1u, up));
}

// Net flow as a share of all light. Light may be so faint that squares of it vanish.
fn net_flow(flow: vec4f) -> f32 {
    return length(flow.yzw / max(flow.x, FAINTEST)) / ROOT3;
}

// No more of the light may go one way than `most` of all of it: the net flow is shortened.
fn limited(flow: vec4f, most: f32) -> vec4f {
    let net = net_flow(flow);
    return vec4f(flow.x, flow.yzw * select(1.0, most / net, net > most));
}
