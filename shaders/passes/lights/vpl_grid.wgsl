// Virtual lights on a regular grid over each reflective shadow map [NW09 Sec. 3.1; Deviation: a light has the flux, area
// and solid angle of all texels of its block, the paper those of one point, so that none is lost].
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

struct Block {
    first: vec2u,
    end: vec2u,     // one past the last column and row
    row: u32,       // of the map's first texel in `rsm_texels`
}

fn row_of(block: Block, x: u32, y: u32) -> u32 {
    return block.row + RSM_ROWS * (y * params.resolution + x);
}

// What the block has together, and its texel with flux that lies nearest to the middle: position, normal. Row after row,
// so that the sums stay exact.
fn gathered(block: Block) -> VirtualLight {
    var light: VirtualLight;
    light.normal = vec3f(0.0, 0.0, 1.0);
    var nearest = 0xffffffffu;
    var at = 0u;
    for (var y = block.first.y; y < block.end.y; y++) {
        var flux = vec4f(0.0);
        var solid_angle = 0.0;
        for (var x = block.first.x; x < block.end.x; x++) {
            let row = row_of(block, x, y);
            let own = rsm_texels[row + 2u];
            flux += own;
            solid_angle += rsm_texels[row + 1u].w;
            let off = vec2i(vec2u(2u * x + 1u, 2u * y + 1u)) - vec2i(block.first + block.end);
            let distance = u32(off.x * off.x + off.y * off.y);
            if own.x + own.y + own.z > 0.0 && distance < nearest {
                nearest = distance;
                at = row;
            }
        }
        light.flux += flux.xyz;
        light.area += flux.w;
        light.solid_angle += solid_angle;
    }
    if nearest != 0xffffffffu {
        light.position = rsm_texels[at].xyz;
        light.normal = rsm_texels[at + 1u].xyz;
    }
    return light;
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
    let resolution = params.resolution;
    let map = params.first_map + item / (params.across * params.across);
    let within = item % (params.across * params.across);
    let cell = vec2u(within % params.across, within / params.across);
    let block = Block(
        cell * resolution / params.across,
        (cell + 1u) * resolution / params.across,
        RSM_ROWS * map * resolution * resolution,
    );
    var light = gathered(block);
    for (var y = block.first.y; y < block.end.y; y++) {
        for (var x = block.first.x; x < block.end.x; x++) {
            let row = row_of(block, x, y);
            let flux = rsm_texels[row + 2u];
            if flux.x + flux.y + flux.z > 0.0 {
                // A texel's patch is taken for a square disc that faces along its normal.
                let offset = rsm_texels[row].xyz - light.position;
                let half_diagonal = sqrt(0.5 * flux.w);
                let turned = length(rsm_texels[row + 1u].xyz - light.normal);
                light.radius = max(light.radius, length(offset) + half_diagonal);
                light.spread = max(light.spread, turned);
                light.thickness = max(light.thickness, abs(dot(light.normal, offset)) + half_diagonal * turned);
            }
        }
    }
    let size = block.end - block.first;
    light.thickness = min(light.thickness, light.radius);
    light.block = block.first.x | (block.first.y << 16u);
    light.extent = select(0u, size.x, size.x == size.y) | (map << 16u);
    vpls[params.first_light + item] = light;
}
