// Virtual lights on a regular grid over each reflective shadow map [NW09 Sec. 3.1; Deviation: a light has the flux, area
// and solid angle of all texels of its block, the paper those of one point, so that none is lost].
//   main  a thread for each light
//   wide  a workgroup for each, where blocks are large
// In: rsm_texels. Out: vpls, map by map and row by row.

import package::common::grid::{Grid, item_index};
import package::common::rsm::RSM_ROWS;
import package::common::virtual_light::VirtualLight;

struct VplGridParams {
    resolution: u32,
    across: u32,        // lights along an edge of a map
    first_map: u32,
    first_light: u32,   // of the list
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: VplGridParams;
@group(0) @binding(1) var<storage, read> rsm_texels: array<vec4f>;
@group(0) @binding(2) var<storage, read_write> vpls: array<VirtualLight>;

var<workgroup> all_rows: array<Gathered, 64>;
var<workgroup> all_reaches: array<vec3f, 64>;

struct Block {
    first: vec2u,
    end: vec2u,     // one past the last column and row
    row: u32,       // of the map's first texel in `rsm_texels`
}

fn row_of(block: Block, x: u32, y: u32) -> u32 {
    return block.row + RSM_ROWS * (y * params.resolution + x);
}

// What is known of some of its rows: the sums, and the texel with flux that lies nearest to the block's middle.
struct Gathered {
    light: VirtualLight,
    nearest: u32,
    at: u32,
}

// Of every `step`-th row from `start` on. Row after row, so that the sums stay exact.
fn gathered(block: Block, start: u32, step: u32) -> Gathered {
    var all_of: Gathered;
    all_of.nearest = 0xffffffffu;
    for (var y = block.first.y + start; y < block.end.y; y += step) {
        var flux = vec4f(0.0);
        var solid_angle = 0.0;
        for (var x = block.first.x; x < block.end.x; x++) {
            let row = row_of(block, x, y);
            let own = rsm_texels[row + 2u];
            flux += own;
            solid_angle += rsm_texels[row + 1u].w;
            let off = vec2i(vec2u(2u * x + 1u, 2u * y + 1u)) - vec2i(block.first + block.end);
            let distance = u32(off.x * off.x + off.y * off.y);
            if own.x + own.y + own.z > 0.0 && distance < all_of.nearest {
                all_of.nearest = distance;
                all_of.at = row;
            }
        }
        all_of.light.flux += flux.xyz;
        all_of.light.area += flux.w;
        all_of.light.solid_angle += solid_angle;
    }
    return all_of;
}

// Stands where that texel is.
fn placed(all_of: Gathered) -> VirtualLight {
    var light = all_of.light;
    light.normal = vec3f(0.0, 0.0, 1.0);
    if all_of.nearest != 0xffffffffu {
        light.position = rsm_texels[all_of.at].xyz;
        light.normal = rsm_texels[all_of.at + 1u].xyz;
    }
    return light;
}

// Radius, spread and thickness of the same rows.
fn reaches(block: Block, light: VirtualLight, start: u32, step: u32) -> vec3f {
    var most = vec3f(0.0);
    for (var y = block.first.y + start; y < block.end.y; y += step) {
        for (var x = block.first.x; x < block.end.x; x++) {
            let row = row_of(block, x, y);
            let flux = rsm_texels[row + 2u];
            if flux.x + flux.y + flux.z > 0.0 {
                // A texel's patch is taken for a square disc that faces along its normal.
                let offset = rsm_texels[row].xyz - light.position;
                let half_diagonal = sqrt(0.5 * flux.w);
                let turned = length(rsm_texels[row + 1u].xyz - light.normal);
                let off_plane = abs(dot(light.normal, offset)) + half_diagonal * turned;
                most = max(most, vec3f(length(offset) + half_diagonal, turned, off_plane));
            }
        }
    }
    return most;
}

fn map_of(item: u32) -> u32 {
    return params.first_map + item / (params.across * params.across);
}

fn block_of(item: u32) -> Block {
    let within = item % (params.across * params.across);
    let cell = vec2u(within % params.across, within / params.across);
    return Block(
        cell * params.resolution / params.across,
        (cell + 1u) * params.resolution / params.across,
        RSM_ROWS * map_of(item) * params.resolution * params.resolution,
    );
}

fn store(item: u32, block: Block, placed: VirtualLight, most: vec3f) {
    var light = placed;
    light.radius = most.x;
    light.spread = most.y;
    light.thickness = min(most.z, most.x);
    let size = block.end - block.first;
    light.block = block.first.x | (block.first.y << 16u);
    light.extent = select(0u, size.x, size.x == size.y) | (map_of(item) << 16u);
    vpls[params.first_light + item] = light;
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = item_index(grid, group, groups, 64u, lane);
    if item >= grid.end {
        return;
    }
    let block = block_of(item);
    let light = placed(gathered(block, 0u, 1u));
    store(item, block, light, reaches(block, light, 0u, 1u));
}

@compute @workgroup_size(64)
fn wide(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = item_index(grid, group, groups, 64u, lane) / 64u;
    let block = block_of(item);
    all_rows[lane] = gathered(block, lane, 64u);
    workgroupBarrier();
    var sum = all_rows[0];
    for (var k = 1u; k < 64u; k++) {
        let rows = all_rows[k];
        sum.light.flux += rows.light.flux;
        sum.light.area += rows.light.area;
        sum.light.solid_angle += rows.light.solid_angle;
        if rows.nearest < sum.nearest || (rows.nearest == sum.nearest && rows.at < sum.at) {
            sum.nearest = rows.nearest;
            sum.at = rows.at;
        }
    }
    let light = placed(sum);
    all_reaches[lane] = reaches(block, light, lane, 64u);
    workgroupBarrier();
    if lane == 0u {
        var most = vec3f(0.0);
        for (var k = 0u; k < 64u; k++) {
            most = max(most, all_reaches[k]);
        }
        store(item, block, light, most);
    }
}
