//! A packet of rays: in scene space, and as an instance sees it.
use super::super::trace_native::Ray;
use super::instance::Placed;
use super::simd::{Lanes, Mask, splat3, three};

/// Most rays of a packet.
pub(crate) const LANES: usize = 32;

/// One value per ray; vectors load its first lanes.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct Row(pub(crate) [f32; LANES]);

impl Row {
    #[inline(always)]
    fn of<P: Lanes>(value: P) -> Self {
        let mut row = Self([0.0; LANES]);
        value.store(&mut row.0);
        row
    }
    /// As a vector.
    #[inline(always)]
    pub(crate) fn get<P: Lanes>(&self) -> P {
        P::load(&self.0)
    }
}

/// Three rows as vectors.
#[inline(always)]
pub(crate) fn rows<P: Lanes>(rows: &[Row; 3]) -> [P; 3] {
    three!(i => rows[i].get())
}

/// Components in cyclic order from the one after the largest, so that (x, y, z) stays right-handed and z is largest.
#[inline(always)]
pub(crate) fn cycle<P: Lanes>(v: [P; 3], is_z: P::M, is_y: P::M) -> [P; 3] {
    [
        P::select(is_z, v[0], P::select(is_y, v[2], v[1])),
        P::select(is_z, v[1], P::select(is_y, v[0], v[2])),
        P::select(is_z, v[2], P::select(is_y, v[1], v[0])),
    ]
}

/// Rays in scene space, structure of arrays.
#[derive(Clone)]
pub(crate) struct Bundle {
    pub(crate) origin: [Row; 3],
    pub(crate) direction: [Row; 3],
    pub(crate) t_min: Row,
    pub(crate) t_max: Row,
    /// Lanes that hold a valid ray.
    pub(crate) active: u32,
}

impl Bundle {
    /// Harmless rays, none of them active.
    pub(crate) const IDLE: Self = Self {
        origin: [Row([0.0; LANES]); 3],
        direction: [Row([0.0; LANES]), Row([0.0; LANES]), Row([1.0; LANES])],
        t_min: Row([0.0; LANES]),
        t_max: Row([0.0; LANES]),
        active: 0,
    };

    /// Up to one packet of rays; the rest of the lanes idle.
    #[inline(always)]
    pub(crate) fn fill<P: Lanes>(&mut self, rays: &[Ray]) {
        self.active = ((1_u64 << rays.len()) - 1) as u32;
        if rays.len() == P::N {
            // Scalar stores would stall the vector loads that follow.
            let values: &[f32] = bytemuck::cast_slice(rays);
            for axis in 0..3 {
                P::load_strided(&values[axis..], 8).store(&mut self.origin[axis].0);
                P::load_strided(&values[axis + 4..], 8).store(&mut self.direction[axis].0);
            }
            P::load_strided(&values[3..], 8).store(&mut self.t_min.0);
            P::load_strided(&values[7..], 8).store(&mut self.t_max.0);
            return;
        }
        for (lane, ray) in rays.iter().enumerate().take(LANES) {
            for axis in 0..3 {
                self.origin[axis].0[lane] = ray.origin[axis];
                self.direction[axis].0[lane] = ray.direction[axis];
            }
            self.t_min.0[lane] = ray.t_min;
            self.t_max.0[lane] = ray.t_max;
        }
    }

    /// Drops the rays that can hit nothing by the rules of the trace; what their lanes hold is never looked at.
    #[inline(always)]
    pub(crate) fn check<P: Lanes>(&mut self) {
        let (zero, huge) = (P::splat(0.0), P::splat(f32::MAX));
        let mut valid = P::M::from_bits(self.active).and(self.t_min.get::<P>().lt(self.t_max.get()));
        let mut length = zero;
        for row in self.origin.iter().chain(&self.direction) {
            valid = valid.and(row.get::<P>().abs().le(huge));
        }
        for row in &self.direction {
            length = length.max(row.get::<P>().abs());
        }
        self.active = valid.and(zero.lt(length)).bits();
    }
}

/// Component of a direction below this share of the largest one is raised to it for the box tests, so that no
/// reciprocal is infinite. The shift, 2^-32 of the way, is far inside [`MARGIN`].
const FLAT: f32 = 1.0 / 4_294_967_296.0;

/// Boxes are entered with a margin of this share of |origin| + |box|, in space: 16 units in the last place.
/// It covers the slab arithmetic [Ize13] and that of the triangle test, so that no hit of `triangle::cross` is
/// culled, whatever the tree; that is why answers do not depend on the traversal.
pub(crate) const MARGIN: f32 = 1.0 / 1_048_576.0;

/// Directions of a packet, prepared.
#[derive(Clone)]
pub(crate) struct Heading {
    pub(crate) inverse: [Row; 3],
    /// Shear of the triangle test, x and y over z, and 1 / z.
    pub(crate) shear: [Row; 3],
    /// Lanes with a negative component.
    pub(crate) negative: [u32; 3],
    /// Lanes whose largest component is x, y or z.
    pub(crate) major: [u32; 3],
}

impl Heading {
    /// Prepares directions.
    #[inline(always)]
    pub(crate) fn new<P: Lanes>(direction: &[Row; 3]) -> Self {
        let d: [P; 3] = rows(direction);
        let abs = three!(i => d[i].abs());
        let floor = abs[0].max(abs[1]).max(abs[2]) * P::splat(FLAT);
        let one = P::splat(1.0);
        let inverse = three!(i => one / P::select(abs[i].lt(floor), floor, d[i]));
        let z_major = abs[0].le(abs[2]).and(abs[1].le(abs[2]));
        let y_over_x = abs[0].le(abs[1]);
        let [x, y, z] = cycle(d, z_major, y_over_x);
        let scale = one / z;
        let shear = [x * scale, y * scale, scale];
        let (z_bits, y_bits) = (z_major.bits(), y_over_x.bits());
        let zero = P::splat(0.0);
        Self {
            inverse: three!(i => Row::of(inverse[i])),
            shear: three!(i => Row::of(shear[i])),
            negative: three!(i => inverse[i].lt(zero).bits()),
            major: [!z_bits & !y_bits, !z_bits & y_bits, z_bits],
        }
    }

    /// True when all `active` rays have the same signs and the same largest component.
    #[inline(always)]
    pub(crate) fn is_coherent(&self, active: u32) -> bool {
        let mut mixed = false;
        for bits in three!(i => [self.negative[i], self.major[i]]).as_flattened() {
            mixed |= bits & active != 0 && bits & active != active;
        }
        !mixed
    }
}

/// A packet in the space of a tree: what boxes and triangles are tested against.
#[derive(Clone)]
pub(crate) struct Local<'a> {
    pub(crate) heading: &'a Heading,
    pub(crate) origin: [Row; 3],
    /// A near plane at `p` is reached at `p * inverse + near`, not later; a far one at `p * inverse + far`, not sooner.
    pub(crate) near: [Row; 3],
    pub(crate) far: [Row; 3],
}

impl<'a> Local<'a> {
    /// Prepares origins for boxes that reach `reach` from the origin of their space.
    #[inline(always)]
    pub(crate) fn new<P: Lanes>(origin: [P; 3], heading: &'a Heading, reach: f32) -> Self {
        let far_out = origin[0].abs().max(origin[1].abs()).max(origin[2].abs()) + P::splat(reach);
        let margin = far_out * P::splat(MARGIN);
        let zero = P::splat(0.0);
        let inverse: [P; 3] = rows(&heading.inverse);
        let at = three!(i => zero - origin[i] * inverse[i]);
        let slack = three!(i => margin * inverse[i].abs());
        Self {
            heading,
            origin: three!(i => Row::of(origin[i])),
            near: three!(i => Row::of(at[i] - slack[i])),
            far: three!(i => Row::of(at[i] + slack[i])),
        }
    }
}

/// Origins relative to an instance, in its object space.
#[inline(always)]
pub(crate) fn enter_origin<P: Lanes>(bundle: &Bundle, placed: &Placed) -> [P; 3] {
    let offset = three!(i => bundle.origin[i].get::<P>() - P::splat(placed.center[i]));
    if placed.identity { offset } else { rotate(offset, &placed.rows) }
}

/// Directions in the object space of an instance whose linear part is not the identity.
#[inline(always)]
pub(crate) fn enter_direction<P: Lanes>(bundle: &Bundle, placed: &Placed) -> [Row; 3] {
    let turned = rotate(rows::<P>(&bundle.direction), &placed.rows);
    three!(i => Row::of(turned[i]))
}

#[inline(always)]
fn rotate<P: Lanes>(v: [P; 3], rows: &[[f32; 3]; 3]) -> [P; 3] {
    let [x, y, z] = three!(i => splat3::<P>(rows[i]));
    let row = [x, y, z];
    three!(i => v[0].fma(row[i][0], v[1].fma(row[i][1], v[2] * row[i][2])))
}
