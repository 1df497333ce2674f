//! Trees as the WGSL traversal wants them: no deeper than its stack, triangles in the order of the leaves.
use glam::Vec3;

use super::trace_wgsl::TriangleRecord;
use crate::scene::bvh::{Blas, Bounds, Node2};

/// Levels of a mesh's tree and of the top level: together the 64 entries of `STACK` in `shaders/common/bvh.wgsl`, one
/// of which leads back from a mesh. A tree over unlike sizes may be deeper than a stack; it is then balanced instead,
/// and 2^22 instances of 2^39 leaves each still fit.
pub(super) const MESH_LEVELS: usize = 40;
pub(super) const TOP_LEVELS: usize = 23;

/// Levels of a tree whose children come after their parents.
fn levels(nodes: &[Node2]) -> usize {
    let mut level = vec![1usize; nodes.len()];
    for (at, node) in nodes.iter().enumerate().filter(|(_, node)| !node.is_leaf()) {
        let (first, below) = (node.first as usize, level[at] + 1);
        level[first] = below;
        level[first + 1] = below;
    }
    level.into_iter().max().unwrap_or(0)
}

/// The tree itself, or a balanced one over the same leaves when it has more than `most` levels.
pub(super) fn within(nodes: &[Node2], most: usize) -> Vec<Node2> {
    if levels(nodes) <= most { nodes.to_vec() } else { balanced(nodes) }
}

fn node(lo: Vec3, hi: Vec3, first: u32) -> Node2 {
    Node2 { lo: lo.into(), first, hi: hi.into(), count: 0 }
}

/// A tree with the same leaves and as few levels as can be: halves by the middles of the boxes.
fn balanced(nodes: &[Node2]) -> Vec<Node2> {
    let mut leaves: Vec<Node2> = nodes.iter().filter(|n| n.is_leaf()).copied().collect();
    let mut tree = vec![Node2 { lo: [0.0; 3], first: 0, hi: [0.0; 3], count: 0 }];
    let mut todo = vec![(0, 0..leaves.len())];
    while let Some((at, range)) = todo.pop() {
        let part = &mut leaves[range.clone()];
        if let [leaf] = part {
            tree[at] = *leaf;
            continue;
        }
        let all = part.iter().map(Node2::bounds).fold(Bounds::EMPTY, Bounds::union);
        let axis = widest(part);
        // A tie is broken by the leaf's place: the same tree every time.
        part.sort_by(|a, b| middle(a)[axis].total_cmp(&middle(b)[axis]).then(a.first.cmp(&b.first)));
        let child = tree.len();
        tree[at] = node(all.lo, all.hi, child as u32);
        tree.extend([node(Vec3::ZERO, Vec3::ZERO, 0); 2]);
        let half = range.start + range.len() / 2;
        todo.push((child, range.start..half));
        todo.push((child + 1, half..range.end));
    }
    tree
}

fn middle(node: &Node2) -> Vec3 {
    0.5 * Vec3::from(node.lo) + 0.5 * Vec3::from(node.hi)
}

/// Axis along which the middles spread most.
fn widest(part: &[Node2]) -> usize {
    let grow = |all: Bounds, n: &Node2| all.union(Bounds { lo: middle(n), hi: middle(n) });
    let spread = part.iter().fold(Bounds::EMPTY, grow);
    let extent = 0.5 * spread.hi - 0.5 * spread.lo;
    extent.max_position()
}

/// Triangles in the order of the leaves.
pub(super) fn triangles(blas: &Blas) -> Vec<TriangleRecord> {
    let order = blas.triangle_order();
    let most = order.iter().max().map_or(0, |&t| t as usize + 1);
    let mut by_id = vec![TriangleRecord::default(); most];
    for block in blas.blocks() {
        for (slot, &id) in block.triangle.iter().enumerate() {
            let corner = |vertex: usize| block.corner[vertex].map(|axis| axis[slot]);
            let [a, b, c] = [corner(0), corner(1), corner(2)];
            by_id[id as usize] = TriangleRecord { a, id, b, pad_b: 0, c, pad_c: 0 };
        }
    }
    order.iter().map(|&id| by_id[id as usize]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn leaf(x: f32, size: f32, first: u32) -> Node2 {
        Node2 { lo: [x - size; 3], first, hi: [x + size; 3], count: 1 }
    }

    /// A chain: every inner node has a leaf and the rest.
    fn chain(count: usize) -> Vec<Node2> {
        let mut nodes = vec![node(Vec3::splat(-1e30), Vec3::splat(1e30), 1)];
        for i in 0..count as u32 - 1 {
            let first = nodes.len() as u32 + 2;
            nodes.push(leaf(i as f32, 0.5, i));
            let rest = node(Vec3::splat(i as f32), Vec3::splat(1e30), first);
            nodes.push(if i + 2 == count as u32 { leaf(i as f32 + 1.0, 0.5, i + 1) } else { rest });
        }
        nodes
    }

    #[test]
    fn deep_trees_are_balanced_and_keep_their_leaves() {
        let deep = chain(1000);
        assert_eq!(levels(&deep), 1000);
        assert_eq!(within(&deep, 1000), deep);
        let flat = within(&deep, MESH_LEVELS);
        assert_eq!(levels(&flat), 11);
        let mut slots: Vec<u32> = flat.iter().filter(|n| n.is_leaf()).map(|n| n.first).collect();
        slots.sort_unstable();
        assert_eq!(slots, (0..1000).collect::<Vec<_>>());
        for inner in flat.iter().filter(|n| !n.is_leaf()) {
            let pair = &flat[inner.first as usize..inner.first as usize + 2];
            assert_eq!(inner.bounds(), pair[0].bounds().union(pair[1].bounds()));
        }
    }

    #[test]
    fn the_stack_of_the_shader_is_large_enough() {
        let text = crate::gpu::source("common/bvh").unwrap();
        assert!(text.contains(&format!("const STACK: u32 = {}u;", MESH_LEVELS + TOP_LEVELS + 1)));
    }
}
