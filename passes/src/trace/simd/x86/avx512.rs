//! AVX-512: sixteen numbers are one register.
#![allow(unsafe_code, reason = "intrinsics of instruction sets that a value of these types proves to be present")]

use super::avx2::Avx2;
use super::common::{common, first, four, readable};
use crate::trace::simd::vector::{F8, F16, Kernel, Mask, Simd, gather_each};
use glam::DVec3;
use std::arch::x86_64::*;

/// AVX-512 F, VL, BW and DQ, in addition to AVX2. A value exists only where the processor has them: [`Self::detect`] is the only way to
/// make one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Avx512(());

impl Avx512 {
    pub(crate) fn detect() -> Option<Self> {
        let present = Avx2::detect().is_some()
            && is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512vl")
            && is_x86_feature_detected!("avx512bw")
            && is_x86_feature_detected!("avx512dq");
        present.then_some(Self(()))
    }

    /// Runs a function that is `#[inline(always)]`, compiled for the instruction set.
    #[inline(always)]
    pub(crate) fn run<T>(self, kernel: impl Kernel<T>) -> T {
        #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512bw,avx512dq")]
        fn compiled<T>(simd: Avx512, kernel: impl Kernel<T>) -> T {
            kernel.run(simd)
        }
        // SAFETY: `self` exists, so `detect` saw all the features that `compiled` enables.
        unsafe { compiled(self, kernel) }
    }
}

impl Simd for Avx512 {
    common!();

    #[inline(always)]
    fn negative(self, values: &[u32; 8]) -> Mask {
        // SAFETY: AVX-512 DQ and VL are present, since `self` exists; eight numbers are 32 bytes.
        Mask::from(unsafe { _mm256_movepi32_mask(_mm256_loadu_si256(values.as_ptr().cast())) })
    }

    #[inline(always)]
    fn compress(self, values: &[u32; 8], mask: Mask) -> [u32; 8] {
        let mut compressed = [0; 8];
        // SAFETY: AVX-512 F and VL are present, since `self` exists; eight numbers are 32 bytes.
        unsafe {
            let values = _mm256_loadu_si256(values.as_ptr().cast());
            let chosen = _mm256_maskz_compress_epi32(mask as __mmask8, values);
            _mm256_storeu_si256(compressed.as_mut_ptr().cast(), chosen);
        }
        compressed
    }

    #[inline(always)]
    fn at_most(self, a: __m256, b: __m256) -> Mask {
        // SAFETY: AVX-512 F and VL are present, since `self` exists.
        Mask::from(unsafe { _mm256_cmp_ps_mask::<_CMP_LE_OQ>(a, b) })
    }

    type Wide = __m512;

    #[inline(always)]
    fn wide_load(self, values: &F16) -> __m512 {
        // SAFETY: AVX-512 F is present, since `self` exists; `F16` is 64 bytes, aligned to 64.
        unsafe { _mm512_load_ps(values.0.as_ptr()) }
    }

    #[inline(always)]
    fn wide_store(self, vector: __m512) -> F16 {
        let mut values = F16::ZERO;
        // SAFETY: AVX-512 F is present, since `self` exists; `F16` is 64 bytes, aligned to 64.
        unsafe { _mm512_store_ps(values.0.as_mut_ptr(), vector) };
        values
    }

    #[inline(always)]
    fn wide_splat(self, value: f32) -> __m512 {
        // SAFETY: AVX-512 F is present, since `self` exists.
        unsafe { _mm512_set1_ps(value) }
    }

    #[inline(always)]
    fn wide_add(self, a: __m512, b: __m512) -> __m512 {
        // SAFETY: AVX-512 F is present, since `self` exists.
        unsafe { _mm512_add_ps(a, b) }
    }

    #[inline(always)]
    fn wide_sub(self, a: __m512, b: __m512) -> __m512 {
        // SAFETY: AVX-512 F is present, since `self` exists.
        unsafe { _mm512_sub_ps(a, b) }
    }

    #[inline(always)]
    fn wide_mul(self, a: __m512, b: __m512) -> __m512 {
        // SAFETY: AVX-512 F is present, since `self` exists.
        unsafe { _mm512_mul_ps(a, b) }
    }

    #[inline(always)]
    fn wide_div(self, a: __m512, b: __m512) -> __m512 {
        // SAFETY: AVX-512 F is present, since `self` exists.
        unsafe { _mm512_div_ps(a, b) }
    }

    #[inline(always)]
    fn wide_abs(self, a: __m512) -> __m512 {
        // SAFETY: AVX-512 F is present, since `self` exists.
        unsafe { _mm512_abs_ps(a) }
    }

    #[inline(always)]
    fn wide_about_mul_add(self, a: __m512, b: __m512, c: __m512) -> __m512 {
        // SAFETY: AVX-512 F is present, since `self` exists.
        unsafe { _mm512_fmadd_ps(a, b, c) }
    }

    #[inline(always)]
    fn wide_max_or(self, a: __m512, b: __m512) -> __m512 {
        // SAFETY: AVX-512 F is present, since `self` exists.
        unsafe { _mm512_max_ps(a, b) }
    }

    #[inline(always)]
    fn wide_min_or(self, a: __m512, b: __m512) -> __m512 {
        // SAFETY: AVX-512 F is present, since `self` exists.
        unsafe { _mm512_min_ps(a, b) }
    }

    #[inline(always)]
    fn wide_at_most(self, a: __m512, b: __m512) -> Mask {
        // SAFETY: AVX-512 F is present, since `self` exists.
        Mask::from(unsafe { _mm512_cmp_ps_mask::<_CMP_LE_OQ>(a, b) })
    }

    #[inline(always)]
    fn wide_below(self, a: __m512, b: __m512) -> Mask {
        // SAFETY: AVX-512 F is present, since `self` exists.
        Mask::from(unsafe { _mm512_cmp_ps_mask::<_CMP_LT_OQ>(a, b) })
    }

    #[inline(always)]
    fn wide_select(self, mask: Mask, a: __m512, b: __m512) -> __m512 {
        // SAFETY: AVX-512 F is present, since `self` exists.
        unsafe { _mm512_mask_blend_ps(mask as __mmask16, b, a) }
    }

    #[inline(always)]
    fn wide_least(self, a: __m512) -> f32 {
        // SAFETY: AVX-512 F is present, since `self` exists.
        unsafe { _mm512_reduce_min_ps(a) }
    }

    #[inline(always)]
    fn wide_most(self, a: __m512) -> f32 {
        // SAFETY: AVX-512 F is present, since `self` exists.
        unsafe { _mm512_reduce_max_ps(a) }
    }

    #[inline(always)]
    fn gather<const N: usize, const K: usize>(self, values: &[[f32; N]], indices: &[u32; 16]) -> [F16; K] {
        // SAFETY: AVX-512 F is present, since `self` exists; sixteen numbers are 64 bytes.
        let most = unsafe { _mm512_reduce_max_epu32(_mm512_loadu_si512(indices.as_ptr().cast())) };
        if most as usize >= readable::<N, K>(values) {
            return gather_each(values, indices);
        }
        // SAFETY: AVX-512 F is present, since `self` exists; all indices are below `readable`, so four numbers lie in `values` from each
        // on.
        let [x, y, z, w] = unsafe {
            let mut rows = [_mm512_setzero_ps(); 4];
            for (lane, row) in rows.iter_mut().enumerate() {
                let low = _mm512_castps128_ps512(four(values, indices[lane]));
                let low = _mm512_insertf32x4::<1>(low, four(values, indices[lane + 4]));
                let low = _mm512_insertf32x4::<2>(low, four(values, indices[lane + 8]));
                *row = _mm512_insertf32x4::<3>(low, four(values, indices[lane + 12]));
            }
            let [a, b, c, d] = rows;
            let low = [_mm512_unpacklo_ps(a, b), _mm512_unpacklo_ps(c, d)];
            let high = [_mm512_unpackhi_ps(a, b), _mm512_unpackhi_ps(c, d)];
            [
                _mm512_shuffle_ps::<0b01_00_01_00>(low[0], low[1]),
                _mm512_shuffle_ps::<0b11_10_11_10>(low[0], low[1]),
                _mm512_shuffle_ps::<0b01_00_01_00>(high[0], high[1]),
                _mm512_shuffle_ps::<0b11_10_11_10>(high[0], high[1]),
            ]
        };
        first([self.wide_store(x), self.wide_store(y), self.wide_store(z), self.wide_store(w)])
    }

    #[inline(always)]
    fn columns(self, rows: [&[[f32; 4]; 4]; 4]) -> [F16; 4] {
        // SAFETY: AVX-512 F is present, since `self` exists; four values of four numbers are 64 bytes.
        let columns = unsafe {
            let load = |row: usize| _mm512_loadu_ps(rows[row].as_ptr().cast());
            let [a, b, c, d] = [load(0), load(1), load(2), load(3)];
            let low = [_mm512_unpacklo_ps(a, b), _mm512_unpacklo_ps(c, d)];
            let high = [_mm512_unpackhi_ps(a, b), _mm512_unpackhi_ps(c, d)];
            // Transposes the 4 x 4 numbers of a component: those of row `a` come first, then those of `b`, `c` and `d`.
            let by_row = _mm512_setr_epi32(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15);
            [
                _mm512_permutexvar_ps(by_row, _mm512_shuffle_ps::<0b01_00_01_00>(low[0], low[1])),
                _mm512_permutexvar_ps(by_row, _mm512_shuffle_ps::<0b11_10_11_10>(low[0], low[1])),
                _mm512_permutexvar_ps(by_row, _mm512_shuffle_ps::<0b01_00_01_00>(high[0], high[1])),
                _mm512_permutexvar_ps(by_row, _mm512_shuffle_ps::<0b11_10_11_10>(high[0], high[1])),
            ]
        };
        let [x, y, z, w] = columns;
        [self.wide_store(x), self.wide_store(y), self.wide_store(z), self.wide_store(w)]
    }

    #[inline(always)]
    fn quarters(self, [a, b, c, d]: [&[u32; 4]; 4]) -> [u32; 16] {
        let mut joined = [0; 16];
        // SAFETY: AVX-512 F is present, since `self` exists; four numbers are 16 bytes, sixteen 64.
        unsafe {
            let all = _mm512_castsi128_si512(_mm_loadu_si128(a.as_ptr().cast()));
            let all = _mm512_inserti32x4::<1>(all, _mm_loadu_si128(b.as_ptr().cast()));
            let all = _mm512_inserti32x4::<2>(all, _mm_loadu_si128(c.as_ptr().cast()));
            let all = _mm512_inserti32x4::<3>(all, _mm_loadu_si128(d.as_ptr().cast()));
            _mm512_storeu_si512(joined.as_mut_ptr().cast(), all);
        }
        joined
    }

    #[inline(always)]
    fn wide_equal(self, values: &[u32; 16], value: u32) -> Mask {
        // SAFETY: AVX-512 F is present, since `self` exists; sixteen numbers are 64 bytes.
        unsafe {
            let values = _mm512_loadu_si512(values.as_ptr().cast());
            Mask::from(_mm512_cmpeq_epi32_mask(values, _mm512_set1_epi32(value as i32)))
        }
    }

    #[inline(always)]
    fn wide_plane(self, normal: DVec3, corner: DVec3, origin: [__m512; 3], direction: [__m512; 3]) -> __m512 {
        // SAFETY: AVX-512 F and DQ are present, since `self` exists.
        unsafe {
            let (mut over, mut under) = ([_mm512_setzero_pd(); 2], [_mm512_setzero_pd(); 2]);
            for axis in 0..3 {
                let (along, corner) = (_mm512_set1_pd(normal[axis]), _mm512_set1_pd(corner[axis]));
                let (o, d) = (origin[axis], direction[axis]);
                let low = [_mm512_castps512_ps256(o), _mm512_castps512_ps256(d)];
                let high = [_mm512_extractf32x8_ps::<1>(o), _mm512_extractf32x8_ps::<1>(d)];
                for (half, [o, d]) in [low, high].into_iter().enumerate() {
                    let to = _mm512_sub_pd(corner, _mm512_cvtps_pd(o));
                    let (a, b) = (_mm512_mul_pd(along, to), _mm512_mul_pd(along, _mm512_cvtps_pd(d)));
                    over[half] = if axis == 0 { a } else { _mm512_add_pd(over[half], a) };
                    under[half] = if axis == 0 { b } else { _mm512_add_pd(under[half], b) };
                }
            }
            let low = _mm512_cvtpd_ps(_mm512_div_pd(over[0], under[0]));
            let high = _mm512_cvtpd_ps(_mm512_div_pd(over[1], under[1]));
            _mm512_insertf32x8::<1>(_mm512_castps256_ps512(low), high)
        }
    }
}
