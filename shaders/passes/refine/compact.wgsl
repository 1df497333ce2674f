// Stable compaction: the indices i with (flags[i] & mask) == value, in order, and the arguments of an indirect dispatch
// over them. Reduce, then scan: no workgroup waits for another, which WebGPU would not promise to run.
//   count    32 items a thread: which are chosen, and how many before them in their workgroup's block of 2,048
//   scan     how many before each block, in one workgroup; left out where `scatter` can add the few blocks up itself
//   scatter  the list and its arguments
//   whole    all of it in one workgroup, for a single block
// In: flags. Out: list; arguments: workgroups of 64 threads along x, y, z, and the number of items.

import package::common::grid::{Grid, dispatch_size, group_index, item_index};

struct CompactParams {
    items: u32,
    mask: u32,
    value: u32,
    scanned: u32,   // 1: `scan` ran
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: CompactParams;
@group(0) @binding(1) var<storage, read> flags: array<u32>;
@group(0) @binding(2) var<storage, read_write> chosen: array<vec2u>;    // 32 items: one bit each, chosen ones before them
@group(0) @binding(3) var<storage, read_write> totals: array<u32>;      // a block: chosen ones; after `scan`, those before it
@group(0) @binding(4) var<storage, read_write> list: array<u32>;
@group(0) @binding(5) var<storage, read_write> arguments: array<u32>;

const WORDS: u32 = 64u;         // words of 32 items in a block, one a thread
const SCANNERS: u32 = 256u;     // threads of `scan`

var<workgroup> counts: array<u32, 64>;
var<workgroup> eighths: array<u32, 8>;
var<workgroup> before_block: atomic<u32>;
var<workgroup> partial: array<u32, 256>;

fn bits_of(word: u32) -> u32 {
    let first = word * 32u;
    var bits = 0u;
    for (var k = 0u; k < min(32u, max(params.items, first) - first); k++) {
        bits |= select(0u, 1u << k, (flags[first + k] & params.mask) == params.value);
    }
    return bits;
}

// Chosen items in the words of this block before this thread's; called by all threads.
fn before_in_block(lane: u32, mine: u32) -> u32 {
    counts[lane] = mine;
    workgroupBarrier();
    let first = lane & ~7u;
    var sum = 0u;
    for (var k = first; k < lane; k++) {
        sum += counts[k];
    }
    if (lane & 7u) == 7u {
        eighths[lane / 8u] = sum + mine;
    }
    workgroupBarrier();
    for (var k = 0u; k < lane / 8u; k++) {
        sum += eighths[k];
    }
    return sum;
}

fn write_items(word: u32, bits_in: u32, before: u32) {
    var bits = bits_in;
    var at = before;
    while bits != 0u {
        list[at] = word * 32u + firstTrailingBit(bits);
        bits &= bits - 1u;
        at++;
    }
}

fn write_arguments(items: u32) {
    let size = dispatch_size(items, 64u);
    arguments[0] = size.x;
    arguments[1] = size.y;
    arguments[2] = size.z;
    arguments[3] = items;
}

@compute @workgroup_size(64)
fn count(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let block = group_index(group, groups);
    let word = item_index(grid, group, groups, WORDS, lane);
    let bits = bits_of(word);
    let before = before_in_block(lane, countOneBits(bits));
    if word < grid.end {
        chosen[word] = vec2u(bits, before);
    }
    if lane == WORDS - 1u && block * WORDS < grid.end {
        totals[block] = before + countOneBits(bits);
    }
}

// Dispatched as one workgroup; `grid.end` is 1.
@compute @workgroup_size(256)
fn scan(@builtin(local_invocation_index) lane: u32) {
    let words = max((params.items + 31u) / 32u, 1u);
    let blocks = (words + WORDS - 1u) / WORDS;
    let share = (blocks + SCANNERS - 1u) / SCANNERS;
    let first = min(lane * share, blocks);
    let end = min(first + share, blocks);
    var sum = 0u;
    for (var k = first; k < end; k++) {
        sum += totals[k];
    }
    partial[lane] = sum;
    // The running sums of the threads' shares, doubling the reach.
    for (var reach = 1u; reach < SCANNERS; reach *= 2u) {
        workgroupBarrier();
        let other = select(0u, partial[max(lane, reach) - reach], lane >= reach);
        workgroupBarrier();
        partial[lane] += other;
    }
    var before = partial[lane] - sum;
    for (var k = first; k < end; k++) {
        let here = totals[k];
        totals[k] = before;
        before += here;
    }
}

@compute @workgroup_size(64)
fn scatter(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let block = group_index(group, groups);
    let word = item_index(grid, group, groups, WORDS, lane);
    let scanned = params.scanned != 0u;
    for (var k = lane; k < select(block, 0u, scanned); k += WORDS) {
        atomicAdd(&before_block, totals[k]);
    }
    workgroupBarrier();
    if word < grid.end {
        let here = chosen[word];
        let before = select(atomicLoad(&before_block), totals[block], scanned) + here.y;
        write_items(word, here.x, before);
        if word == grid.end - 1u {
            write_arguments(before + countOneBits(here.x));
        }
    }
}

// Dispatched as one workgroup.
@compute @workgroup_size(64)
fn whole(@builtin(local_invocation_index) lane: u32) {
    let bits = bits_of(lane);
    let before = before_in_block(lane, countOneBits(bits));
    write_items(lane, bits, before);
    if lane == WORDS - 1u {
        write_arguments(before + countOneBits(bits));
    }
}
