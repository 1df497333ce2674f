//! Watertight ray–triangle test [WBW13], for lanes that are rays or lanes that are triangles.
use super::simd::{Lanes, Mask};

/// The shear that takes a ray to the z axis: `axes` are the components (x, y, z of the sheared frame), z the largest.
#[derive(Clone, Copy)]
pub(crate) struct Shear<L> {
    pub(crate) x: L,
    pub(crate) y: L,
    pub(crate) z: L,
}

impl<L: Lanes> Shear<L> {
    #[inline(always)]
    fn apply(&self, p: [L; 3]) -> [L; 2] {
        [self.x.fnma(p[2], p[0]), self.y.fnma(p[2], p[1])]
    }
}

/// Where rays cross triangles.
#[derive(Clone, Copy)]
pub(crate) struct Crossing<L: Lanes> {
    /// Lanes that cross.
    pub(crate) mask: L::M,
    pub(crate) t: L,
    pub(crate) weight1: L,
    pub(crate) weight2: L,
}

/// `cx * by - cy * bx` with the right sign.
///
/// Kahan's difference of products: `q` carries its own rounding error along. The result is never on the wrong side of
/// zero (rounding is monotonic and the error of `q` is a float), so the two triangles at an edge never both exclude a
/// ray. Only an underflow of that error could break this; it is below [`EDGE`].
#[inline(always)]
fn edge<L: Lanes>(cx: L, by: L, cy: L, bx: L) -> L {
    let q = cy * bx;
    let error = cy.fnma(bx, q);
    cx.fms(by, q) + error
}

/// An edge value down to `-EDGE` counts as inside: larger than the loss of an underflow (2^-149) in [`edge`].
const EDGE: f32 = f32::MIN_POSITIVE;

/// Crosses triangles with corners `a`, `b`, `c`, relative to the origin of the ray, in the sheared order of axes.
/// `None` when no lane of `active` crosses; the range of `t` is for the caller to test.
#[inline(always)]
pub(crate) fn cross<L: Lanes>(a: [L; 3], b: [L; 3], c: [L; 3], shear: &Shear<L>, active: L::M) -> Option<Crossing<L>> {
    let ([ax, ay], [bx, by], [cx, cy]) = (shear.apply(a), shear.apply(b), shear.apply(c));
    let u = edge(cx, by, cy, bx);
    let v = edge(ax, cy, ay, cx);
    let w = edge(bx, ay, by, ax);
    let smallest = u.min(v).min(w);
    let largest = u.max(v).max(w);
    let inside = L::splat(-EDGE).le(smallest).or(largest.le(L::splat(EDGE))).and(active);
    if inside.bits() == 0 {
        return None;
    }
    let det = u + v + w;
    let flat = det.eq(L::splat(0.0));
    let mask = inside.and(L::M::from_bits(!flat.bits()));
    let scaled = u.fma(a[2], v.fma(b[2], w * c[2]));
    let (t, weight1, weight2) = (scaled / det * shear.z, v / det, w / det);
    Some(Crossing { mask, t, weight1, weight2 })
}
