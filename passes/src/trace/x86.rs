//! The vector instructions of x86-64.
#![allow(unsafe_code, reason = "intrinsics of instruction sets that a value of these types proves to be present")]

use super::dispatch::Work;
use super::lanes::{F8, Mask, Simd};
use std::arch::x86_64::{
    __m256, _CMP_LE_OQ, _mm256_cmp_ps, _mm256_cmp_ps_mask, _mm256_fmadd_ps, _mm256_load_ps, _mm256_max_ps,
    _mm256_min_ps, _mm256_movemask_ps, _mm256_mul_ps, _mm256_set1_ps, _mm256_store_ps, _mm256_sub_ps,
};

/// AVX2, FMA and bit manipulation. Exists only where the processor has them: [`Self::detect`] is the one way to make it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Avx2(());

/// AVX-512 F, VL, BW and DQ besides. Exists only where the processor has them: [`Self::detect`] is the one way to make it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Avx512(());

impl Avx2 {
    pub(super) fn detect() -> Option<Self> {
        let present = is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("fma")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("bmi2")
            && is_x86_feature_detected!("lzcnt")
            && is_x86_feature_detected!("popcnt");
        present.then_some(Self(()))
    }

    /// Runs a function that is `#[inline(always)]`, compiled for the instruction set.
    #[inline(always)]
    pub(super) fn run<T>(self, work: impl Work<T>) -> T {
        #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
        fn compiled<T>(simd: Avx2, work: impl Work<T>) -> T {
            work.run(simd)
        }
        // SAFETY: `self` exists, so `detect` saw all the features that `compiled` enables.
        unsafe { compiled(self, work) }
    }
}

impl Avx512 {
    pub(super) fn detect() -> Option<Self> {
        let present = Avx2::detect().is_some()
            && is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512vl")
            && is_x86_feature_detected!("avx512bw")
            && is_x86_feature_detected!("avx512dq");
        present.then_some(Self(()))
    }

    /// Runs a function that is `#[inline(always)]`, compiled for the instruction set.
    #[inline(always)]
    pub(super) fn run<T>(self, work: impl Work<T>) -> T {
        #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512bw,avx512dq")]
        fn compiled<T>(simd: Avx512, work: impl Work<T>) -> T {
            work.run(simd)
        }
        // SAFETY: `self` exists, so `detect` saw all the features that `compiled` enables.
        unsafe { compiled(self, work) }
    }
}

/// The operations that both instruction sets spell alike.
macro_rules! common {
    () => {
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

impl Simd for Avx2 {
    common!();

    #[inline(always)]
    fn at_most(self, a: __m256, b: __m256) -> Mask {
        // SAFETY: AVX is present, since `self` exists.
        unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b)) as Mask }
    }
}

impl Simd for Avx512 {
    common!();

    #[inline(always)]
    fn at_most(self, a: __m256, b: __m256) -> Mask {
        // SAFETY: AVX-512 F and VL are present, since `self` exists.
        Mask::from(unsafe { _mm256_cmp_ps_mask::<_CMP_LE_OQ>(a, b) })
    }
}
