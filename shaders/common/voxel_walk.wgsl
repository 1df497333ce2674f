// A segment through the voxels, voxel by voxel.

import package::common::voxel_march::{Path, Segment, path_of, voxel_bits, voxels};
import package::common::voxels::{Voxels, cell_at, slice_at, word_mask};

// Any voxel of a cell between two depths.
fn filled(cell: vec2u, z0: f32, z1: f32) -> bool {
    let first = slice_at(voxels, z0);
    let last = slice_at(voxels, z1);
    let at = (cell.y * voxels.columns + cell.x) * voxels.words;
    var found = 0u;
    for (var word = first / 32u; word <= last / 32u; word++) {
        found |= voxel_bits[at + word] & word_mask(word, first, last);
    }
    return found != 0u;
}

// Every voxel that the segment crosses: cell by cell, all depths between entering and leaving [AW87].
fn meets_by_voxels(s: Segment) -> bool {
    if s.range.x >= s.range.y {
        return false;
    }
    let p = path_of(s);
    let way = vec2i(sign(p.step));
    let size = vec2i(i32(voxels.columns), i32(voxels.rows));
    // Never where it does not move.
    let each = select(vec2f(1e30), 1.0 / p.step, p.step != vec2f(0.0));
    var cell = vec2i(cell_at(voxels, p.place));
    var leaving = true;
    var at = 0.0;
    var from_z = 1.0 / p.near;
    for (var left = size.x + size.y + 1; left > 0; left--) {
        let exits = (vec2f(cell + max(way, vec2i(0))) - p.place) * each;
        let exit = select(vec2f(1e30), exits, way != vec2i(0));
        // What may be left is looked at apart from what follows it in the same cell.
        let whole = clamp(min(exit.x, exit.y), at, 1.0);
        let next = select(whole, p.leave, at < p.leave && p.leave < whole);
        let to_z = 1.0 / (p.near + next * p.slope);
        if filled(vec2u(cell), min(from_z, to_z), max(from_z, to_z)) {
            if !leaving || at >= p.leave {
                return true;
            }
        } else {
            leaving = false;
        }
        at = next;
        from_z = to_z;
        if next < whole {
            continue;
        }
        cell += select(vec2i(0, way.y), vec2i(way.x, 0), exit.x < exit.y);
        if min(exit.x, exit.y) >= 1.0 || any(cell < vec2i(0)) || any(cell >= size) {
            return false;
        }
    }
    return false;
}
