// One list of fragments for each virtual light [NW09 Sec. 4.1], split where geometry is rough and where what the surface
// reflects of this virtual light differs between the middle of a texel and those of its children. Deviation: the lists of
// up to 32 virtual lights are the bits of one word a texel, so that all that a texel keeps is summed up in order, and no
// list can overflow. Deviation: what is kept lights the middles of the children, between which pixels interpolate
// (see vpl_pixels): neighbours that keep other virtual lights at other levels do not matter.
//   begin  all virtual lights of the batch for every texel of the coarsest level that sees a surface
//   test   of the listed texels of `pyramid.level`: takes out of the words what they keep, and sums it up
//   split  hands the rest on to the children, and flags these
//   count  what is left for the pixels of level 1
// In: points, short_lights, texel_state, list. In and out: masks, held_irradiance, held_radiance, evaluations (virtual
// lights looked at from a point: bytes and the rest). Out: listed.

import package::common::basis::PI;
import package::common::evaluations::{evaluated, evaluations};
import package::common::fragment::{LIT, ROUGH};
import package::common::grid::{Grid, item_index};
import package::common::pyramid::{pyramid, texel_number, texel_of};
import package::common::shaded_point::{ShadedPoint, ShortLight, shares, specular_of};
import package::common::vpl_masks::{LISTED, VplListsParams, batch_word, mask_at};

override DISC: bool = false;
override GLOSSY: bool = false;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: VplListsParams;
@group(0) @binding(1) var<storage, read> points: array<ShadedPoint>;
@group(0) @binding(2) var<storage, read> short_lights: array<ShortLight>;
@group(0) @binding(3) var<storage, read> texel_state: array<u32>;
@group(0) @binding(4) var<storage, read_write> masks: array<u32>;
@group(0) @binding(5) var<storage, read_write> listed: array<u32>;
@group(0) @binding(6) var<storage, read> list: array<u32>;
@group(0) @binding(7) var<storage, read_write> held_irradiance: array<vec4f>;
@group(0) @binding(8) var<storage, read_write> held_radiance: array<vec4f>;

// The middle of a texel and of its four children, and what their lights sum up to.
struct Five {
    points: array<ShadedPoint, 5>,
    seen: array<bool, 4>,
    irradiance: array<vec3f, 4>,
    radiance: array<vec3f, 4>,
}

@compute @workgroup_size(64)
fn begin(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let number = pyramid.levels[pyramid.coarsest].z + i;
    let lit = (texel_state[number] & LIT) != 0u;
    listed[i] = select(0u, 1u, lit);
    for (var word = 0u; word < params.words; word++) {
        masks[mask_at(params, number, word)] = select(0u, batch_word(params, word), lit);
    }
}

fn child_of(texel: vec2u, k: u32) -> vec2u {
    return 2u * texel + vec2u(k & 1u, k >> 1u);
}

fn is_lit(size: vec4u, texel: vec2u) -> bool {
    return all(texel < size.xy) && (texel_state[select(0u, texel_number(size, texel), all(texel < size.xy))] & LIT) != 0u;
}

fn five_of(texel: vec2u) -> Five {
    let first = pyramid.levels[1].z;
    let below = pyramid.levels[pyramid.level - 1u];
    var five: Five;
    five.points[4] = points[texel_number(pyramid.levels[pyramid.level], texel) - first];
    for (var k = 0u; k < 4u; k++) {
        let child = child_of(texel, k);
        five.seen[k] = is_lit(below, child);
        five.points[k] = five.points[4];
        if five.seen[k] {
            five.points[k] = points[texel_number(below, child) - first];
        }
    }
    return five;
}

// Adds the light to the children unless one differs too much from the middle; whether it does.
fn differs(five: ptr<function, Five>, light: ShortLight, all_kept: bool) -> bool {
    let flux = light.flux.xyz;
    var found: array<vec2f, 5>;
    var looks: array<vec2f, 5>;
    for (var k = 0u; k < 5u; k++) {
        found[k] = shares((*five).points[k], light, DISC, params.reach, GLOSSY);
        let lobe = found[k].y * dot(flux, specular_of((*five).points[k]));
        looks[k] = vec2f(found[k].x * dot(flux, vec3f(1.0)), PI * lobe) / 3.0;
    }
    var most = 0.0;
    for (var k = 0u; k < 4u; k++) {
        let apart = abs(looks[k] - looks[4]);
        most = max(most, max(apart.x, apart.y));
    }
    if most > light.flux.w && !all_kept {
        return true;
    }
    for (var k = 0u; k < 4u; k++) {
        (*five).irradiance[k] += flux * found[k].x;
        (*five).radiance[k] += flux * specular_of((*five).points[k]) * found[k].y;
    }
    return false;
}

@compute @workgroup_size(64)
fn test(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= masks[LISTED] {
        return;
    }
    let size = pyramid.levels[pyramid.level];
    let texel = texel_of(size, list[i]);
    let number = size.z + list[i];
    let all_kept = pyramid.level == params.lowest;
    if (texel_state[number] & ROUGH) != 0u && !all_kept {
        return;
    }
    var five = five_of(texel);
    var looks = 0u;
    for (var word = 0u; word < params.words; word++) {
        let at = mask_at(params, number, word);
        var left = 0u;
        for (var mask = masks[at]; mask != 0u; mask &= mask - 1u) {
            let bit = firstTrailingBit(mask);
            looks += 5u;
            if differs(&five, short_lights[params.first + 32u * word + bit], all_kept) {
                left |= 1u << bit;
            }
        }
        masks[at] = left;
    }
    evaluated(looks);
    let below = pyramid.levels[pyramid.level - 1u];
    for (var k = 0u; k < 4u; k++) {
        if five.seen[k] {
            let held = texel_number(below, child_of(texel, k)) - pyramid.levels[1].z;
            held_irradiance[held] += vec4f(five.irradiance[k], 0.0);
            if GLOSSY {
                held_radiance[held] += vec4f(five.radiance[k], 0.0);
            }
        }
    }
}

@compute @workgroup_size(64)
fn split(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= masks[LISTED] {
        return;
    }
    let size = pyramid.levels[pyramid.level];
    let texel = texel_of(size, list[i]);
    let below = pyramid.levels[pyramid.level - 1u];
    var any_left = 0u;
    for (var word = 0u; word < params.words; word++) {
        any_left |= masks[mask_at(params, size.z + list[i], word)];
    }
    for (var k = 0u; k < 4u; k++) {
        let child = child_of(texel, k);
        if any_left != 0u && is_lit(below, child) {
            let number = texel_number(below, child);
            listed[number - below.z] = 1u;
            for (var word = 0u; word < params.words; word++) {
                masks[mask_at(params, number, word)] = masks[mask_at(params, size.z + list[i], word)];
            }
        }
    }
}

// A thread for each texel of level 1.
@compute @workgroup_size(64)
fn count(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let size = pyramid.levels[1];
    var pixels = 0u;
    for (var k = 0u; k < 4u; k++) {
        pixels += select(0u, 1u, is_lit(pyramid.levels[0], child_of(texel_of(size, i), k)));
    }
    var left = 0u;
    for (var word = 0u; word < params.words; word++) {
        left += countOneBits(masks[mask_at(params, size.z + i, word)]);
    }
    if left != 0u {
        evaluated(left * pixels);
    }
}
