// The mean of factor x factor internal pixels for each pixel of the image. In: one internal image. Out: one image.

import package::common::grid::{Grid, item_index};

struct DownsampleParams {
    width: u32,     // of the output
    height: u32,
    factor: u32,
    pad: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: DownsampleParams;
@group(0) @binding(1) var<storage, read> fine: array<vec4f>;
@group(0) @binding(2) var<storage, read_write> coarse: array<vec4f>;

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
    let corner = vec2u(i % params.width, i / params.width) * params.factor;
    var sum = vec4f(0.0);
    for (var y = 0u; y < params.factor; y++) {
        for (var x = 0u; x < params.factor; x++) {
            sum += fine[(corner.y + y) * params.width * params.factor + corner.x + x];
        }
    }
    coarse[i] = sum / f32(params.factor * params.factor);
}
