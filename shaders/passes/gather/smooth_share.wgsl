// Smooth share: averages the share, and nothing else, over neighbours on the same surface, as far as the penumbra is wide
// [Dur05; MWR12; HHM18], so that neither textures nor normals blur. The weights reach each stratum of the interleaved
// pattern alike: 1 2 2 2 1 over pixels that ask one of 16, 1 2 1 over those that ask four of them.
// In     the G-buffer, listed_cells, cell_state, cell_plan, share. Out: smooth_share at the listed cells' pixels

import package::common::cells::{FLAT, LEAST_COSINE, PLAN_RADIUS_SHIFT, STATE_DARK, STATE_LIT, STATE_NONE, STATE_ZONE, cell_corner, cell_in_image, cell_place};
import package::common::gbuffer::floats;
import package::common::grid::{Grid, item_index};
import package::common::list_params::ListParams;
import package::common::ray::MISS;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: ListParams;
@group(0) @binding(1) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(2) var<storage, read> g_geometric: array<vec4u>;
@group(0) @binding(3) var<storage, read> listed_cells: array<u32>;
@group(0) @binding(4) var<storage, read> cell_state: array<u32>;
@group(0) @binding(5) var<storage, read> cell_plan: array<u32>;
@group(0) @binding(6) var<storage, read> share: array<vec4f>;
@group(0) @binding(7) var<storage, read_write> smooth_share: array<vec4f>;

// Standard errors by which a share may change.
const TRUST: f32 = 2.0;

struct Place {
    position: vec3f,
    normal: vec3f,
}

fn index_of(pixel: vec2u) -> u32 {
    return pixel.y * params.width + pixel.x;
}

// 1 on the same surface, 0 beyond an edge.
fn same_surface(here: Place, at: u32) -> f32 {
    let geometric = g_geometric[at];
    let to = floats(g_position[at]) - here.position;
    let out = dot(here.normal, to);
    let near = out * out <= FLAT * FLAT * dot(to, to);
    return select(0.0, 1.0, near && geometric.w != MISS && dot(floats(geometric), here.normal) >= LEAST_COSINE);
}

// A neighbour's share; w: 0 where it has none.
fn share_at(pixel: vec2u) -> vec4f {
    let state = cell_state[cell_in_image(pixel / 2u, params.width)];
    let known = select(vec3f(1.0), vec3f(0.0), state == STATE_DARK);
    let value = select(known, share[index_of(pixel)].xyz, state == STATE_ZONE);
    return vec4f(value, select(1.0, 0.0, state == STATE_NONE));
}

// What it differs from the pixel's own: where nothing does, no rounding shows, however a device divides.
fn tap(here: Place, center: vec2u, own: vec3f, offset: vec2i, weight: f32) -> vec4f {
    let pixel = vec2i(center) + offset;
    let inside = all(pixel >= vec2i(0)) && all(pixel < vec2i(i32(params.width), i32(params.height)));
    let at = select(center, vec2u(pixel), inside);
    let value = share_at(at);
    let w = select(0.0, weight, inside) * same_surface(here, index_of(at)) * select(0.0, 1.0, value.w > 0.0);
    return vec4f(w * (value.xyz - own), w);
}

// One axis: of the filter over pixels of this radius, and of 1 2 2 2 1 over cells, from a pixel beside the cell's middle.
fn pixel_weight(radius: u32, offset: i32) -> f32 {
    let one = select(0.0, 2.0 - f32(abs(offset)), abs(offset) <= 1);
    let two = select(2.0, 1.0, abs(offset) == 2);
    return select(select(select(0.0, 1.0, offset == 0), one, radius == 1u), two, radius == 2u);
}

fn cell_weight(distance: i32) -> f32 {
    return select(select(0.0, 1.0, abs(distance) == 2), 2.0, abs(distance) < 2);
}

fn beside_weight(distance: i32, towards: i32) -> f32 {
    return 0.75 * cell_weight(distance) + 0.25 * cell_weight(distance - towards);
}

fn place_at(at: u32) -> Place {
    return Place(floats(g_position[at]), floats(g_geometric[at]));
}

// The average, but no farther from the pixel's own share than chance could have taken that.
fn finish(sum: vec4f, at: u32) {
    let own = share[at];
    let average = own.xyz + sum.xyz / max(sum.w, 1e-30);
    let reach = vec3f(TRUST * own.w);
    let kept = clamp(average, own.xyz - reach, own.xyz + reach);
    smooth_share[at] = vec4f(select(own.xyz, kept, sum.w > 0.0), own.w);
}

@compute @workgroup_size(64)
fn pixels(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let index = listed_cells[params.first + i / 4u];
    let pixel = cell_corner(cell_place(index, params.width), i % 4u);
    if pixel.x >= params.width || pixel.y >= params.height {
        return;
    }
    let here = place_at(index_of(pixel));
    let radius = (cell_plan[index] >> PLAN_RADIUS_SHIFT) & 3u;
    let own = share[index_of(pixel)].xyz;
    var sum = vec4f(0.0);
    for (var y = -2; y <= 2; y++) {
        let row = pixel_weight(radius, y);
        for (var x = -2; x <= 2; x++) {
            sum += tap(here, pixel, own, vec2i(x, y), row * pixel_weight(radius, x));
        }
    }
    finish(sum, index_of(pixel));
}

@compute @workgroup_size(64)
fn cells(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let index = listed_cells[params.first + i / 4u];
    let pixel = cell_corner(cell_place(index, params.width), i % 4u);
    if pixel.x >= params.width || pixel.y >= params.height {
        return;
    }
    let here = place_at(index_of(pixel));
    // Towards the neighbour that this pixel of the cell lies nearer to.
    let towards = 2 * vec2i(pixel & vec2u(1u)) - 1;
    let own = share[index_of(pixel)].xyz;
    var sum = vec4f(0.0);
    for (var y = -3; y <= 3; y++) {
        let row = beside_weight(y, towards.y);
        for (var x = -3; x <= 3; x++) {
            sum += tap(here, pixel, own, 2 * vec2i(x, y), row * beside_weight(x, towards.x));
        }
    }
    finish(sum, index_of(pixel));
}
