//! The upper level: a packet through the boxes of the instances and into each.
use super::super::trace_native::TraceScene;
use super::packet::{self, Entry, Scratch, Slabs, State};
use super::rays::{Bundle, Heading, Local, enter_direction, enter_origin, rows};
use super::simd::Isa;

/// Traces a packet; its answers are in the state.
#[inline(always)]
pub(crate) fn trace<I: Isa, const ANY: bool>(scene: &TraceScene, bundle: &mut Bundle, scratch: &mut Scratch) -> State {
    bundle.check::<I::Packet>();
    let mut state = State::new(bundle.t_min, bundle.t_max, bundle.active);
    if bundle.active == 0 || scene.tlas.nodes().is_empty() {
        return state;
    }
    let heading = Heading::new::<I::Packet>(&bundle.direction);
    let local = Local::new(rows::<I::Packet>(&bundle.origin), &heading, scene.tlas.bounds().max_abs());
    let slabs = Slabs::<I::Packet>::new(&local, bundle.active);
    let coherent = heading.is_coherent(bundle.active);
    let mut stack = std::mem::take(&mut scratch.scene);
    stack[0] = Entry::root(&state);
    let mut top = 1;
    while top > 0 {
        top -= 1;
        let (child, mask) = stack[top].take::<I::Packet, ANY>(&state);
        if mask == 0 {
            continue;
        }
        if child.is_leaf() {
            visit::<I, ANY>(scene, bundle, &heading, child.index(), mask, &mut state, scratch);
            continue;
        }
        let node = &scene.tlas.nodes()[child.index()];
        top = if coherent {
            packet::descend::<I::Packet, true>(node, &slabs, mask, &state, &mut stack, top)
        } else {
            packet::descend::<I::Packet, false>(node, &slabs, mask, &state, &mut stack, top)
        };
    }
    scratch.scene = stack;
    state
}

/// Takes the rays of `mask` into instance `index`.
#[inline(always)]
fn visit<I: Isa, const ANY: bool>(
    scene: &TraceScene,
    bundle: &Bundle,
    heading: &Heading,
    index: usize,
    mask: u32,
    state: &mut State,
    scratch: &mut Scratch,
) {
    let placed = &scene.placed[index];
    let origin = enter_origin::<I::Packet>(bundle, placed);
    let turned;
    let heading = if placed.identity {
        heading
    } else {
        turned = Heading::new::<I::Packet>(&enter_direction::<I::Packet>(bundle, placed));
        &turned
    };
    let local = Local::new(origin, heading, placed.reach);
    if heading.is_coherent(mask) {
        packet::traverse::<I, ANY, true>(&placed.blas, &local, mask, state, scratch, index as u32);
    } else {
        packet::traverse::<I, ANY, false>(&placed.blas, &local, mask, state, scratch, index as u32);
    }
}
