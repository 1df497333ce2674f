//! A group of segments between two boxes, tested against eight boxes at once: what it misses, no ray of it can hit.
use super::rays::MARGIN;
use super::separate;
use super::simd::{Lanes, Mask, three};
use crate::scene::bvh::{Node8, TriangleBlock};

/// A box: origins or ends of a group of rays.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Interval {
    pub(crate) lo: [f32; 3],
    pub(crate) hi: [f32; 3],
}

impl Interval {
    /// Nothing.
    pub(crate) const EMPTY: Self = Self { lo: [f32::INFINITY; 3], hi: [f32::NEG_INFINITY; 3] };

    /// A single value.
    #[inline(always)]
    pub(crate) fn point(v: [f32; 3]) -> Self {
        Self { lo: v, hi: v }
    }

    /// Smallest box with both in it.
    #[inline(always)]
    pub(crate) fn union(&self, other: &Self) -> Self {
        Self { lo: three!(i => self.lo[i].min(other.lo[i])), hi: three!(i => self.hi[i].max(other.hi[i])) }
    }

    /// The same seen from `center`. Rounding is monotonic: the differences bound those of the points inside.
    #[inline(always)]
    pub(crate) fn relative_to(&self, center: [f32; 3]) -> Self {
        Self { lo: three!(i => self.lo[i] - center[i]), hi: three!(i => self.hi[i] - center[i]) }
    }

    /// Largest absolute value of each component.
    #[inline(always)]
    pub(crate) fn reach(&self) -> [f32; 3] {
        three!(i => self.lo[i].abs().max(self.hi[i].abs()))
    }

    /// The box seen through a linear map; `reach` is the size of what is rounded on the way.
    #[inline(always)]
    pub(crate) fn turn(&self, rows: &[[f32; 3]; 3], reach: [f32; 3]) -> Self {
        let middle = three!(i => 0.5 * self.lo[i] + 0.5 * self.hi[i]);
        let half = three!(i => (self.hi[i] - middle[i]).max(middle[i] - self.lo[i]) + 2.0 * MARGIN * reach[i]);
        let m = three!(r => rows[r][0] * middle[0] + rows[r][1] * middle[1] + rows[r][2] * middle[2]);
        let h = three!(r => rows[r][0].abs() * half[0] + rows[r][1].abs() * half[1] + rows[r][2].abs() * half[2]);
        Self { lo: three!(i => m[i] - h[i]), hi: three!(i => m[i] + h[i]) }
    }
}

/// A component of a way below this share of the margin is raised to it, so that no reciprocal is infinite.
const FLAT: f32 = 1.0 / 1024.0;

/// The convex hull of an origin box O and an end box T, by its cross-sections: all segments are at parameter `s` inside
/// the box (1 − s) O + s T. A box B meets the hull when it meets one cross-section, and each of the six conditions for
/// that is linear in `s`: exact, and no dearer than the slabs of a ray.
pub(crate) struct Shaft {
    /// From a row of a node to the `s` before which the row's plane keeps the box outside: scale and offset.
    enter: [[f32; 2]; 6],
    /// And to the `s` after which it does.
    leave: [[f32; 2]; 6],
    /// Largest `s` of a ray.
    end: f32,
    /// O and T.
    origin: Interval,
    target: Interval,
    margin: [f32; 3],
    /// Beyond `s` = 1 the cross-sections are none: then nothing is known.
    valid: bool,
}

impl Shaft {
    /// Nothing known: all is entered.
    pub(crate) const NONE: Self = Self {
        enter: [[0.0; 2]; 6],
        leave: [[0.0; 2]; 6],
        end: 0.0,
        origin: Interval::EMPTY,
        target: Interval::EMPTY,
        margin: [0.0; 3],
        valid: false,
    };

    /// Segments from `origin` to `target`, up to `t_max` ≥ 0 of the way, among boxes that reach `reach` from the middle
    /// of their space. The margin is that of the boxes.
    #[inline(always)]
    pub(crate) fn new(origin: &Interval, target: &Interval, t_max: f32, reach: f32) -> Self {
        let (from, to) = (origin.reach(), target.reach());
        let size = from[0].max(from[1]).max(from[2]) + to[0].max(to[1]).max(to[2]) + reach;
        Self::with_margin(origin, target, t_max, [size * (2.0 * MARGIN); 3])
    }

    /// The same with a margin of one's own along each axis.
    #[inline(always)]
    pub(crate) fn with_margin(origin: &Interval, target: &Interval, t_max: f32, margin: [f32; 3]) -> Self {
        let mut shaft = Self {
            end: t_max * (1.0 + MARGIN),
            origin: *origin,
            target: *target,
            margin,
            valid: t_max <= 1.0,
            ..Self::NONE
        };
        let way_lo = three!(i => target.lo[i] - origin.lo[i]);
        let way_hi = three!(i => target.hi[i] - origin.hi[i]);
        for axis in [0, 1, 2] {
            let flat = (margin[axis] * FLAT).max(f32::MIN_POSITIVE);
            // The hull's upper side must reach the box's lower plane, and its lower side the upper plane.
            shaft.bound(axis, way_hi[axis], flat, origin.hi[axis] + margin[axis], true);
            shaft.bound(axis + 3, way_lo[axis], flat, origin.lo[axis] - margin[axis], false);
        }
        shaft
    }

    /// The condition of one row: `start + s way` is above the plane, or below it.
    #[inline(always)]
    fn bound(&mut self, row: usize, way: f32, flat: f32, start: f32, above: bool) {
        let inverse = 1.0 / if way.abs() < flat { flat } else { way };
        let line = [inverse, -start * inverse];
        let entering = above == (inverse > 0.0);
        self.enter[row] = if entering { line } else { [0.0, f32::MIN] };
        self.leave[row] = if entering { [0.0, f32::MAX] } else { line };
    }

    /// Children of a node that the group may hit.
    #[inline(always)]
    pub(crate) fn test<N: Lanes>(&self, node: &Node8) -> u32 {
        let used = (1 << node.count) - 1;
        if !self.valid {
            return used;
        }
        let (lo, hi) = (three!(i => N::load(&node.bounds[i])), three!(i => N::load(&node.bounds[i + 3])));
        self.meets(lo, hi).bits() & used
    }

    /// Boxes that the group may hit; only where the shaft is valid.
    #[inline(always)]
    pub(crate) fn meets<N: Lanes>(&self, lo: [N; 3], hi: [N; 3]) -> N::M {
        let (mut enter, mut leave) = (N::splat(0.0), N::splat(self.end));
        for axis in [0, 1, 2] {
            for (row, plane) in [(axis, lo[axis]), (axis + 3, hi[axis])] {
                // A NaN (an unused slot, an overflow) leaves the other value.
                enter = plane.fma(N::splat(self.enter[row][0]), N::splat(self.enter[row][1])).max(enter);
                leave = plane.fma(N::splat(self.leave[row][0]), N::splat(self.leave[row][1])).min(leave);
            }
        }
        enter.not_gt(leave)
    }

    /// True when a segment of the group may meet a triangle of the block: false when each has both boxes on one side of
    /// its plane, such as the walls of a room around all that it holds.
    #[inline(always)]
    pub(crate) fn may_meet<B: Lanes>(&self, block: &TriangleBlock) -> bool {
        if !self.valid {
            return true;
        }
        let corners = three!(v => three!(i => B::load(&block.corner[v][i])));
        separate::clear(&corners, &self.origin, &self.target, self.margin) != 15
    }
}
