// Penumbra: how wide it is at each cell of the zone, in pixels, and what the cell does for that reason.
//   width  = light's size . d(receiver, occluder) / d(occluder, light), over a pixel's size on the surface [Dur05; MWR12]
//   plan   the narrowest of a cell and its neighbours counts. Wide: the cell's own answers do, averaged over 5 x 5 cells;
//          narrower: each pixel asks one stratum of each block that is not agreed on, then four, then all.
// In     rays and hits of penumbra_rays, zone_cells. Out: cell_width (0 where there is no zone or it is not known),
//        cell_plan

import package::common::cells::{PLAN_CALM, PLAN_RADIUS_SHIFT, PLAN_SUBS_SHIFT, PLAN_TRACED, PLAN_ZONE, cell_corner, cell_index, cell_place};
import package::common::gbuffer::floats;
import package::common::grid::{Grid, item_index};
import package::common::ray::{Hit, MISS, Ray};
import package::common::view::View;

struct PenumbraParams {
    width: u32,
    height: u32,
    first: u32,
    most_subs: u32,     // strata that a pixel may ask of a block
    light_size: f32,    // shorter edge of the light
    untraced: f32,      // widths in pixels from which on: no pixel asks for itself
    one: f32,           // one stratum a block is asked
    four: f32,          // four are
    narrow: f32,        // the filter leaves what is narrower alone
    wide: f32,          // and averages over 5 x 5 pixels from here on
    calm: f32,          // from here on a cell in which little changes goes by its own answers
    pad: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: PenumbraParams;
@group(0) @binding(1) var<uniform> view: View;
@group(0) @binding(2) var<storage, read> rays: array<Ray>;
@group(0) @binding(3) var<storage, read> hits: array<Hit>;
@group(0) @binding(4) var<storage, read> zone_cells: array<u32>;
@group(0) @binding(5) var<storage, read> g_geometric: array<vec4u>;
@group(0) @binding(6) var<storage, read_write> cell_width: array<f32>;
@group(0) @binding(7) var<storage, read_write> cell_plan: array<u32>;

@compute @workgroup_size(64)
fn widths(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let index = zone_cells[params.first + i];
    let hit = hits[i];
    let ray = rays[i];
    let pixel = cell_corner(cell_place(index, params.width), 0u);
    let at = min(pixel.y, params.height - 1u) * params.width + min(pixel.x, params.width - 1u);
    let to_eye = view.eye - ray.origin;
    let distance = length(to_eye);
    let cosine = max(abs(dot(floats(g_geometric[at]), to_eye)) / max(distance, 1e-30), 0.05);
    let pixel_size = distance / (max(view.fx, view.fy) * cosine);
    let width = params.light_size * hit.t / max(1.0 - hit.t, 1e-6);
    // 0: not known.
    cell_width[index] = select(0.0, max(width / max(pixel_size, 1e-30), 1e-3), hit.instance != MISS);
}

fn narrowest(place: vec2u) -> f32 {
    let cells = (vec2u(params.width, params.height) + 1u) / 2u;
    let lo = vec2u(max(vec2i(place) - 1, vec2i(0)));
    let hi = min(place + 1u, cells - 1u);
    var least = 3.0e38;
    for (var y = lo.y; y <= hi.y; y++) {
        for (var x = lo.x; x <= hi.x; x++) {
            let index = cell_index(vec2u(x, y), params.width);
            least = select(least, min(least, cell_width[index]), cell_width[index] > 0.0);
        }
    }
    return select(least, 0.0, least > 1e38);
}

@compute @workgroup_size(64)
fn plans(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let index = zone_cells[params.first + i];
    let width = narrowest(cell_place(index, params.width));
    let subs = select(select(16u, 4u, width >= params.four), 1u, width >= params.one);
    let calm = (cell_plan[index] & PLAN_CALM) != 0u && width >= params.calm;
    let traced = select(PLAN_TRACED, 0u, width >= params.untraced || calm);
    let radius = select(select(0u, 1u, width >= params.narrow), 2u, width >= params.wide);
    cell_plan[index] = PLAN_ZONE | traced | (min(subs, params.most_subs) << PLAN_SUBS_SHIFT) | (radius << PLAN_RADIUS_SHIFT);
}
