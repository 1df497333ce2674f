//! A group of rays around one axis, tested against eight boxes at once: what it misses, no ray of it can hit.
use super::rays::MARGIN;
use super::simd::{Lanes, Mask, three};
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

/// Directions of a group of rays that share the sign of one component, `z`: at depth z from its origin a ray is at
/// slope · z across.
#[derive(Clone, Copy)]
pub(crate) struct Cone {
    /// Axis of the depth; the others follow in cyclic order.
    axis: usize,
    back: bool,
    slope_lo: [f32; 2],
    slope_hi: [f32; 2],
    /// Where the rays end: in depth, and across.
    end: f32,
    end_lo: [f32; 2],
    end_hi: [f32; 2],
    /// Without a common sign nothing can be said.
    valid: bool,
}

impl Cone {
    /// Rays along `direction`, up to `t_max` ≥ 0 of it.
    #[inline(always)]
    pub(crate) fn new(direction: &Interval, t_max: f32) -> Self {
        let (lo, hi) = (direction.lo, direction.hi);
        // Smallest absolute value of each component, 0 where the sign changes.
        let least = three!(i => lo[i].max(-hi[i]).max(0.0));
        let y_over_x = least[1] > least[0];
        let xy = if y_over_x { least[1] } else { least[0] };
        let axis = if least[2] > xy { 2 } else { usize::from(y_over_x) };
        let (one, two) = ((axis + 1) % 3, (axis + 2) % 3);
        let most = lo[axis].abs().max(hi[axis].abs());
        let (by_least, by_most) = (1.0 / least[axis], 1.0 / most);
        let t_max = t_max.min(f32::MAX);
        let slope_lo = |i: usize| (lo[i] * by_least).min(lo[i] * by_most);
        let slope_hi = |i: usize| (hi[i] * by_least).max(hi[i] * by_most);
        Self {
            axis,
            back: lo[axis] < 0.0,
            slope_lo: [slope_lo(one), slope_lo(two)],
            slope_hi: [slope_hi(one), slope_hi(two)],
            end: most * t_max * (1.0 + MARGIN),
            end_lo: [(lo[one] * t_max).min(0.0), (lo[two] * t_max).min(0.0)],
            end_hi: [(hi[one] * t_max).max(0.0), (hi[two] * t_max).max(0.0)],
            valid: least[axis] > 0.0,
        }
    }
}

/// A cone with its origins: what it misses, no ray of the group hits. The margin is that of the boxes.
pub(crate) struct Shaft {
    cone: Cone,
    /// Rows of a node: near and far in depth.
    depth_rows: [usize; 2],
    across: [usize; 2],
    sign: f32,
    near: f32,
    far: f32,
    margin: f32,
    to_lo: [f32; 2],
    to_hi: [f32; 2],
}

impl Shaft {
    /// Nothing known: all is entered.
    pub(crate) const NONE: Self = Self {
        cone: Cone {
            axis: 0,
            back: false,
            slope_lo: [0.0; 2],
            slope_hi: [0.0; 2],
            end: 0.0,
            end_lo: [0.0; 2],
            end_hi: [0.0; 2],
            valid: false,
        },
        depth_rows: [0; 2],
        across: [0; 2],
        sign: 0.0,
        near: 0.0,
        far: 0.0,
        margin: 0.0,
        to_lo: [0.0; 2],
        to_hi: [0.0; 2],
    };

    /// Rays of `cone` from `origin`, among boxes that reach `reach` from the middle of their space.
    #[inline(always)]
    pub(crate) fn new(cone: Cone, origin: &Interval, reach: f32) -> Self {
        let k = cone.axis;
        let across = [(k + 1) % 3, (k + 2) % 3];
        let far_out = three!(i => origin.lo[i].abs().max(origin.hi[i].abs()));
        let margin = (far_out[0].max(far_out[1]).max(far_out[2]) + reach) * (2.0 * MARGIN);
        let (near, far) = if cone.back { (origin.lo[k], origin.hi[k]) } else { (-origin.hi[k], -origin.lo[k]) };
        Self {
            cone,
            depth_rows: if cone.back { [k + 3, k] } else { [k, k + 3] },
            across,
            sign: if cone.back { -1.0 } else { 1.0 },
            near: near - margin,
            far: far + margin,
            margin,
            to_lo: [-origin.hi[across[0]] - margin, -origin.hi[across[1]] - margin],
            to_hi: [-origin.lo[across[0]] + margin, -origin.lo[across[1]] + margin],
        }
    }

    /// Children of a node that the group may hit.
    #[inline(always)]
    pub(crate) fn test<N: Lanes>(&self, node: &Node8) -> u32 {
        let used = (1 << node.count) - 1;
        if !self.cone.valid {
            return used;
        }
        let (row, cone, splat) = (&node.bounds, &self.cone, N::splat);
        let margin = splat(self.margin);
        let sign = splat(self.sign);
        let near = N::load(&row[self.depth_rows[0]]).fma(sign, splat(self.near)).max(splat(0.0));
        let far = N::load(&row[self.depth_rows[1]]).fma(sign, splat(self.far)).min(splat(cone.end) + margin);
        let mut hit = near.not_gt(far);
        for side in [0, 1] {
            let (slope_lo, slope_hi) = (splat(cone.slope_lo[side]), splat(cone.slope_hi[side]));
            let lowest = (slope_lo * near).min(slope_lo * far).max(splat(cone.end_lo[side]) - margin);
            let highest = (slope_hi * near).max(slope_hi * far).min(splat(cone.end_hi[side]) + margin);
            let lo = N::load(&row[self.across[side]]) + splat(self.to_lo[side]);
            let hi = N::load(&row[self.across[side] + 3]) + splat(self.to_hi[side]);
            hit = hit.and(lowest.not_gt(hi)).and(lo.not_gt(highest));
        }
        hit.bits() & used
    }
}
