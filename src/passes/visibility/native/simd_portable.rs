//! The SIMD interface over plain arrays: any CPU, and the yardstick for the others in the tests.
use super::simd::{Isa, Lanes, Mask};
use std::ops::{Add, Div, Mul, Sub};

/// `N` floats, 16-byte aligned so that the compiler can use what vectors there are.
#[derive(Clone, Copy)]
#[repr(align(16))]
pub(crate) struct Array<const N: usize>([f32; N]);

/// Lane set of [`Array`].
#[derive(Clone, Copy)]
pub(crate) struct Bits(u32);

impl Mask for Bits {
    #[inline(always)]
    fn from_bits(bits: u32) -> Self {
        Self(bits)
    }
    #[inline(always)]
    fn bits(self) -> u32 {
        self.0
    }
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl<const N: usize> Array<N> {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self(std::array::from_fn(|i| f(self.0[i], other.0[i])))
    }
    #[inline(always)]
    fn zip3(self, b: Self, c: Self, f: impl Fn(f32, f32, f32) -> f32) -> Self {
        Self(std::array::from_fn(|i| f(self.0[i], b.0[i], c.0[i])))
    }
    #[inline(always)]
    fn test(self, other: Self, f: impl Fn(f32, f32) -> bool) -> Bits {
        let mut bits = 0;
        for i in 0..N {
            bits |= u32::from(f(self.0[i], other.0[i])) << i;
        }
        Bits(bits)
    }
}

macro_rules! operator {
    ($trait:ident, $name:ident, $op:tt) => {
        impl<const N: usize> $trait for Array<N> {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                self.zip(other, |a, b| a $op b)
            }
        }
    };
}
operator!(Add, add, +);
operator!(Sub, sub, -);
operator!(Mul, mul, *);
operator!(Div, div, /);

impl<const N: usize> Lanes for Array<N> {
    const N: usize = N;
    type M = Bits;
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([value; N])
    }
    #[inline(always)]
    fn load(values: &[f32]) -> Self {
        Self(std::array::from_fn(|i| values[i]))
    }
    #[inline(always)]
    fn load_strided(values: &[f32], stride: usize) -> Self {
        Self(std::array::from_fn(|i| values[i * stride]))
    }
    #[inline(always)]
    fn store(self, values: &mut [f32]) {
        values[..N].copy_from_slice(&self.0);
    }
    #[inline(always)]
    fn fma(self, b: Self, c: Self) -> Self {
        self.zip3(b, c, f32::mul_add)
    }
    #[inline(always)]
    fn fnma(self, b: Self, c: Self) -> Self {
        self.zip3(b, c, |a, b, c| (-a).mul_add(b, c))
    }
    #[inline(always)]
    fn fms(self, b: Self, c: Self) -> Self {
        self.zip3(b, c, |a, b, c| a.mul_add(b, -c))
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.map(f32::abs))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(f32::sqrt))
    }
    #[inline(always)]
    fn lt(self, other: Self) -> Bits {
        self.test(other, |a, b| a < b)
    }
    #[inline(always)]
    fn le(self, other: Self) -> Bits {
        self.test(other, |a, b| a <= b)
    }
    #[inline(always)]
    fn eq(self, other: Self) -> Bits {
        self.test(other, |a, b| a == b)
    }
    #[inline(always)]
    fn not_gt(self, other: Self) -> Bits {
        self.test(other, |a, b| a <= b || a.is_nan() || b.is_nan())
    }
    #[inline(always)]
    fn select(mask: Bits, yes: Self, no: Self) -> Self {
        Self(std::array::from_fn(|i| if mask.0 >> i & 1 == 1 { yes.0[i] } else { no.0[i] }))
    }
    #[inline(always)]
    fn lane(self, lane: usize) -> f32 {
        self.0[lane % N]
    }
}

/// Plain arrays.
pub(crate) struct Portable;

impl Isa for Portable {
    type Packet = Array<8>;
    type Node = Array<8>;
    type Block = Array<4>;
}
