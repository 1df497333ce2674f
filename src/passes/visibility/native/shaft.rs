//! A cone of rays around one axis, tested against eight boxes at once: what it misses, no ray of it can hit.
use super::rays::MARGIN;
use super::simd::{Isa, Lanes, Mask, three};
use crate::scene::bvh::Node8;

/// Directions and origins of a group of rays, as intervals.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Interval {
    pub(crate) lo: [f32; 3],
    pub(crate) hi: [f32; 3],
}

impl Interval {
    /// A single value.
    #[inline(always)]
    pub(crate) fn point(v: [f32; 3]) -> Self {
        Self { lo: v, hi: v }
    }

    /// The interval seen through a linear map, with a margin for its rounding.
    #[inline(always)]
    pub(crate) fn turn(&self, rows: &[[f32; 3]; 3]) -> Self {
        let middle = three!(i => 0.5 * self.lo[i] + 0.5 * self.hi[i]);
        let half = three!(i => (self.hi[i] - middle[i]).max(middle[i] - self.lo[i]));
        let m = three!(r => rows[r][0] * middle[0] + rows[r][1] * middle[1] + rows[r][2] * middle[2]);
        let reach = three!(i => half[i] + MARGIN * (middle[i].abs() + half[i]));
        let h = three!(r => rows[r][0].abs() * reach[0] + rows[r][1].abs() * reach[1] + rows[r][2].abs() * reach[2]);
        Self { lo: three!(i => m[i] - h[i]), hi: three!(i => m[i] + h[i]) }
    }
}

/// A group of rays whose directions share the sign of one component, `z`: at depth z from its origin a ray is at
/// slope · z across. The rest of the arithmetic is that of the boxes, with the same margin.
pub(crate) struct Shaft<I: Isa> {
    /// Rows of a node: near and far in depth, low and high across.
    depth_rows: [usize; 2],
    across: [usize; 2],
    sign: I::Node,
    near: I::Node,
    far: I::Node,
    end: I::Node,
    slope_lo: [I::Node; 2],
    slope_hi: [I::Node; 2],
    to_lo: [I::Node; 2],
    to_hi: [I::Node; 2],
    /// Box of the ends, across.
    end_lo: [I::Node; 2],
    end_hi: [I::Node; 2],
    /// Without a common sign nothing can be said.
    valid: bool,
}

impl<I: Isa> Shaft<I> {
    /// Rays from `origin` along `direction`, up to `t_max` ≥ 0 of it, among boxes that reach `reach` from the origin.
    #[inline(always)]
    pub(crate) fn new(origin: &Interval, direction: &Interval, t_max: f32, reach: f32) -> Self {
        let (lo, hi) = (direction.lo, direction.hi);
        // Smallest absolute value of each component, 0 where the sign changes.
        let least = three!(i => if lo[i] > 0.0 { lo[i] } else if hi[i] < 0.0 { -hi[i] } else { 0.0 });
        let k = if least[0] >= least[1] && least[0] >= least[2] {
            0
        } else if least[1] >= least[2] {
            1
        } else {
            2
        };
        let most = lo[k].abs().max(hi[k].abs());
        let across = [(k + 1) % 3, (k + 2) % 3];
        let back = lo[k] < 0.0;
        let (by_least, by_most) = (1.0 / least[k], 1.0 / most);
        let slope_lo = |i: usize| (lo[i] * by_least).min(lo[i] * by_most);
        let slope_hi = |i: usize| (hi[i] * by_least).max(hi[i] * by_most);
        let far_out = three!(i => origin.lo[i].abs().max(origin.hi[i].abs()));
        let margin = (far_out[0].max(far_out[1]).max(far_out[2]) + reach) * (2.0 * MARGIN);
        let t_max = t_max.min(f32::MAX);
        let end_lo = |i: usize| (lo[i] * t_max).min(0.0) - margin;
        let end_hi = |i: usize| (hi[i] * t_max).max(0.0) + margin;
        let (near, far) = if back { (origin.lo[k], origin.hi[k]) } else { (-origin.hi[k], -origin.lo[k]) };
        let splat = I::Node::splat;
        Self {
            depth_rows: if back { [k + 3, k] } else { [k, k + 3] },
            across,
            sign: splat(if back { -1.0 } else { 1.0 }),
            near: splat(near - margin),
            far: splat(far + margin),
            end: splat(most * t_max * (1.0 + MARGIN) + margin),
            slope_lo: [splat(slope_lo(across[0])), splat(slope_lo(across[1]))],
            slope_hi: [splat(slope_hi(across[0])), splat(slope_hi(across[1]))],
            to_lo: [splat(-origin.hi[across[0]] - margin), splat(-origin.hi[across[1]] - margin)],
            to_hi: [splat(-origin.lo[across[0]] + margin), splat(-origin.lo[across[1]] + margin)],
            end_lo: [splat(end_lo(across[0])), splat(end_lo(across[1]))],
            end_hi: [splat(end_hi(across[0])), splat(end_hi(across[1]))],
            valid: least[k] > 0.0,
        }
    }

    /// Children of a node that the group may hit.
    #[inline(always)]
    pub(crate) fn test(&self, node: &Node8) -> u32 {
        let used = (1 << node.count) - 1;
        if !self.valid {
            return used;
        }
        let row = &node.bounds;
        let near = I::Node::load(&row[self.depth_rows[0]]).fma(self.sign, self.near).max(I::Node::splat(0.0));
        let far = I::Node::load(&row[self.depth_rows[1]]).fma(self.sign, self.far).min(self.end);
        let mut hit = near.not_gt(far);
        for side in [0, 1] {
            let lowest = (self.slope_lo[side] * near).min(self.slope_lo[side] * far).max(self.end_lo[side]);
            let highest = (self.slope_hi[side] * near).max(self.slope_hi[side] * far).min(self.end_hi[side]);
            let lo = I::Node::load(&row[self.across[side]]) + self.to_lo[side];
            let hi = I::Node::load(&row[self.across[side] + 3]) + self.to_hi[side];
            hit = hit.and(lowest.not_gt(hi)).and(lo.not_gt(highest));
        }
        hit.bits() & used
    }
}
