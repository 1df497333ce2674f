//! One small SIMD interface, so that every traversal is written once.
//!
//! Implementations: AVX-512 (16 lanes), AVX2 + FMA (8 lanes, and 4 for triangle blocks) and plain arrays.
//! All of them round alike (`mul_add` is one rounding everywhere), so a ray gets the same bits on each.
//! The vector types are private to the native tracer: only `dispatch` enters code that uses them, after it
//! has asked the CPU.
use std::ops::{Add, Div, Mul, Sub};

/// A set of lanes.
pub(crate) trait Mask: Copy {
    /// Bit `i` of `bits` is lane `i`.
    fn from_bits(bits: u32) -> Self;
    /// Lane `i` as bit `i`.
    fn bits(self) -> u32;
    /// Lanes in both.
    fn and(self, other: Self) -> Self;
    /// Lanes in either.
    fn or(self, other: Self) -> Self;
}

/// A short vector of f32. Comparisons with NaN are false, except [`Lanes::not_gt`].
pub(crate) trait Lanes:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// Number of lanes, at most 32.
    const N: usize;
    /// Its lane set.
    type M: Mask;
    /// All lanes alike.
    fn splat(value: f32) -> Self;
    /// The first `N` values; panics when there are fewer.
    fn load(values: &[f32]) -> Self;
    /// Every `stride`-th value, from the first on; panics when there are fewer.
    fn load_strided(values: &[f32], stride: usize) -> Self;
    /// Writes the first `N` values; panics when there are fewer.
    fn store(self, values: &mut [f32]);
    /// `self * b + c`, one rounding.
    fn fma(self, b: Self, c: Self) -> Self;
    /// `c - self * b`, one rounding.
    fn fnma(self, b: Self, c: Self) -> Self;
    /// `self * b - c`, one rounding.
    fn fms(self, b: Self, c: Self) -> Self;
    /// Smaller value; the second where either is NaN.
    fn min(self, other: Self) -> Self;
    /// Larger value; the second where either is NaN.
    fn max(self, other: Self) -> Self;
    /// Absolute value.
    fn abs(self) -> Self;
    /// Square root, correctly rounded.
    fn sqrt(self) -> Self;
    /// `self < other`.
    fn lt(self, other: Self) -> Self::M;
    /// `self <= other`.
    fn le(self, other: Self) -> Self::M;
    /// `self == other`.
    fn eq(self, other: Self) -> Self::M;
    /// Not `self > other`: true where either is NaN, so that a doubtful box is entered.
    fn not_gt(self, other: Self) -> Self::M;
    /// `yes` in the lanes of `mask`, else `no`.
    fn select(mask: Self::M, yes: Self, no: Self) -> Self;
    /// Value of one lane.
    #[inline(always)]
    fn lane(self, lane: usize) -> f32 {
        let mut values = [0.0; 32];
        self.store(&mut values);
        values[lane & 31]
    }
}

/// `[f(0), f(1), f(2)]`, spelled out: a closure would not be compiled for the instruction set of its caller.
macro_rules! three {
    ($i:ident => $value:expr) => {
        [
            {
                let $i = 0;
                $value
            },
            {
                let $i = 1;
                $value
            },
            {
                let $i = 2;
                $value
            },
        ]
    };
}
pub(crate) use three;

/// The three components of a vector, each in all lanes.
#[inline(always)]
pub(crate) fn splat3<L: Lanes>(v: [f32; 3]) -> [L; 3] {
    three!(i => L::splat(v[i]))
}

/// The vector types of one instruction set.
pub(crate) trait Isa {
    /// Rays of a packet.
    type Packet: Lanes;
    /// The 8 children of a node.
    type Node: Lanes;
    /// The 4 triangles of a block.
    type Block: Lanes;
}

/// Lanes of a packet that are set, from the first on.
#[inline(always)]
pub(crate) fn set_lanes(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        if bits == 0 {
            return None;
        }
        let lane = bits.trailing_zeros() as usize;
        bits &= bits - 1;
        Some(lane)
    })
}
