//! Packets: one node or triangle against all rays of a packet.
use super::rays::{LANES, Local, Row, cycle, rows};
use super::shaft::Shaft;
use super::simd::{Isa, Lanes, Mask, set_lanes, three};
use super::single;
use super::triangle::{Crossing, Shear, cross};
use crate::scene::bvh::{Blas, Child, Node8, TriangleBlock};

/// A packet with this many rays left, or fewer, is finished ray by ray.
const SINGLE_BELOW: u32 = 3;

/// A packet in the space of a mesh.
pub(crate) struct Entered<'a> {
    pub(crate) blas: &'a Blas,
    pub(crate) local: Local<'a>,
    pub(crate) shaft: Shaft,
    pub(crate) instance: u32,
}

/// Where a group of rays enters the instances: a few subtrees of each as the children of made-up nodes.
#[derive(Default)]
pub(crate) struct Portals {
    pub(crate) nodes: Vec<Node8>,
    /// Instance, and the end of its nodes, which begin where those before end.
    pub(crate) instances: Vec<(u32, usize)>,
}

impl Portals {
    /// True when nothing can be reached.
    pub(crate) fn is_empty(&self) -> bool {
        self.instances.is_empty()
    }
}

/// What the rays of a packet know so far.
pub(crate) struct State {
    pub(crate) t_min: Row,
    /// Nearest hit, or the end of the ray.
    pub(crate) t: Row,
    pub(crate) weight1: Row,
    pub(crate) weight2: Row,
    pub(crate) instance: [u32; LANES],
    pub(crate) triangle: [u32; LANES],
    /// Rays that still look: in any-hit mode a hit ends a ray.
    pub(crate) alive: u32,
}

impl State {
    /// Rays on their way.
    pub(crate) fn new(t_min: Row, t_max: Row, alive: u32) -> Self {
        let zero = Row([0.0; LANES]);
        let none = [u32::MAX; LANES];
        Self { t_min, t: t_max, weight1: zero, weight2: zero, instance: none, triangle: none, alive }
    }

    /// True when a hit at the same `t` goes before the one that the lane has.
    #[inline(always)]
    pub(crate) fn wins_tie(&self, lane: usize, instance: u32, triangle: u32) -> bool {
        self.instance[lane] != u32::MAX && (instance, triangle) < (self.instance[lane], self.triangle[lane])
    }

    /// Takes the crossings that are nearer; a tie goes to the smaller instance, then to the smaller triangle.
    #[inline(always)]
    fn accept<P: Lanes>(&mut self, crossing: &Crossing<P>, instance: u32, triangle: u32) {
        let best: P = self.t.get();
        let after = crossing.mask.and(self.t_min.get::<P>().lt(crossing.t));
        let mut taken = after.and(crossing.t.lt(best)).bits();
        for lane in set_lanes(after.and(crossing.t.eq(best)).bits()) {
            taken |= u32::from(self.wins_tie(lane, instance, triangle)) << lane;
        }
        if taken == 0 {
            return;
        }
        let mask = P::M::from_bits(taken);
        P::select(mask, crossing.t, best).store(&mut self.t.0);
        P::select(mask, crossing.weight1, self.weight1.get()).store(&mut self.weight1.0);
        P::select(mask, crossing.weight2, self.weight2.get()).store(&mut self.weight2.0);
        for lane in set_lanes(taken) {
            self.instance[lane] = instance;
            self.triangle[lane] = triangle;
        }
    }
}

/// Subtrees that wait, with the rays that want them.
pub(crate) struct Stack {
    entries: Vec<(Child, u32)>,
    /// Where each ray enters the box of an entry; closest-hit only.
    near: Vec<Row>,
    top: usize,
}

impl Stack {
    fn new(depth: usize) -> Self {
        let size = 8 * depth + 8;
        Self { entries: vec![(Child::NONE, 0); size], near: vec![Row([0.0; LANES]); size], top: 0 }
    }

    /// Forgets everything.
    #[inline(always)]
    pub(crate) fn clear(&mut self) {
        self.top = 0;
    }

    /// The next subtree, and the rays that still want it.
    #[inline(always)]
    pub(crate) fn pop<P: Lanes, const ANY: bool>(&mut self, state: &State) -> Option<(Child, u32)> {
        while self.top > 0 {
            self.top -= 1;
            let (child, mask) = self.entries[self.top];
            let wanted = if ANY { state.alive } else { self.near[self.top].get::<P>().le(state.t.get()).bits() };
            if mask & wanted != 0 {
                return Some((child, mask & wanted));
            }
        }
        None
    }
}

/// `next` if there is one, else what waits on top of the stack.
#[inline(always)]
pub(crate) fn pop_or<P: Lanes, const ANY: bool>(
    next: Option<(Child, u32)>,
    stack: &mut Stack,
    state: &State,
) -> Option<(Child, u32)> {
    if next.is_some() { next } else { stack.pop::<P, ANY>(state) }
}

/// Buffers of one thread.
pub(crate) struct Scratch {
    pub(crate) scene: Stack,
    pub(crate) packet: Stack,
    pub(crate) single: Vec<single::Entry>,
    pub(crate) portals: Portals,
    /// Samples to trace, by their bits.
    pub(crate) todo: Vec<u32>,
}

impl Scratch {
    /// Room for trees of `depth` levels, below a top level of `scene_depth`.
    pub(crate) fn new(scene_depth: usize, depth: usize) -> Self {
        Self {
            scene: Stack::new(scene_depth),
            packet: Stack::new(depth),
            single: vec![single::Entry::IDLE; 8 * depth + 8],
            portals: Portals::default(),
            todo: Vec::new(),
        }
    }
}

/// The slabs of a packet, in registers.
pub(crate) struct Slabs<P: Lanes> {
    inverse: [P; 3],
    near: [P; 3],
    far: [P; 3],
    negative: [P::M; 3],
    /// Rows of a node with the near and far planes; only where all rays agree in sign.
    near_row: [usize; 3],
    far_row: [usize; 3],
}

impl<P: Lanes> Slabs<P> {
    #[inline(always)]
    pub(crate) fn new(local: &Local, active: u32) -> Self {
        let negative = local.heading.negative;
        let back = three!(i => if negative[i] & active != 0 { 3 } else { 0 });
        Self {
            inverse: rows(&local.heading.inverse),
            near: rows(&local.near),
            far: rows(&local.far),
            negative: three!(i => P::M::from_bits(negative[i])),
            near_row: three!(i => i + back[i]),
            far_row: three!(i => i + 3 - back[i]),
        }
    }

    /// Where the rays enter and leave the box of a child.
    #[inline(always)]
    pub(crate) fn test<const COHERENT: bool>(&self, node: &Node8, slot: usize) -> (P, P) {
        let (near, far);
        if COHERENT {
            near = three!(i => P::splat(node.bounds[self.near_row[i]][slot]));
            far = three!(i => P::splat(node.bounds[self.far_row[i]][slot]));
        } else {
            let lo = three!(i => P::splat(node.bounds[i][slot]));
            let hi = three!(i => P::splat(node.bounds[i + 3][slot]));
            near = three!(i => P::select(self.negative[i], hi[i], lo[i]));
            far = three!(i => P::select(self.negative[i], lo[i], hi[i]));
        }
        let near = three!(i => near[i].fma(self.inverse[i], self.near[i]));
        let far = three!(i => far[i].fma(self.inverse[i], self.far[i]));
        (near[0].max(near[1]).max(near[2]), far[0].min(far[1]).min(far[2]))
    }
}

/// A corner relative to the origins, in the sheared order of axes.
#[inline(always)]
fn relative<P: Lanes, const COHERENT: bool>(
    local: &Local,
    corner: &[[f32; 4]; 3],
    slot: usize,
    axes: [usize; 3],
    is_z: P::M,
    is_y: P::M,
) -> [P; 3] {
    if COHERENT {
        three!(i => P::splat(corner[axes[i]][slot]) - local.origin[axes[i]].get())
    } else {
        cycle(three!(i => P::splat(corner[i][slot]) - local.origin[i].get()), is_z, is_y)
    }
}

/// Tests the triangles of a block; `COHERENT`: all rays share the largest component of their direction.
#[inline(always)]
fn block<P: Lanes, const ANY: bool, const COHERENT: bool>(
    local: &Local,
    block: &TriangleBlock,
    count: usize,
    mut active: u32,
    state: &mut State,
    instance: u32,
) {
    let [x, y, z] = rows::<P>(&local.heading.shear);
    let shear = Shear { x, y, z };
    let major = local.heading.major;
    let z = if major[2] & active != 0 { 2 } else { usize::from(major[1] & active != 0) };
    let axes = [(z + 1) % 3, (z + 2) % 3, z];
    let (is_z, is_y) = (P::M::from_bits(major[2]), P::M::from_bits(major[1]));
    for slot in 0..count {
        let [a, b, c] = three!(v => relative::<P, COHERENT>(local, &block.corner[v], slot, axes, is_z, is_y));
        let crossing = cross(a, b, c, &shear, P::M::from_bits(active));
        let Some(crossing) = crossing else { continue };
        if ANY {
            let inside = state.t_min.get::<P>().lt(crossing.t).and(crossing.t.lt(state.t.get()));
            active &= !crossing.mask.and(inside).bits();
            state.alive &= !crossing.mask.and(inside).bits();
            if active == 0 {
                return;
            }
        } else {
            state.accept(&crossing, instance, block.triangle[slot]);
        }
    }
}

/// Traces the `active` rays of a packet through the subtrees below `roots`.
#[inline(always)]
pub(crate) fn traverse<I: Isa, const ANY: bool, const COHERENT: bool>(
    entered: &Entered,
    roots: &[Node8],
    active: u32,
    state: &mut State,
    scratch: &mut Scratch,
) {
    let Entered { blas, local, shaft, instance } = entered;
    let slabs = Slabs::<I::Packet>::new(local, active);
    let nodes = blas.nodes_wide();
    let stack = &mut scratch.packet;
    stack.clear();
    for root in roots {
        let mask = active & state.alive;
        if mask == 0 {
            return;
        }
        let mut next = descend::<I, ANY, COHERENT>(root, &slabs, shaft, mask, state, stack);
        while let Some((child, mask)) = pop_or::<I::Packet, ANY>(next.take(), stack, state) {
            if child.is_leaf() {
                let triangles = &blas.blocks()[child.index()];
                block::<I::Packet, ANY, COHERENT>(local, triangles, child.count(), mask, state, *instance);
            } else if mask.count_ones() <= SINGLE_BELOW {
                for lane in set_lanes(mask) {
                    single::traverse::<I, ANY>(blas, local, lane, child, state, &mut scratch.single, *instance);
                }
            } else {
                next = descend::<I, ANY, COHERENT>(&nodes[child.index()], &slabs, shaft, mask, state, stack);
            }
        }
    }
}

/// Pushes the children of a node that rays enter, except the one to go on with: for closest hits the nearest.
#[inline(always)]
pub(crate) fn descend<I: Isa, const ANY: bool, const COHERENT: bool>(
    node: &Node8,
    slabs: &Slabs<I::Packet>,
    shaft: &Shaft,
    mask: u32,
    state: &State,
    stack: &mut Stack,
) -> Option<(Child, u32)> {
    let (start, end): (I::Packet, I::Packet) = (state.t_min.get(), state.t.get());
    let active = <I::Packet as Lanes>::M::from_bits(mask);
    let base = stack.top;
    let mut nearest = (f32::INFINITY, base);
    for slot in set_lanes(shaft.test::<I::Node>(node)) {
        let (near, far) = slabs.test::<COHERENT>(node, slot);
        let near = near.max(start);
        let hit = near.not_gt(far.min(end)).and(active).bits();
        // Written always, kept when hit: a branch here would be mispredicted half of the time.
        let top = stack.top;
        stack.entries[top] = (node.children[slot], hit);
        stack.top += usize::from(hit != 0);
        if !ANY {
            near.store(&mut stack.near[top].0);
            let key = stack.near[top].0[hit.trailing_zeros() as usize & (LANES - 1)];
            nearest = if hit != 0 && key < nearest.0 { (key, top) } else { nearest };
        }
    }
    if stack.top == base {
        return None;
    }
    stack.top -= 1;
    let next = if ANY { stack.top } else { nearest.1 };
    let entry = stack.entries[next];
    if next != stack.top {
        stack.entries[next] = stack.entries[stack.top];
        stack.near[next] = stack.near[stack.top];
    }
    Some(entry)
}
