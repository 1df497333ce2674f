//! Bounding volume hierarchies: one per mesh ([`Blas`]) and one over the instances ([`Tlas`]).
//!
//! A `Blas` keeps two layouts of the same tree: binary nodes (`obvhs`: PLOC, reinsertion, collapse) for the WGSL
//! traversal, and nodes of eight children with triangles in blocks of four for the native one.
//! A `Tlas` holds boxes of instances only, so that moving a mesh costs microseconds.
mod build;
mod tlas;
mod wide;

pub use build::Node2;
pub use tlas::Tlas;
pub use wide::{Child, Node8, TriangleBlock};

use glam::Vec3;

use super::mesh::next_id;

/// Most triangles of a leaf: one [`TriangleBlock`].
pub const LEAF_TRIANGLES: usize = 4;

/// Axis-aligned box; `lo > hi` when empty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Smallest corner.
    pub lo: Vec3,
    /// Largest corner.
    pub hi: Vec3,
}

impl Bounds {
    /// Nothing.
    pub const EMPTY: Self = Self { lo: Vec3::INFINITY, hi: Vec3::NEG_INFINITY };

    /// Smallest box with both in it.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { lo: self.lo.min(other.lo), hi: self.hi.max(other.hi) }
    }

    /// True when nothing is inside.
    pub fn is_empty(&self) -> bool {
        !(self.lo.x <= self.hi.x && self.lo.y <= self.hi.y && self.lo.z <= self.hi.z)
    }

    /// Half of the surface area.
    pub fn half_area(&self) -> f32 {
        let d = self.hi - self.lo;
        d.x * d.y + d.y * d.z + d.z * d.x
    }

    /// Largest absolute coordinate, 0 when empty.
    pub fn max_abs(&self) -> f32 {
        if self.is_empty() { 0.0 } else { self.lo.abs().max(self.hi.abs()).max_element() }
    }
}

/// Bottom level: the triangles of one mesh in object space.
#[derive(Clone, Debug, Default)]
pub struct Blas {
    id: u64,
    nodes: Vec<Node2>,
    order: Vec<u32>,
    wide: Vec<Node8>,
    blocks: Vec<TriangleBlock>,
    wide_depth: usize,
    depth: usize,
}

impl Blas {
    /// Builds over `triangles` (indices into `positions`). A triangle with an index out of range or a vertex that
    /// is not finite is left out, so that no ray hits it.
    pub fn build(positions: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let (kept, boxes) = build::triangle_boxes(positions, triangles);
        let (nodes, mut order) = build::build_binary(&boxes, LEAF_TRIANGLES);
        for slot in &mut order {
            *slot = kept[*slot as usize];
        }
        Self::assemble(nodes, order, positions, triangles)
    }

    /// The same tree with its boxes fitted to moved vertices: quick, but the tree gets worse with large motion.
    /// `triangles` must be those of the build; where the set of finite triangles has changed, it rebuilds.
    #[must_use]
    pub fn refit(&self, positions: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let (kept, boxes) = build::triangle_boxes(positions, triangles);
        let mut sorted = self.order.clone();
        sorted.sort_unstable();
        if kept != sorted {
            return Self::build(positions, triangles);
        }
        let mut slot_of = vec![0; triangles.len()];
        for (slot, &triangle) in kept.iter().enumerate() {
            slot_of[triangle as usize] = slot;
        }
        let ordered: Vec<Bounds> = self.order.iter().map(|&t| boxes[slot_of[t as usize]]).collect();
        let mut nodes = self.nodes.clone();
        build::fit(&mut nodes, &ordered);
        Self::assemble(nodes, self.order.clone(), positions, triangles)
    }

    /// A new tree for moved vertices; the same as [`Blas::build`].
    #[must_use]
    pub fn rebuild(&self, positions: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        Self::build(positions, triangles)
    }

    fn assemble(nodes: Vec<Node2>, order: Vec<u32>, positions: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let depth = build::depth(&nodes);
        let wide = wide::collapse(&nodes);
        let blocks = wide::blocks(&wide.leaves, &order, positions, triangles);
        Self { id: next_id(), nodes, order, wide: wide.nodes, blocks, wide_depth: wide.depth, depth }
    }

    /// A number that no other tree has, but its clones; 0: an empty one. An address would be taken again by the next.
    pub fn id(&self) -> u64 {
        self.id
    }

    /// Binary nodes: node 0 is the root, children come after their parent and side by side; empty without triangles.
    pub fn nodes_bvh2(&self) -> &[Node2] {
        &self.nodes
    }

    /// Triangle (index of the build) in each slot that a leaf of [`Blas::nodes_bvh2`] names.
    pub fn triangle_order(&self) -> &[u32] {
        &self.order
    }

    /// Levels of the binary tree: a traversal needs a stack of at most this many entries.
    pub fn depth_bvh2(&self) -> usize {
        self.depth
    }

    /// Number of triangles that a ray may hit.
    pub fn triangle_count(&self) -> usize {
        self.order.len()
    }

    /// Box of all triangles.
    pub fn bounds(&self) -> Bounds {
        self.nodes.first().map_or(Bounds::EMPTY, Node2::bounds)
    }

    /// Eight-wide nodes, node 0 the root.
    pub fn nodes_wide(&self) -> &[Node8] {
        &self.wide
    }

    /// Triangles as the native intersector reads them.
    pub fn blocks(&self) -> &[TriangleBlock] {
        &self.blocks
    }

    /// Levels of the eight-wide tree.
    pub fn depth_wide(&self) -> usize {
        self.wide_depth
    }
}
