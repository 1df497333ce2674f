//! The upper level: a packet through the boxes of the instances and into each.
use super::super::trace_native::TraceScene;
use super::instance::Placed;
use super::packet::{self, Entered, Scratch, Slabs, State, pop_or};
use super::rays::{Bundle, Heading, Local, enter_direction, enter_origin, rows};
use super::shaft::{Interval, Shaft};
use super::simd::{Isa, Lanes, three};
use crate::scene::bvh::Node8;

/// A packet that is ready to enter instances: what all of them need of it.
pub(crate) struct Launch<'a> {
    pub(crate) bundle: &'a Bundle,
    pub(crate) heading: Heading,
    /// Bounds of its rays; only where they come for free, else they cost more than they save.
    pub(crate) group: Option<Group>,
}

/// Where a group of rays begins and ends.
#[derive(Clone, Copy)]
pub(crate) struct Group {
    pub(crate) origin: Interval,
    /// Where they are at `t` = 1.
    pub(crate) target: Interval,
    /// Largest end of a ray.
    pub(crate) t_max: f32,
}

impl Group {
    /// The shaft of the group in a space that boxes fill up to `reach` from the middle.
    #[inline(always)]
    pub(crate) fn shaft(&self, reach: f32) -> Shaft {
        Shaft::new(&self.origin, &self.target, self.t_max, reach)
    }
}

impl<'a> Launch<'a> {
    /// Prepares a checked packet.
    #[inline(always)]
    fn new<P: Lanes>(bundle: &'a Bundle) -> Self {
        Self { bundle, heading: Heading::new::<P>(&bundle.direction), group: None }
    }
}

/// Traces a packet; its answers are in the state.
#[inline(always)]
pub(crate) fn trace<I: Isa, const ANY: bool>(scene: &TraceScene, bundle: &mut Bundle, scratch: &mut Scratch) -> State {
    bundle.check::<I::Packet>();
    let mut state = State::new(bundle.t_min, bundle.t_max, bundle.active);
    let nodes = scene.tlas.nodes();
    if bundle.active == 0 || nodes.is_empty() {
        return state;
    }
    let launch = Launch::new::<I::Packet>(bundle);
    let reach = scene.tlas.bounds().max_abs();
    let local = Local::new(rows::<I::Packet>(&bundle.origin), &launch.heading, reach);
    let slabs = Slabs::<I::Packet>::new(&local, bundle.active);
    let shaft = Shaft::NONE;
    scratch.scene.clear();
    let all = bundle.active;
    let mut next = packet::descend::<I, ANY, false>(&nodes[0], &slabs, &shaft, all, &state, &mut scratch.scene);
    while let Some((child, mask)) = pop_or::<I::Packet, ANY>(next.take(), &mut scratch.scene, &state) {
        if child.is_leaf() {
            let placed = &scene.placed[child.index()];
            let roots = &placed.blas.nodes_wide()[..1];
            visit::<I, ANY>(placed, child.index(), roots, &launch, mask, &mut state, scratch);
        } else {
            let node = &nodes[child.index()];
            next = packet::descend::<I, ANY, false>(node, &slabs, &shaft, mask, &state, &mut scratch.scene);
        }
    }
    state
}

/// Takes the rays of `mask` into an instance, through the subtrees below `roots`.
#[inline(always)]
pub(crate) fn visit<I: Isa, const ANY: bool>(
    placed: &Placed,
    index: usize,
    roots: &[Node8],
    launch: &Launch,
    mask: u32,
    state: &mut State,
    scratch: &mut Scratch,
) {
    let bundle = launch.bundle;
    let origin = enter_origin::<I::Packet>(bundle, placed);
    let turned;
    let heading = if placed.identity {
        &launch.heading
    } else {
        turned = Heading::new::<I::Packet>(&enter_direction::<I::Packet>(bundle, placed));
        &turned
    };
    let local = Local::new(origin, heading, placed.reach);
    let shaft = match &launch.group {
        Some(group) if placed.blas.nodes_wide().len() > FEW_NODES => enter_shaft(placed, group),
        _ => Shaft::NONE,
    };
    let entered = Entered { blas: &placed.blas, local, shaft, instance: index as u32 };
    if heading.is_coherent(mask) {
        packet::traverse::<I, ANY, true>(&entered, roots, mask, state, scratch);
    } else {
        packet::traverse::<I, ANY, false>(&entered, roots, mask, state, scratch);
    }
}

/// A tree of this many nodes is not worth a shaft.
const FEW_NODES: usize = 3;

/// A group of rays in the object space of an instance.
#[inline(always)]
pub(crate) fn enter_shaft(placed: &Placed, group: &Group) -> Shaft {
    let (origin, target) = (group.origin.relative_to(placed.center), group.target.relative_to(placed.center));
    if placed.identity {
        return Shaft::new(&origin, &target, group.t_max, placed.reach);
    }
    // A ray is rounded as origin and direction: its end as the larger of the two.
    let (from, to) = (origin.reach(), target.reach());
    let reach = three!(i => from[i] + to[i]);
    let (origin, target) = (origin.turn(&placed.rows, reach), target.turn(&placed.rows, reach));
    Shaft::new(&origin, &target, group.t_max, placed.reach)
}
