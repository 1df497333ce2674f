//! The SIMD interface over AVX-512 (16 lanes), AVX2 (8) and SSE4.1 with FMA (4).
//!
//! Each method is inlined into an entry point of `dispatch` that enables the instruction set, after a run-time
//! check of the CPU; that check is what each `SAFETY: checked` below refers to.
use super::simd::{Isa, Lanes, Mask};
use super::simd_pair::Pair;
use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Sub};

/// 16 floats in a `zmm` register.
#[derive(Clone, Copy)]
#[repr(transparent)]
pub(crate) struct F32x16(__m512);
/// 8 floats in a `ymm` register.
#[derive(Clone, Copy)]
#[repr(transparent)]
pub(crate) struct F32x8(__m256);
/// 4 floats in an `xmm` register.
#[derive(Clone, Copy)]
#[repr(transparent)]
pub(crate) struct F32x4(__m128);
/// Lane set of [`F32x16`]: a `k` register.
#[derive(Clone, Copy)]
pub(crate) struct M16(__mmask16);
/// Lane set of [`F32x8`]: all bits of a lane, or none.
#[derive(Clone, Copy)]
pub(crate) struct M8(__m256);
/// Lane set of [`F32x4`].
#[derive(Clone, Copy)]
pub(crate) struct M4(__m128);

impl Mask for M16 {
    #[inline(always)]
    fn from_bits(bits: u32) -> Self {
        Self(bits as u16)
    }
    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from(self.0)
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

impl Mask for M8 {
    #[inline(always)]
    fn from_bits(bits: u32) -> Self {
        // SAFETY: checked.
        unsafe {
            let lanes = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let both = _mm256_and_si256(_mm256_set1_epi32(bits as i32), lanes);
            Self(_mm256_castsi256_ps(_mm256_cmpeq_epi32(both, lanes)))
        }
    }
    #[inline(always)]
    fn bits(self) -> u32 {
        // SAFETY: checked.
        unsafe { _mm256_movemask_ps(self.0) as u32 }
    }
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        // SAFETY: checked.
        Self(unsafe { _mm256_and_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        // SAFETY: checked.
        Self(unsafe { _mm256_or_ps(self.0, other.0) })
    }
}

impl Mask for M4 {
    #[inline(always)]
    fn from_bits(bits: u32) -> Self {
        // SAFETY: checked.
        unsafe {
            let lanes = _mm_setr_epi32(1, 2, 4, 8);
            let both = _mm_and_si128(_mm_set1_epi32(bits as i32), lanes);
            Self(_mm_castsi128_ps(_mm_cmpeq_epi32(both, lanes)))
        }
    }
    #[inline(always)]
    fn bits(self) -> u32 {
        // SAFETY: checked.
        unsafe { _mm_movemask_ps(self.0) as u32 }
    }
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        // SAFETY: checked.
        Self(unsafe { _mm_and_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        // SAFETY: checked.
        Self(unsafe { _mm_or_ps(self.0, other.0) })
    }
}

/// The arithmetic of one register width: the names of the intrinsics differ by prefix only.
macro_rules! lanes {
    ($float:ident, $mask:ident, $n:literal, $set1:ident, $load:ident, $store:ident, $add:ident, $sub:ident, $mul:ident,
     $div:ident, $fma:ident, $fnma:ident, $fms:ident, $min:ident, $max:ident, $abs:ident, $sqrt:ident, $cmp:ident, $select:ident, $strided:ident) => {
        lanes!(@op $float, Add, add, $add);
        lanes!(@op $float, Sub, sub, $sub);
        lanes!(@op $float, Mul, mul, $mul);
        lanes!(@op $float, Div, div, $div);
        impl Lanes for $float {
            const N: usize = $n;
            type M = $mask;
            #[inline(always)]
            fn splat(value: f32) -> Self {
                // SAFETY: checked.
                Self(unsafe { $set1(value) })
            }
            #[inline(always)]
            fn load(values: &[f32]) -> Self {
                assert!(values.len() >= $n);
                // SAFETY: checked; the slice is long enough.
                Self(unsafe { $load(values.as_ptr()) })
            }
            #[inline(always)]
            fn load_strided(values: &[f32], stride: usize) -> Self {
                assert!(values.len() > ($n - 1) * stride && stride < 1 << 20);
                // SAFETY: checked; the last index is inside.
                Self(unsafe { $strided(values.as_ptr(), stride as i32) })
            }
            #[inline(always)]
            fn store(self, values: &mut [f32]) {
                assert!(values.len() >= $n);
                // SAFETY: checked; the slice is long enough.
                unsafe { $store(values.as_mut_ptr(), self.0) }
            }
            lanes!(@three fma, $fma);
            lanes!(@three fnma, $fnma);
            lanes!(@three fms, $fms);
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                // SAFETY: checked.
                Self(unsafe { $min(self.0, other.0) })
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                // SAFETY: checked.
                Self(unsafe { $max(self.0, other.0) })
            }
            #[inline(always)]
            fn abs(self) -> Self {
                // SAFETY: checked.
                Self(unsafe { $abs(self.0) })
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                // SAFETY: checked.
                Self(unsafe { $sqrt(self.0) })
            }
            lanes!(@compare lt, $mask, $cmp, _CMP_LT_OQ);
            lanes!(@compare le, $mask, $cmp, _CMP_LE_OQ);
            lanes!(@compare eq, $mask, $cmp, _CMP_EQ_OQ);
            lanes!(@compare not_gt, $mask, $cmp, _CMP_NGT_UQ);
            #[inline(always)]
            fn select(mask: $mask, yes: Self, no: Self) -> Self {
                // SAFETY: checked.
                Self(unsafe { $select(no.0, yes.0, mask.0) })
            }
        }
    };
    (@op $float:ident, $trait:ident, $name:ident, $f:ident) => {
        impl $trait for $float {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                // SAFETY: checked.
                Self(unsafe { $f(self.0, other.0) })
            }
        }
    };
    (@three $name:ident, $f:ident) => {
        #[inline(always)]
        fn $name(self, b: Self, c: Self) -> Self {
            // SAFETY: checked.
            Self(unsafe { $f(self.0, b.0, c.0) })
        }
    };
    (@compare $name:ident, $mask:ident, $cmp:ident, $how:ident) => {
        #[inline(always)]
        fn $name(self, other: Self) -> $mask {
            // SAFETY: checked.
            $mask(unsafe { $cmp::<$how>(self.0, other.0) })
        }
    };
}

#[inline(always)]
unsafe fn select16(no: __m512, yes: __m512, mask: __mmask16) -> __m512 {
    // SAFETY: the caller has checked the CPU.
    unsafe { _mm512_mask_blend_ps(mask, no, yes) }
}
#[inline(always)]
unsafe fn abs8(a: __m256) -> __m256 {
    // SAFETY: the caller has checked the CPU.
    unsafe { _mm256_andnot_ps(_mm256_set1_ps(-0.0), a) }
}
#[inline(always)]
unsafe fn abs4(a: __m128) -> __m128 {
    // SAFETY: the caller has checked the CPU.
    unsafe { _mm_andnot_ps(_mm_set1_ps(-0.0), a) }
}

#[inline(always)]
unsafe fn strided16(from: *const f32, stride: i32) -> __m512 {
    // SAFETY: the caller has checked the CPU and the range.
    unsafe {
        let lanes = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
        _mm512_i32gather_ps::<4>(_mm512_mullo_epi32(lanes, _mm512_set1_epi32(stride)), from)
    }
}
#[inline(always)]
unsafe fn strided8(from: *const f32, stride: i32) -> __m256 {
    // SAFETY: the caller has checked the CPU and the range.
    unsafe {
        let lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
        _mm256_i32gather_ps::<4>(from, _mm256_mullo_epi32(lanes, _mm256_set1_epi32(stride)))
    }
}
#[inline(always)]
unsafe fn strided4(from: *const f32, stride: i32) -> __m128 {
    // SAFETY: the caller has checked the CPU and the range.
    unsafe { _mm_i32gather_ps::<4>(from, _mm_mullo_epi32(_mm_setr_epi32(0, 1, 2, 3), _mm_set1_epi32(stride))) }
}

lanes!(
    F32x16,
    M16,
    16,
    _mm512_set1_ps,
    _mm512_loadu_ps,
    _mm512_storeu_ps,
    _mm512_add_ps,
    _mm512_sub_ps,
    _mm512_mul_ps,
    _mm512_div_ps,
    _mm512_fmadd_ps,
    _mm512_fnmadd_ps,
    _mm512_fmsub_ps,
    _mm512_min_ps,
    _mm512_max_ps,
    _mm512_abs_ps,
    _mm512_sqrt_ps,
    _mm512_cmp_ps_mask,
    select16,
    strided16
);
lanes!(
    F32x8,
    M8,
    8,
    _mm256_set1_ps,
    _mm256_loadu_ps,
    _mm256_storeu_ps,
    _mm256_add_ps,
    _mm256_sub_ps,
    _mm256_mul_ps,
    _mm256_div_ps,
    _mm256_fmadd_ps,
    _mm256_fnmadd_ps,
    _mm256_fmsub_ps,
    _mm256_min_ps,
    _mm256_max_ps,
    abs8,
    _mm256_sqrt_ps,
    _mm256_cmp_ps,
    _mm256_blendv_ps,
    strided8
);
lanes!(
    F32x4,
    M4,
    4,
    _mm_set1_ps,
    _mm_loadu_ps,
    _mm_storeu_ps,
    _mm_add_ps,
    _mm_sub_ps,
    _mm_mul_ps,
    _mm_div_ps,
    _mm_fmadd_ps,
    _mm_fnmadd_ps,
    _mm_fmsub_ps,
    _mm_min_ps,
    _mm_max_ps,
    abs4,
    _mm_sqrt_ps,
    _mm_cmp_ps,
    _mm_blendv_ps,
    strided4
);

/// AVX-512 F, BW, DQ, VL: packets of 16 rays.
pub(crate) struct Avx512;

impl Isa for Avx512 {
    type Packet = Pair<F32x16>;
    type Node = F32x8;
    type Block = F32x4;
}

/// AVX2 and FMA: packets of 8 rays.
pub(crate) struct Avx2;

impl Isa for Avx2 {
    type Packet = Pair<F32x8>;
    type Node = F32x8;
    type Block = F32x4;
}
