//! Portals: the few subtrees that a whole group of rays with one origin can reach.
//!
//! A receiver asks for hundreds of samples of one light. The shaft around all of them is taken through the trees once;
//! what is left is often nothing (no occluder near), and otherwise a short list from which every packet starts.
use super::super::trace_native::TraceScene;
use super::packet::Portals;
use super::scene::{Group, enter_shaft};
use super::shaft::Shaft;
use super::simd::{Isa, set_lanes};
use crate::scene::bvh::{Blas, Child, Node8};

/// Nodes that are opened per instance at most.
const OPENED: usize = 12;

/// Appends a child of `from` to the made-up nodes from `first` on.
fn keep(nodes: &mut Vec<Node8>, first: usize, from: &Node8, slot: usize) {
    if nodes.len() == first || nodes.last().is_some_and(|node| node.count == 8) {
        nodes.push(Node8::EMPTY);
    }
    if let Some(node) = nodes.last_mut() {
        node.copy_child(from, slot);
    }
}

/// Portals into one mesh.
#[inline(always)]
fn open_mesh<I: Isa>(blas: &Blas, shaft: &Shaft, instance: u32, portals: &mut Portals) {
    let nodes = blas.nodes_wide();
    let first = portals.nodes.len();
    let mut queue = [Child::ROOT; OPENED];
    let (mut head, mut tail) = (0, 1);
    while head < tail {
        let node = &nodes[queue[head].index()];
        head += 1;
        for slot in set_lanes(shaft.test::<I::Node>(node)) {
            let child = node.children[slot];
            if !child.is_leaf() && tail < OPENED {
                queue[tail] = child;
                tail += 1;
            } else if !child.is_leaf() || shaft.may_meet::<I::Block>(&blas.blocks()[child.index()]) {
                keep(&mut portals.nodes, first, node, slot);
            }
        }
    }
    if portals.nodes.len() > first {
        portals.instances.push((instance, portals.nodes.len()));
    }
}

/// All portals of a group of rays, instance after instance.
#[inline(always)]
pub(crate) fn open<I: Isa>(scene: &TraceScene, group: &Group, portals: &mut Portals) {
    portals.nodes.clear();
    portals.instances.clear();
    let nodes = scene.tlas.nodes();
    if nodes.is_empty() {
        return;
    }
    let shaft = group.shaft(scene.tlas.bounds().max_abs());
    let mut todo = vec![];
    let mut next = Some(Child::ROOT);
    while let Some(at) = next {
        let node = &nodes[at.index()];
        for slot in set_lanes(shaft.test::<I::Node>(node)) {
            let child = node.children[slot];
            if child.is_leaf() {
                let placed = &scene.placed[child.index()];
                let shaft = enter_shaft(placed, group);
                open_mesh::<I>(&placed.blas, &shaft, child.index() as u32, portals);
            } else {
                todo.push(child);
            }
        }
        next = todo.pop();
    }
}
