// Grid: the index of an item in a dispatch of any size.
// The host folds a list into a 2-D grid of workgroups, because a dimension holds at most 65,535 of them, and may
// cut it into pieces. A kernel declares
//   @group(0) @binding(0) var<uniform> grid: Grid;
// (filled by the pass itself) and leaves when its item is at or beyond grid.end.
// Limits  2^31 items a dispatch.

struct Grid {
    first: u32, // first item of this piece
    end: u32,   // one past the last item; 0xffffffff in an indirect dispatch, whose count the shader reads itself
}

// Most workgroups along one dimension that every adapter allows.
const MOST_GROUPS: u32 = 65535u;

// Linear number of a workgroup of the folded grid.
fn group_index(workgroup: vec3<u32>, workgroups: vec3<u32>) -> u32 {
    return workgroup.y * workgroups.x + workgroup.x;
}

// Item of a thread: `size` threads a workgroup, `local` this one's index in it.
fn item_index(grid: Grid, workgroup: vec3<u32>, workgroups: vec3<u32>, size: u32, local: u32) -> u32 {
    return grid.first + group_index(workgroup, workgroups) * size + local;
}

// Arguments of an indirect dispatch of `items` threads, `size` threads a workgroup; the same folding as the host's.
fn dispatch_size(items: u32, size: u32) -> vec3<u32> {
    let groups = (items + size - 1u) / size;
    let rows = max((groups + MOST_GROUPS - 1u) / MOST_GROUPS, 1u);
    return vec3<u32>((groups + rows - 1u) / rows, rows, 1u);
}

// A uniform value that a driver does not take for one: Mesa's software driver compiles a shader anew, and keeps it, for each
// dispatch whose uniforms decide about a loop or a branch. `item` is any number below the largest.
fn not_uniform(value: u32, item: u32) -> u32 {
    return value + select(0u, 1u, item == 0xffffffffu);
}
