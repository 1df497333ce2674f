//! Planes between a triangle and the segments from points to a light, in the light's coordinates.
use super::pixels::{Pixels, TILE_PIXELS};
use super::prove::T_MAX;
use super::shaft::Interval;
use super::simd::{Lanes, Mask, splat3, three};

/// A plane's normal is known to this share of the slack of its corners, which is generous: 1 unit in the last place.
const NORMAL_SHARE: f32 = 1.0 / 16.0;

#[inline(always)]
fn cross<L: Lanes>(e: [L; 3], f: [L; 3]) -> [L; 3] {
    [e[2].fnma(f[1], e[1] * f[2]), e[0].fnma(f[2], e[2] * f[0]), e[1].fnma(f[0], e[0] * f[1])]
}

#[inline(always)]
fn dot<L: Lanes>(a: [L; 3], b: [L; 3]) -> L {
    a[0].fma(b[0], a[1].fma(b[1], a[2] * b[2]))
}

#[inline(always)]
fn minus<L: Lanes>(a: [L; 3], b: [L; 3]) -> [L; 3] {
    three!(i => a[i] - b[i])
}

#[inline(always)]
fn size<L: Lanes>(a: [L; 3]) -> [L; 3] {
    three!(i => a[i].abs())
}

/// The plane of a triangle: heights over it, with bounds of their error.
#[derive(Clone, Copy)]
struct Plane<L> {
    corner: [L; 3],
    normal: [L; 3],
    /// Height that the slack of one point makes.
    slack: L,
    /// Doubt about the normal.
    doubt: [L; 3],
}

impl<L: Lanes> Plane<L> {
    #[inline(always)]
    fn new(corners: &[[L; 3]; 3], slack: [f32; 3]) -> Self {
        let (e, f) = (minus(corners[1], corners[0]), minus(corners[2], corners[0]));
        let (normal, s, share) = (cross(e, f), splat3::<L>(slack), L::splat(NORMAL_SHARE));
        let spread = three!(i => (e[i].abs() + f[i].abs()) * share);
        let doubt = [
            s[1].fma(spread[2], s[2] * spread[1]),
            s[2].fma(spread[0], s[0] * spread[2]),
            s[0].fma(spread[1], s[1] * spread[0]),
        ];
        Self { corner: corners[0], normal, slack: dot(size(normal), s), doubt }
    }

    /// Height of a point, and the doubt about it beyond the slack.
    #[inline(always)]
    fn height(&self, p: [L; 3]) -> (L, L) {
        let d = minus(p, self.corner);
        (dot(self.normal, d), dot(self.doubt, size(d)))
    }

    /// Least and largest height of a box, without and with the doubt taken off.
    #[inline(always)]
    fn heights(&self, b: &Interval) -> [L; 3] {
        let middle = three!(i => L::splat(0.5 * b.lo[i] + 0.5 * b.hi[i]));
        let half = three!(i => L::splat(0.5 * b.hi[i] - 0.5 * b.lo[i]));
        let ((at, doubt), spread) = (self.height(middle), dot(size(self.normal), half));
        [at - spread, at + spread, doubt + dot(self.doubt, half)]
    }
}

/// Triangles that have the whole tile and the whole light on one side of their plane, or on it: a rounding below counts
/// as on it, so that a floor does not shade itself.
#[inline(always)]
pub(super) fn apart<L: Lanes>(corners: &[[L; 3]; 3], origin: &Interval, light: &Interval, slack: [f32; 3]) -> u32 {
    let plane = Plane::new(corners, slack);
    let ([lo, hi, doubt], [light_lo, light_hi, light_doubt]) = (plane.heights(origin), plane.heights(light));
    let (zero, slack) = (L::splat(0.0), plane.slack);
    let above = zero.le(lo + slack - doubt).and(zero.le(light_lo + slack - light_doubt));
    let below = (hi - slack + doubt).le(zero).and((light_hi - slack + light_doubt).le(zero));
    above.or(below).bits()
}

/// Triangles that have both boxes on one side of their plane and off it, by more than any rounding.
#[inline(always)]
pub(super) fn clear<L: Lanes>(corners: &[[L; 3]; 3], origin: &Interval, target: &Interval, margin: [f32; 3]) -> u32 {
    let plane = Plane::new(corners, margin);
    let ([lo, hi, doubt], [to_lo, to_hi, to_doubt]) = (plane.heights(origin), plane.heights(target));
    let (doubt, zero) = (plane.slack + doubt.max(to_doubt), L::splat(0.0));
    let above = doubt.lt(lo).and(doubt.lt(to_lo));
    let below = (hi + doubt).lt(zero).and((to_hi + doubt).lt(zero));
    above.or(below).bits()
}

/// One triangle.
pub(super) struct Triangle {
    corners: [[f32; 3]; 3],
    lo: [f32; 3],
    hi: [f32; 3],
    slack: [f32; 3],
}

impl Triangle {
    #[inline(always)]
    pub(super) fn new(corners: [[f32; 3]; 3], slack: [f32; 3]) -> Self {
        let [a, b, c] = corners;
        let (lo, hi) = (three!(i => a[i].min(b[i]).min(c[i])), three!(i => a[i].max(b[i]).max(c[i])));
        Self { corners, lo, hi, slack }
    }
}

/// True when the triangle may lie between the light and one of the pixels.
#[inline(always)]
pub(super) fn harms<N: Lanes>(triangle: &Triangle, pixels: &Pixels, light: &Interval) -> bool {
    let corners: [[N; 3]; 3] = three!(v => splat3(triangle.corners[v]));
    let plane = Plane::<N>::new(&corners, triangle.slack);
    let [light_lo, light_hi, doubt] = plane.heights(light);
    let zero = N::splat(0.0);
    let lit_above = zero.le(light_lo + plane.slack - doubt);
    let lit_below = (light_hi - plane.slack + doubt).le(zero);
    for first in (0..TILE_PIXELS).step_by(N::N) {
        let active = (pixels.active >> first) as u32 & ((1 << N::N) - 1);
        if active == 0 {
            continue;
        }
        let origin = three!(i => N::load(&pixels.origin[i][first..]));
        let normal = three!(i => N::load(&pixels.normal[i][first..]));
        let (height, doubt) = plane.height(origin);
        let above = lit_above.and(zero.le(height + plane.slack - doubt));
        let below = lit_below.and((height - plane.slack + doubt).le(zero));
        let under = under_horizon(&corners, origin, normal, triangle.slack);
        let beside = beside(&corners, triangle, origin, light);
        let harmless = above.or(below).or(under).or(beside).bits();
        if active & !harmless != 0 {
            return true;
        }
    }
    false
}

/// Triangles below the common tangent plane of all pixels, or on it.
#[inline(always)]
pub(super) fn under_plane<B: Lanes>(corners: &[[B; 3]; 3], normal: [f32; 3], least: f32, slack: [f32; 3]) -> u32 {
    let n = splat3::<B>(normal);
    let top = dot(n, corners[0]).max(dot(n, corners[1])).max(dot(n, corners[2]));
    (top - B::splat(least)).le(dot(size(n), splat3(slack))).bits()
}

/// Pixels that have the triangle below their tangent plane, or on it.
#[inline(always)]
fn under_horizon<N: Lanes>(corners: &[[N; 3]; 3], origin: [N; 3], normal: [N; 3], slack: [f32; 3]) -> N::M {
    let over = three!(v => dot(normal, minus(corners[v], origin)));
    over[0].max(over[1]).max(over[2]).le(dot(size(normal), splat3(slack)))
}

/// Pixels whose pyramid to the light has the triangle outside of one of its sides, above its top or below its end.
#[inline(always)]
fn beside<N: Lanes>(corners: &[[N; 3]; 3], triangle: &Triangle, origin: [N; 3], light: &Interval) -> N::M {
    let (h, slack, zero) = (origin[2], splat3::<N>(triangle.slack), N::splat(0.0));
    let low = N::splat(triangle.hi[2]) + slack[2];
    let mut found = low.lt(N::splat(1.0 - T_MAX) * h).or((h + slack[2]).lt(N::splat(triangle.lo[2])));
    let reach_h = N::splat(triangle.lo[2].abs().max(triangle.hi[2].abs())) + h.abs();
    for axis in [0, 1] {
        let extent = N::splat(light.hi[axis]);
        let far = N::splat(triangle.lo[axis].abs().max(triangle.hi[axis].abs())) + origin[axis].abs() + extent;
        let doubt = slack[axis].fma(reach_h, slack[2] * far);
        // A point of a segment has a h0 - a0 h between 0 and extent (h0 - h).
        let left = three!(v => corners[v][axis] * h - origin[axis] * corners[v][2]);
        let right = three!(v => extent * (h - corners[v][2]) - left[v]);
        found = found.or(left[0].max(left[1]).max(left[2]).lt(zero - doubt));
        found = found.or(right[0].max(right[1]).max(right[2]).lt(zero - doubt));
    }
    // A pixel on the light's plane has no pyramid.
    found.and(slack[2].lt(h))
}

fn corner(b: &Interval, which: usize) -> [f64; 3] {
    three!(i => f64::from(if which >> i & 1 == 1 { b.hi[i] } else { b.lo[i] }))
}

fn cross64(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot64(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn minus64(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    three!(i => a[i] - b[i])
}

/// Largest determinant of vectors of these sizes.
fn permanent(a: [f64; 3], b: [f64; 3], c: [f64; 3]) -> f64 {
    let pair = |i: usize, j: usize| b[i] * c[j] + b[j] * c[i];
    a[0] * pair(1, 2) + a[1] * pair(2, 0) + a[2] * pair(0, 1)
}

/// True when every segment from the box to the light crosses the triangle. A segment crosses when its ends lie on both
/// sides of the plane and it passes its three edges on one side; both are linear in each end, so the corners decide.
pub(super) fn hides(triangle: &Triangle, origin: &Interval, light: &Interval) -> bool {
    let corners = three!(v => triangle.corners[v].map(f64::from));
    let slack = triangle.slack.map(f64::from);
    let reach = three!(i => {
        let lo = f64::from(triangle.lo[i].min(origin.lo[i]).min(light.lo[i]));
        f64::from(triangle.hi[i].max(origin.hi[i]).max(light.hi[i])) - lo
    });
    let (e, f) = (minus64(corners[1], corners[0]), minus64(corners[2], corners[0]));
    let (normal, doubt) = (cross64(e, f), 4.0 * permanent(reach, three!(i => e[i].abs().max(f[i].abs())), slack));
    let height = |p: [f64; 3]| dot64(normal, minus64(p, corners[0]));
    let range = |b: &Interval| {
        (0..8).map(|k| height(corner(b, k))).fold((f64::MAX, f64::MIN), |(lo, hi), h| (lo.min(h), hi.max(h)))
    };
    let ((lo, hi), (light_lo, light_hi)) = (range(origin), range(light));
    let (near, far, way) = if lo > 0.0 { (lo, -light_hi, hi - light_lo) } else { (-hi, light_lo, light_hi - lo) };
    // Beyond the end of the rays nothing hides.
    if !(near > doubt && far > doubt + 3.0 * f64::from(1.0 - T_MAX) * way) {
        return false;
    }
    let (edge_doubt, ahead) = (4.0 * permanent(reach, reach, slack), lo > 0.0);
    (0..8).all(|k| {
        let o = corner(origin, k);
        let [a, b, c] = corners.map(|v| minus64(v, o));
        [cross64(a, b), cross64(b, c), cross64(c, a)].into_iter().all(|side| {
            (0..4).all(|j| {
                let past = dot64(side, minus64(corner(light, j), o));
                (if ahead { -past } else { past }) > edge_doubt
            })
        })
    })
}
