//! The layout of the native traversal: nodes of eight children, triangles in blocks of four.
use super::{LEAF_TRIANGLES, Node2};
use glam::Vec3;
use rayon::prelude::*;

/// What a slot of a [`Node8`] leads to: a node, or a leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub struct Child(u32);

impl Child {
    const LEAF: u32 = 1 << 31;
    const COUNT_SHIFT: u32 = 28;
    /// Root of a tree.
    pub const ROOT: Self = Self(0);
    /// An unused slot: a leaf without triangles.
    pub const NONE: Self = Self(Self::LEAF);

    /// Inner node `index`.
    pub fn node(index: usize) -> Self {
        debug_assert!(index < 1 << 28);
        Self(index as u32)
    }

    /// Leaf `index` (a block, or an instance) of `count` ≤ 4 triangles.
    pub fn leaf(index: usize, count: usize) -> Self {
        debug_assert!(index < 1 << 28 && count <= LEAF_TRIANGLES);
        Self(Self::LEAF | (count as u32) << Self::COUNT_SHIFT | index as u32)
    }

    /// True for a leaf.
    #[inline(always)]
    pub fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    /// Index of the node, block or instance.
    #[inline(always)]
    pub fn index(self) -> usize {
        (self.0 & ((1 << Self::COUNT_SHIFT) - 1)) as usize
    }

    /// Number of triangles of a leaf.
    #[inline(always)]
    pub fn count(self) -> usize {
        (self.0 >> Self::COUNT_SHIFT & 7) as usize
    }
}

/// Eight children: 256 bytes.
#[repr(C, align(64))]
#[derive(Clone, Debug)]
pub struct Node8 {
    /// Rows lo.x, lo.y, lo.z, hi.x, hi.y, hi.z; an unused slot holds an empty box.
    pub bounds: [[f32; 8]; 6],
    /// What each slot leads to.
    pub children: [Child; 8],
    /// Number of used slots, which come first.
    pub count: u32,
}

impl Node8 {
    /// No child.
    pub const EMPTY: Self = Self {
        bounds: [
            [f32::INFINITY; 8],
            [f32::INFINITY; 8],
            [f32::INFINITY; 8],
            [f32::NEG_INFINITY; 8],
            [f32::NEG_INFINITY; 8],
            [f32::NEG_INFINITY; 8],
        ],
        children: [Child::NONE; 8],
        count: 0,
    };

    /// Adds a child; there must be a free slot.
    pub fn push(&mut self, node: &Node2, child: Child) {
        let slot = self.count as usize;
        for axis in 0..3 {
            self.bounds[axis][slot] = node.lo[axis];
            self.bounds[axis + 3][slot] = node.hi[axis];
        }
        self.children[slot] = child;
        self.count += 1;
    }
}

impl Node8 {
    /// Adds a child of another node; there must be a free slot.
    pub fn copy_child(&mut self, from: &Self, slot: usize) {
        let to = self.count as usize;
        for row in 0..6 {
            self.bounds[row][to] = from.bounds[row][slot];
        }
        self.children[to] = from.children[slot];
        self.count += 1;
    }
}

/// Up to four triangles, structure of arrays: 160 bytes. Free slots repeat the first triangle.
#[repr(C, align(32))]
#[derive(Clone, Debug)]
pub struct TriangleBlock {
    /// Coordinate of a slot: `corner[vertex][axis][slot]`.
    pub corner: [[[f32; 4]; 3]; 3],
    /// Index of the triangle in its mesh.
    pub triangle: [u32; 4],
}

/// An eight-wide tree, and the binary leaf behind each of its leaves.
pub(super) struct WideTree {
    pub(super) nodes: Vec<Node8>,
    /// First slot and count of each leaf.
    pub(super) leaves: Vec<(u32, u32)>,
    pub(super) depth: usize,
}

/// Children of a wide node: opens the largest inner box until there are eight.
fn open(nodes: &[Node2], root: usize) -> Vec<usize> {
    let mut slots = Vec::with_capacity(8);
    if nodes[root].is_leaf() {
        slots.push(root);
        return slots;
    }
    slots.extend([nodes[root].first as usize, nodes[root].first as usize + 1]);
    while slots.len() < 8 {
        let area = |&slot: &usize| nodes[slots[slot]].bounds().half_area();
        let inner = (0..slots.len()).filter(|&slot| !nodes[slots[slot]].is_leaf());
        let Some(largest) = inner.max_by(|a, b| area(a).total_cmp(&area(b))) else { break };
        let first = nodes[slots[largest]].first as usize;
        slots[largest] = first;
        slots.push(first + 1);
    }
    slots
}

/// Eight-wide tree over a binary one.
pub(super) fn collapse(nodes: &[Node2]) -> WideTree {
    let mut tree = WideTree { nodes: Vec::new(), leaves: Vec::new(), depth: 0 };
    if nodes.is_empty() {
        return tree;
    }
    tree.nodes.push(Node8::EMPTY);
    let mut todo = vec![(0, 0, 1)];
    while let Some((root, at, depth)) = todo.pop() {
        tree.depth = tree.depth.max(depth);
        let mut wide = Node8::EMPTY;
        for slot in open(nodes, root) {
            let node = &nodes[slot];
            let child = if node.is_leaf() {
                tree.leaves.push((node.first, node.count));
                Child::leaf(tree.leaves.len() - 1, node.count as usize)
            } else {
                tree.nodes.push(Node8::EMPTY);
                todo.push((slot, tree.nodes.len() - 1, depth + 1));
                Child::node(tree.nodes.len() - 1)
            };
            wide.push(node, child);
        }
        tree.nodes[at] = wide;
    }
    tree
}

/// Triangle blocks of the leaves.
pub(super) fn blocks(
    leaves: &[(u32, u32)],
    order: &[u32],
    positions: &[Vec3],
    triangles: &[[u32; 3]],
) -> Vec<TriangleBlock> {
    let block = |&(first, count): &(u32, u32)| {
        let mut block = TriangleBlock { corner: [[[0.0; 4]; 3]; 3], triangle: [0; 4] };
        for slot in 0..LEAF_TRIANGLES {
            let used = if slot < count as usize { slot } else { 0 };
            let triangle = order[first as usize + used];
            block.triangle[slot] = triangle;
            for (vertex, &index) in triangles[triangle as usize].iter().enumerate() {
                let p = positions[index as usize];
                for axis in 0..3 {
                    block.corner[vertex][axis][slot] = p[axis];
                }
            }
        }
        block
    };
    leaves.par_iter().with_min_len(4096).map(block).collect()
}
