//! Operations that are written alike for AVX2 and AVX-512.
#![allow(unsafe_code, reason = "a load whose caller promises the place")]

use crate::trace::simd::vector::F16;
use std::arch::x86_64::*;

/// Number of values, from the first on, at whose start four numbers can be read without leaving the slice.
pub(super) const fn readable<const N: usize, const K: usize>(values: &[[f32; N]]) -> usize {
    const { assert!(N >= 3, "else the last values are too near the end") };
    const { assert!(K <= N && K <= 4, "four numbers of a value are read") };
    values.len().saturating_sub(if N == 3 { 1 } else { 0 })
}

/// Four numbers from the start of a value.
///
/// # Safety
/// The four numbers must lie in `values`.
#[inline(always)]
pub(super) unsafe fn four<const N: usize>(values: &[[f32; N]], index: u32) -> __m128 {
    // SAFETY: the caller promises that the four numbers lie in `values`; SSE is part of x86-64.
    unsafe { _mm_loadu_ps(values.as_ptr().add(index as usize).cast()) }
}

/// The first `K` of four columns.
#[inline(always)]
pub(super) fn first<const K: usize>(columns: [F16; 4]) -> [F16; K] {
    let mut wanted = [F16::ZERO; K];
    wanted.copy_from_slice(&columns[..K]);
    wanted
}

/// The operations that are written alike for both instruction sets.
macro_rules! common {
    () => {
        #[inline(always)]
        fn prefetch<T>(self, value: &T) {
            let start = std::ptr::from_ref(value).cast::<i8>();
            let mut offset = 0;
            while offset < size_of::<T>() {
                // SAFETY: a prefetch reads nothing, whatever the address; SSE is part of x86-64.
                unsafe { _mm_prefetch::<_MM_HINT_T0>(start.wrapping_add(offset)) };
                offset += 64;
            }
        }

        type Vector = __m256;

        #[inline(always)]
        fn load(self, values: &F8) -> __m256 {
            // SAFETY: AVX is present, since `self` exists; `F8` is 32 bytes, aligned to 32.
            unsafe { _mm256_load_ps(values.0.as_ptr()) }
        }

        #[inline(always)]
        fn store(self, vector: __m256) -> F8 {
            let mut values = F8([0.0; 8]);
            // SAFETY: AVX is present, since `self` exists; `F8` is 32 bytes, aligned to 32.
            unsafe { _mm256_store_ps(values.0.as_mut_ptr(), vector) };
            values
        }

        #[inline(always)]
        fn splat(self, value: f32) -> __m256 {
            // SAFETY: AVX is present, since `self` exists.
            unsafe { _mm256_set1_ps(value) }
        }

        #[inline(always)]
        fn add(self, a: __m256, b: __m256) -> __m256 {
            // SAFETY: AVX is present, since `self` exists.
            unsafe { _mm256_add_ps(a, b) }
        }

        #[inline(always)]
        fn sub(self, a: __m256, b: __m256) -> __m256 {
            // SAFETY: AVX is present, since `self` exists.
            unsafe { _mm256_sub_ps(a, b) }
        }

        #[inline(always)]
        fn mul(self, a: __m256, b: __m256) -> __m256 {
            // SAFETY: AVX is present, since `self` exists.
            unsafe { _mm256_mul_ps(a, b) }
        }

        #[inline(always)]
        fn about_mul_add(self, a: __m256, b: __m256, c: __m256) -> __m256 {
            // SAFETY: FMA is present, since `self` exists.
            unsafe { _mm256_fmadd_ps(a, b, c) }
        }

        #[inline(always)]
        fn max_or(self, a: __m256, b: __m256) -> __m256 {
            // SAFETY: AVX is present, since `self` exists.
            unsafe { _mm256_max_ps(a, b) }
        }

        #[inline(always)]
        fn min_or(self, a: __m256, b: __m256) -> __m256 {
            // SAFETY: AVX is present, since `self` exists.
            unsafe { _mm256_min_ps(a, b) }
        }
    };
}
pub(super) use common;
