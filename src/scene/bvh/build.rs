//! Binary trees by `obvhs`, in our own 32-byte nodes.
use super::Bounds;
use bytemuck::{Pod, Zeroable};
use glam::{Vec3, Vec3A};
use obvhs::{BvhBuildParams, aabb::Aabb, bvh2::builder::build_bvh2, ploc::PlocSearchDistance, ploc::SortPrecision};
use rayon::prelude::*;

/// A binary node as the GPU reads it: 32 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Node2 {
    /// Smallest corner.
    pub lo: [f32; 3],
    /// Inner node: index of the first child, the second follows. Leaf: first slot of the triangle order.
    pub first: u32,
    /// Largest corner.
    pub hi: [f32; 3],
    /// Number of triangles of a leaf; 0: an inner node.
    pub count: u32,
}

impl Node2 {
    /// True when it holds triangles.
    pub fn is_leaf(&self) -> bool {
        self.count > 0
    }

    /// Its box.
    pub fn bounds(&self) -> Bounds {
        Bounds { lo: self.lo.into(), hi: self.hi.into() }
    }

    fn set_bounds(&mut self, bounds: Bounds) {
        self.lo = bounds.lo.into();
        self.hi = bounds.hi.into();
    }
}

/// Indices of the usable triangles, and their boxes.
pub(super) fn triangle_boxes(positions: &[Vec3], triangles: &[[u32; 3]]) -> (Vec<u32>, Vec<Bounds>) {
    let corner = |i: u32| positions.get(i as usize).copied().filter(|p| p.is_finite());
    let boxed = |(index, t): (usize, &[u32; 3])| {
        let (a, b, c) = (corner(t[0])?, corner(t[1])?, corner(t[2])?);
        Some((index as u32, Bounds { lo: a.min(b).min(c), hi: a.max(b).max(c) }))
    };
    triangles.par_iter().enumerate().with_min_len(8192).filter_map(boxed).unzip()
}

/// A number in [0, 1) from an integer (Wellons' lowbias32 mixer).
fn hash_unit(mut x: u32) -> f32 {
    x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    ((x ^ (x >> 16)) >> 8) as f32 / 16_777_216.0
}

/// Boxes for the builder: in the unit cube, and each grown by a random hair.
///
/// PLOC merges a pair when each is the other's best partner. Among boxes that are alike (copies of one triangle, a
/// regular grid) ties are broken one way, only one pair agrees per sweep, and the build takes quadratic time. The
/// hair breaks the ties; the tree gets its exact boxes afterwards from [`fit`]. The cube keeps areas finite.
fn builder_boxes(boxes: &[Bounds]) -> Vec<Aabb> {
    let all = boxes.par_iter().copied().reduce(|| Bounds::EMPTY, Bounds::union);
    let extent = (all.hi * 0.5 - all.lo * 0.5).max_element() * 2.0;
    let scale = if extent > 0.0 && extent.is_finite() { 1.0 / extent } else { 1.0 };
    let scale = if scale.is_finite() { scale } else { 1.0 };
    let grown = |(index, b): (usize, &Bounds)| {
        let unit = |p: Vec3| Vec3A::from(((p - all.lo) * scale).clamp(Vec3::ZERO, Vec3::ONE));
        let (lo, hi) = (unit(b.lo), unit(b.hi));
        let hair = (hi - lo) * 1e-3 + Vec3A::splat(1e-7);
        let random = |salt: u32| hash_unit((index as u32).wrapping_mul(6).wrapping_add(salt));
        let low = Vec3A::new(random(0), random(1), random(2));
        let high = Vec3A::new(random(3), random(4), random(5));
        Aabb::new(lo - hair * low, hi + hair * high)
    };
    boxes.par_iter().enumerate().with_min_len(8192).map(grown).collect()
}

fn parameters(leaf_size: usize) -> BvhBuildParams {
    BvhBuildParams {
        pre_split: false,
        ploc_search_distance: PlocSearchDistance::Low,
        search_depth_threshold: 2,
        reinsertion_batch_ratio: 0.02,
        post_collapse_reinsertion_batch_ratio_multiplier: 1.0,
        sort_precision: SortPrecision::U64,
        max_prims_per_leaf: leaf_size as u32,
        collapse_traversal_cost: 3.0,
    }
}

/// Builds over `boxes`; returns the nodes and the box index of each slot.
pub(super) fn build_binary(boxes: &[Bounds], leaf_size: usize) -> (Vec<Node2>, Vec<u32>) {
    if boxes.is_empty() {
        return (Vec::new(), Vec::new());
    }
    let tree = build_bvh2(&builder_boxes(boxes), parameters(leaf_size), &mut std::time::Duration::default());
    let node = |i: u32| {
        let n = &tree.nodes[i as usize];
        Node2 { lo: [0.0; 3], first: n.first_index, hi: [0.0; 3], count: n.prim_count }
    };
    let mut nodes = vec![node(0)];
    let mut order = Vec::with_capacity(boxes.len());
    // Depth first, pairs side by side, children after their parent: `fit` is then one backward sweep.
    let mut todo = vec![0];
    while let Some(at) = todo.pop() {
        let n: Node2 = nodes[at];
        if n.is_leaf() {
            let slots = n.first as usize..(n.first + n.count) as usize;
            nodes[at].first = order.len() as u32;
            order.extend_from_slice(&tree.primitive_indices[slots]);
        } else {
            let child = nodes.len();
            nodes[at].first = child as u32;
            nodes.extend([node(n.first), node(n.first + 1)]);
            todo.extend([child + 1, child]);
        }
    }
    let ordered: Vec<Bounds> = order.iter().map(|&i| boxes[i as usize]).collect();
    fit(&mut nodes, &ordered);
    (nodes, order)
}

/// Fits every box to `ordered`, the boxes of the slots.
pub(super) fn fit(nodes: &mut [Node2], ordered: &[Bounds]) {
    for at in (0..nodes.len()).rev() {
        let n = nodes[at];
        let first = n.first as usize;
        let bounds = if n.is_leaf() {
            ordered[first..first + n.count as usize].iter().copied().fold(Bounds::EMPTY, Bounds::union)
        } else {
            nodes[first].bounds().union(nodes[first + 1].bounds())
        };
        nodes[at].set_bounds(bounds);
    }
}

/// Number of levels.
pub(super) fn depth(nodes: &[Node2]) -> usize {
    let mut levels = vec![1usize; nodes.len()];
    for at in 0..nodes.len() {
        if !nodes[at].is_leaf() {
            let first = nodes[at].first as usize;
            levels[first] = levels[at] + 1;
            levels[first + 1] = levels[at] + 1;
        }
    }
    levels.into_iter().max().unwrap_or(0)
}
