//! The top level: boxes of instances.
use super::{Bounds, Child, Node8, build, wide};

/// Eight-wide tree over the boxes of instances.
#[derive(Clone, Debug, Default)]
pub struct Tlas {
    nodes: Vec<Node8>,
    binary: Vec<super::Node2>,
    order: Vec<u32>,
    depth: usize,
}

impl Tlas {
    /// Builds over one scene-space box per instance. Empty boxes are left out.
    pub fn build(boxes: &[Bounds]) -> Self {
        let kept: Vec<u32> = (0..boxes.len() as u32).filter(|&i| !boxes[i as usize].is_empty()).collect();
        let used: Vec<Bounds> = kept.iter().map(|&i| boxes[i as usize]).collect();
        let (binary, mut order) = build::build_binary(&used, 1);
        for slot in &mut order {
            *slot = kept[*slot as usize];
        }
        let mut tree = wide::collapse(&binary);
        for node in &mut tree.nodes {
            for child in &mut node.children[..node.count as usize] {
                if child.is_leaf() {
                    let slot = tree.leaves[child.index()].0;
                    *child = Child::leaf(order[slot as usize] as usize, 1);
                }
            }
        }
        Self { nodes: tree.nodes, binary, order, depth: tree.depth }
    }

    /// Eight-wide nodes, node 0 the root; a leaf names an instance. Empty without instances.
    pub fn nodes(&self) -> &[Node8] {
        &self.nodes
    }

    /// Binary nodes for a GPU traversal; a leaf names a slot of [`Tlas::order`].
    pub fn nodes_bvh2(&self) -> &[super::Node2] {
        &self.binary
    }

    /// Instance of each slot.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// Levels of the eight-wide tree.
    pub fn depth(&self) -> usize {
        self.depth
    }

    /// Box of all instances.
    pub fn bounds(&self) -> Bounds {
        self.binary.first().map_or(Bounds::EMPTY, super::Node2::bounds)
    }
}
