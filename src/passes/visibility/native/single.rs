//! One ray: eight boxes or four triangles at a time.
use super::packet::State;
use super::rays::Local;
use super::simd::{Isa, Lanes, Mask, set_lanes, three};
use super::triangle::{Shear, cross};
use crate::scene::bvh::{Blas, Child, Node8, TriangleBlock};

/// A subtree that waits, and where the ray enters it.
#[derive(Clone, Copy)]
pub(crate) struct Entry {
    child: Child,
    near: f32,
}

impl Entry {
    pub(crate) const IDLE: Self = Self { child: Child::NONE, near: 0.0 };
}

/// One ray, each value in all lanes.
struct SingleRay<I: Isa> {
    inverse: [I::Node; 3],
    near: [I::Node; 3],
    far: [I::Node; 3],
    start: I::Node,
    near_row: [usize; 3],
    far_row: [usize; 3],
    axes: [usize; 3],
    origin: [I::Block; 3],
    shear: Shear<I::Block>,
    t_min: I::Block,
}

impl<I: Isa> SingleRay<I> {
    #[inline(always)]
    fn new(local: &Local, lane: usize, state: &State) -> Self {
        let heading = local.heading;
        let back = three!(i => (heading.negative[i] >> lane & 1) as usize * 3);
        let z = (heading.major[1] >> lane & 1) as usize + 2 * (heading.major[2] >> lane & 1) as usize;
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        Self {
            inverse: three!(i => I::Node::splat(heading.inverse[i].0[lane])),
            near: three!(i => I::Node::splat(local.near[i].0[lane])),
            far: three!(i => I::Node::splat(local.far[i].0[lane])),
            start: I::Node::splat(state.t_min.0[lane]),
            near_row: three!(i => i + back[i]),
            far_row: three!(i => i + 3 - back[i]),
            axes,
            origin: three!(i => I::Block::splat(local.origin[axes[i]].0[lane])),
            shear: Shear {
                x: I::Block::splat(heading.shear[0].0[lane]),
                y: I::Block::splat(heading.shear[1].0[lane]),
                z: I::Block::splat(heading.shear[2].0[lane]),
            },
            t_min: I::Block::splat(state.t_min.0[lane]),
        }
    }

    /// Children that the ray enters before `end`, and where.
    #[inline(always)]
    fn enter(&self, node: &Node8, end: f32) -> (u32, [f32; 8]) {
        let near = three!(i => I::Node::load(&node.bounds[self.near_row[i]]).fma(self.inverse[i], self.near[i]));
        let far = three!(i => I::Node::load(&node.bounds[self.far_row[i]]).fma(self.inverse[i], self.far[i]));
        let start = near[0].max(near[1]).max(near[2]).max(self.start);
        let stop = far[0].min(far[1]).min(far[2]).min(I::Node::splat(end));
        let mut distances = [0.0; 8];
        start.store(&mut distances);
        (start.not_gt(stop).bits(), distances)
    }
}

/// Corners relative to the origin, in the sheared order of axes.
#[inline(always)]
fn corner<I: Isa>(ray: &SingleRay<I>, corner: &[[f32; 4]; 3]) -> [I::Block; 3] {
    three!(i => I::Block::load(&corner[ray.axes[i]]) - ray.origin[i])
}

/// Tests the triangles of a block; true when the ray is finished.
#[inline(always)]
fn block<I: Isa, const ANY: bool>(
    ray: &SingleRay<I>,
    block: &TriangleBlock,
    lane: usize,
    state: &mut State,
    instance: u32,
) -> bool {
    let [a, b, c] = three!(v => corner(ray, &block.corner[v]));
    let all = <I::Block as Lanes>::M::from_bits(15);
    let Some(crossing) = cross(a, b, c, &ray.shear, all) else { return false };
    let end = I::Block::splat(state.t.0[lane]);
    let after = crossing.mask.and(ray.t_min.lt(crossing.t));
    if ANY {
        let hit = after.and(crossing.t.lt(end)).bits() != 0;
        state.alive &= !(u32::from(hit) << lane);
        return hit;
    }
    for slot in set_lanes(after.and(crossing.t.le(end)).bits()) {
        let (t, triangle) = (crossing.t.lane(slot), block.triangle[slot]);
        if t < state.t.0[lane] || (t == state.t.0[lane] && state.wins_tie(lane, instance, triangle)) {
            state.t.0[lane] = t;
            state.weight1.0[lane] = crossing.weight1.lane(slot);
            state.weight2.0[lane] = crossing.weight2.lane(slot);
            state.instance[lane] = instance;
            state.triangle[lane] = triangle;
        }
    }
    false
}

/// Traces one ray of a packet through the subtree `root` of a mesh.
#[inline(always)]
pub(crate) fn traverse<I: Isa, const ANY: bool>(
    blas: &Blas,
    local: &Local,
    lane: usize,
    root: Child,
    state: &mut State,
    stack: &mut [Entry],
    instance: u32,
) {
    let ray = SingleRay::<I>::new(local, lane, state);
    stack[0] = Entry { child: root, near: state.t_min.0[lane] };
    let mut top = 1;
    while top > 0 {
        top -= 1;
        let Entry { child, near } = stack[top];
        if !ANY && near > state.t.0[lane] {
            continue;
        }
        if child.is_leaf() {
            if block::<I, ANY>(&ray, &blas.blocks()[child.index()], lane, state, instance) {
                return;
            }
            continue;
        }
        let node = &blas.nodes_wide()[child.index()];
        let (entered, distances) = ray.enter(node, state.t.0[lane]);
        let base = top;
        for slot in set_lanes(entered & ((1 << node.count) - 1)) {
            let entry = Entry { child: node.children[slot], near: distances[slot] };
            let mut at = top;
            while at > base && stack[at - 1].near < entry.near {
                stack[at] = stack[at - 1];
                at -= 1;
            }
            stack[at] = entry;
            top += 1;
        }
    }
}
