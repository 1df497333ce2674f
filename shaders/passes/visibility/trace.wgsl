// Trace: answers a list of rays.
// In     rays; the scene's trees (common/bvh)
// Out    closest: hits, one a ray. any: occluded, bit i % 32 of word i / 32 set when ray i meets something.
//        counter: how many rays were active, as two words
// Limits see common/bvh

import package::common::bvh::{active_ray, trace_ray};
import package::common::grid::{Grid, item_index};
import package::common::ray::{Hit, MISS, Ray};
import package::common::ray_counter::{add_rays, count_rays};

const SIZE: u32 = 64u;

@group(0) @binding(0) var<uniform> grid: Grid;
@group(0) @binding(1) var<storage, read> rays: array<Ray>;
@group(0) @binding(2) var<storage, read_write> hits: array<Hit>;
@group(0) @binding(3) var<storage, read_write> occluded: array<u32>;

var<workgroup> words: array<atomic<u32>, 2>;

@compute @workgroup_size(SIZE)
fn closest(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, SIZE, lane);
    if i < grid.end {
        let ray = rays[i];
        var hit = Hit(0.0, 0.0, 0.0, MISS, MISS);
        if active_ray(ray) {
            count_rays(1u);
            hit = trace_ray(ray, false);
        }
        if hit.instance == MISS {
            // Infinity, whose constant WGSL refuses: the exponent's bits of MISS.
            hit.t = bitcast<f32>(hit.instance & 0x7f800000u);
        }
        hits[i] = hit;
    }
    add_rays(lane);
}

@compute @workgroup_size(SIZE)
fn any_hit(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, SIZE, lane);
    if i < grid.end {
        let ray = rays[i];
        if active_ray(ray) {
            count_rays(1u);
            if trace_ray(ray, true).instance != MISS {
                atomicOr(&words[lane / 32u], 1u << (lane % 32u));
            }
        }
    }
    add_rays(lane);
    // Pieces begin at whole workgroups, so that a word belongs to one of them.
    if lane % 32u == 0u && i < grid.end {
        occluded[i / 32u] = atomicLoad(&words[lane / 32u]);
    }
}
