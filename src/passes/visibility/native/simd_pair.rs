//! Two vectors side by side: wider packets share the work that is done once for each.
use super::simd::{Lanes, Mask};
use std::ops::{Add, Div, Mul, Sub};

/// The lanes of `0`, then those of `1`.
#[derive(Clone, Copy)]
pub(crate) struct Pair<L>(L, L);

/// Lane set of a [`Pair`] of vectors of `N` lanes.
#[derive(Clone, Copy)]
pub(crate) struct PairMask<M, const N: usize>(M, M);

impl<M: Mask, const N: usize> Mask for PairMask<M, N> {
    #[inline(always)]
    fn from_bits(bits: u32) -> Self {
        Self(M::from_bits(bits), M::from_bits(bits >> N))
    }
    #[inline(always)]
    fn bits(self) -> u32 {
        self.0.bits() | self.1.bits() << N
    }
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        Self(self.0.and(other.0), self.1.and(other.1))
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        Self(self.0.or(other.0), self.1.or(other.1))
    }
}

macro_rules! operator {
    ($trait:ident, $name:ident) => {
        impl<L: Lanes> $trait for Pair<L> {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                Self(self.0.$name(other.0), self.1.$name(other.1))
            }
        }
    };
}
operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);

/// Methods that work on each half.
macro_rules! halves {
    ($($name:ident($($argument:ident),*) -> $result:ident;)*) => {
        $(#[inline(always)]
        fn $name(self $(, $argument: Self)*) -> halves!(@ $result) {
            halves!(@make $result)(self.0.$name($($argument.0),*), self.1.$name($($argument.1),*))
        })*
    };
    (@ Lanes) => { Self };
    (@ Mask) => { Self::M };
    (@make Lanes) => { Pair };
    (@make Mask) => { PairMask };
}

macro_rules! pair {
    ($half:ty, $n:literal, $double:literal) => {
        impl Lanes for Pair<$half> {
            const N: usize = $double;
            type M = PairMask<<$half as Lanes>::M, $n>;
            #[inline(always)]
            fn splat(value: f32) -> Self {
                Self(<$half>::splat(value), <$half>::splat(value))
            }
            #[inline(always)]
            fn load(values: &[f32]) -> Self {
                Self(<$half>::load(values), <$half>::load(&values[$n..]))
            }
            #[inline(always)]
            fn load_strided(values: &[f32], stride: usize) -> Self {
                Self(<$half>::load_strided(values, stride), <$half>::load_strided(&values[$n * stride..], stride))
            }
            #[inline(always)]
            fn store(self, values: &mut [f32]) {
                self.0.store(values);
                self.1.store(&mut values[$n..]);
            }
            halves! {
                fma(b, c) -> Lanes;
                fnma(b, c) -> Lanes;
                fms(b, c) -> Lanes;
                min(other) -> Lanes;
                max(other) -> Lanes;
                abs() -> Lanes;
                sqrt() -> Lanes;
                lt(other) -> Mask;
                le(other) -> Mask;
                eq(other) -> Mask;
                not_gt(other) -> Mask;
            }
            #[inline(always)]
            fn select(mask: Self::M, yes: Self, no: Self) -> Self {
                Self(<$half>::select(mask.0, yes.0, no.0), <$half>::select(mask.1, yes.1, no.1))
            }
        }
    };
}
#[cfg(target_arch = "x86_64")]
pair!(super::simd_x86::F32x16, 16, 32);
#[cfg(target_arch = "x86_64")]
pair!(super::simd_x86::F32x8, 8, 16);
