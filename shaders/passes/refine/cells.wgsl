// Cells: the answers of the cell rays, gathered a cell each.
// In     receivers and visible, as cell_rays listed them; open_tiles. Out: cell_bits, in the order of the tiles: bit k
//        (low half) set when block k of strata is seen, bit 16 + k when it was asked; the first without the second: the
//        surface or the light is turned away from it. Of a spot: bit k is pixel k.
//        cell_surface: two rows a cell: mean position and whether its pixels lie on one surface, mean normal

import package::common::cells::{FLAT, LEAST_COSINE, TILE_CELLS, cell_place};
import package::common::grid::{Grid, item_index};
import package::common::light::{Light, light_at, lights};
import package::common::list_params::ListParams;
import package::common::ray::Receiver;
import package::common::receiver::INACTIVE;
import package::common::strata::{BLOCKS, STRATA, WORDS, cell_pixel, cell_stratum};

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: ListParams;
@group(0) @binding(1) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(2) var<storage, read> visible: array<u32>;
@group(0) @binding(3) var<storage, read> open_tiles: array<u32>;
@group(0) @binding(4) var<storage, read_write> cell_bits: array<u32>;
@group(0) @binding(5) var<storage, read_write> cell_surface: array<vec4f>;
@group(0) @binding(6) var<storage, read> light_points: array<vec4f>;

fn active_pixels(first: u32) -> u32 {
    var awake = 0u;
    for (var k = 0u; k < 4u; k++) {
        awake |= select(0u, 1u << k, receivers[first + k].pattern != INACTIVE);
    }
    return awake;
}

// Writes where the active pixels of a cell lie; one surface when every pixel is there and none lies out of the plane of
// the others or is turned away from them.
fn put_surface(first: u32, awake: u32, to: u32) {
    var position = vec3f(0.0);
    var normal = vec3f(0.0);
    for (var k = 0u; k < 4u; k++) {
        let use_it = select(0.0, 1.0, ((awake >> k) & 1u) != 0u);
        position += use_it * receivers[first + k].origin;
        normal += use_it * receivers[first + k].normal_geo;
    }
    position /= max(f32(countOneBits(awake)), 1.0);
    normal = normal / max(length(normal), 1e-20);
    var one = awake == 15u;
    for (var k = 0u; k < 4u; k++) {
        let out = receivers[first + k].origin - position;
        let height = dot(out, normal);
        one = one && height * height <= FLAT * FLAT * dot(out, out) && dot(receivers[first + k].normal_geo, normal) >= LEAST_COSINE;
    }
    cell_surface[2u * to] = vec4f(position, select(0.0, 1.0, one));
    cell_surface[2u * to + 1u] = vec4f(normal, 0.0);
}

// Whether a sample could be seen by a receiver, but for what lies between: only then it was traced.
fn faces(r: Receiver, light: Light, k: u32) -> bool {
    let d = light_points[r.pattern * STRATA + k].xyz - r.origin;
    let emits = light.two_sided || dot(light.normal, d) < 0.0;
    return emits && dot(r.normal_geo, d) > 0.0 && dot(r.normal_shade, d) > 0.0;
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let index = open_tiles[params.first + i / TILE_CELLS] * TILE_CELLS + i % TILE_CELLS;
    let cell = cell_place(index, params.width);
    let awake = active_pixels(4u * i);
    let light = light_at(params.light);
    var bits = 0u;
    for (var block = 0u; block < BLOCKS; block++) {
        let pixel = cell_pixel(block);
        let stratum = cell_stratum(cell, block);
        let word = visible[(4u * i + pixel) * WORDS + block / 2u] >> (16u * (block & 1u));
        let seen = (word >> stratum) & (awake >> pixel) & 1u;
        var was_asked = 0u;
        if ((awake >> pixel) & 1u) != 0u {
            was_asked = select(0u, 1u, faces(receivers[4u * i + pixel], light, 16u * block + stratum));
        }
        bits |= (seen << block) | (was_asked << (16u + block));
    }
    cell_bits[index] = bits;
    put_surface(4u * i, awake, index);
}

@compute @workgroup_size(64)
fn spot(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let tile = open_tiles[params.first + i / TILE_CELLS];
    let awake = active_pixels(4u * i);
    var seen = 0u;
    for (var pixel = 0u; pixel < 4u; pixel++) {
        seen |= (visible[4u * i + pixel] & 1u) << pixel;
    }
    cell_bits[tile * TILE_CELLS + i % TILE_CELLS] = (seen & awake) | (awake << 16u);
}
