//! The vector instructions of x86-64.
#![allow(unsafe_code, reason = "intrinsics of instruction sets that a value of these types proves to be present")]

use super::vector::{F8, F16, Kernel, Mask, Simd, gather_each};
use glam::DVec3;
use std::arch::x86_64::*;

/// AVX2, FMA and bit manipulation. Exists only where the processor has them: [`Self::detect`] is the one way to make it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Avx2(());

/// AVX-512 F, VL, BW and DQ besides. Exists only where the processor has them: [`Self::detect`] is the one way to make it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Avx512(());

impl Avx2 {
    pub(crate) fn detect() -> Option<Self> {
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
    pub(crate) fn run<T>(self, kernel: impl Kernel<T>) -> T {
        #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
        fn compiled<T>(simd: Avx2, kernel: impl Kernel<T>) -> T {
            kernel.run(simd)
        }
        // SAFETY: `self` exists, so `detect` saw all the features that `compiled` enables.
        unsafe { compiled(self, kernel) }
    }
}

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

impl Avx2 {
    /// [`Simd::wide_plane`] of eight rays: `[origin, direction][axis]`.
    #[inline(always)]
    fn plane(self, normal: DVec3, corner: DVec3, rays: [[__m256; 3]; 2]) -> __m256 {
        // SAFETY: AVX is present, since `self` exists.
        unsafe {
            let (mut over, mut under) = ([_mm256_setzero_pd(); 2], [_mm256_setzero_pd(); 2]);
            for axis in 0..3 {
                let (along, corner) = (_mm256_set1_pd(normal[axis]), _mm256_set1_pd(corner[axis]));
                let (o, d) = (rays[0][axis], rays[1][axis]);
                let low = [_mm256_castps256_ps128(o), _mm256_castps256_ps128(d)];
                let high = [_mm256_extractf128_ps::<1>(o), _mm256_extractf128_ps::<1>(d)];
                for (half, [o, d]) in [low, high].into_iter().enumerate() {
                    let to = _mm256_sub_pd(corner, _mm256_cvtps_pd(o));
                    let (a, b) = (_mm256_mul_pd(along, to), _mm256_mul_pd(along, _mm256_cvtps_pd(d)));
                    over[half] = if axis == 0 { a } else { _mm256_add_pd(over[half], a) };
                    under[half] = if axis == 0 { b } else { _mm256_add_pd(under[half], b) };
                }
            }
            let low = _mm256_cvtpd_ps(_mm256_div_pd(over[0], under[0]));
            let high = _mm256_cvtpd_ps(_mm256_div_pd(over[1], under[1]));
            _mm256_set_m128(high, low)
        }
    }
}

/// How many of some values four numbers can be read from.
const fn readable<const N: usize, const K: usize>(values: &[[f32; N]]) -> usize {
    const { assert!(N >= 3, "else the last values are too near the end") };
    const { assert!(K <= N && K <= 4, "four numbers of a value are read") };
    values.len().saturating_sub(if N == 3 { 1 } else { 0 })
}

/// The four numbers from a value on.
///
/// # Safety
/// They lie in `values`.
#[inline(always)]
unsafe fn four<const N: usize>(values: &[[f32; N]], index: u32) -> __m128 {
    // SAFETY: as promised; SSE is part of x86-64.
    unsafe { _mm_loadu_ps(values.as_ptr().add(index as usize).cast()) }
}

/// The first of four columns.
#[inline(always)]
fn first<const K: usize>(columns: [F16; 4]) -> [F16; K] {
    let mut wanted = [F16::ZERO; K];
    wanted.copy_from_slice(&columns[..K]);
    wanted
}

/// The operations that both instruction sets spell alike.
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

impl Simd for Avx2 {
    common!();

    #[inline(always)]
    fn negative(self, values: &[u32; 8]) -> Mask {
        // SAFETY: AVX is present, since `self` exists; eight numbers are 32 bytes.
        unsafe { _mm256_movemask_ps(_mm256_loadu_ps(values.as_ptr().cast())) as Mask }
    }

    #[inline(always)]
    fn compress(self, values: &[u32; 8], mask: Mask) -> [u32; 8] {
        let mut compressed = [0; 8];
        // SAFETY: AVX2 and BMI2 are present, since `self` exists; eight numbers are 32 bytes.
        unsafe {
            // The numbers of the lanes of the mask, a byte each.
            let chosen = _pdep_u64(mask.into(), 0x0101_0101_0101_0101).wrapping_mul(0xff);
            let lanes = _pext_u64(0x0706_0504_0302_0100, chosen);
            let lanes = _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(lanes as i64));
            let values = _mm256_loadu_si256(values.as_ptr().cast());
            _mm256_storeu_si256(compressed.as_mut_ptr().cast(), _mm256_permutevar8x32_epi32(values, lanes));
        }
        compressed
    }

    #[inline(always)]
    fn at_most(self, a: __m256, b: __m256) -> Mask {
        // SAFETY: AVX is present, since `self` exists.
        unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b)) as Mask }
    }

    type Wide = [__m256; 2];

    #[inline(always)]
    fn wide_load(self, values: &F16) -> [__m256; 2] {
        // SAFETY: AVX is present, since `self` exists; `F16` is 64 bytes, aligned to 64.
        unsafe { [_mm256_load_ps(values.0.as_ptr()), _mm256_load_ps(values.0.as_ptr().add(8))] }
    }

    #[inline(always)]
    fn wide_store(self, [low, high]: [__m256; 2]) -> F16 {
        let mut values = F16::ZERO;
        // SAFETY: AVX is present, since `self` exists; `F16` is 64 bytes, aligned to 64.
        unsafe {
            _mm256_store_ps(values.0.as_mut_ptr(), low);
            _mm256_store_ps(values.0.as_mut_ptr().add(8), high);
        }
        values
    }

    #[inline(always)]
    fn wide_splat(self, value: f32) -> [__m256; 2] {
        [self.splat(value); 2]
    }

    #[inline(always)]
    fn wide_add(self, [a, b]: [__m256; 2], [c, d]: [__m256; 2]) -> [__m256; 2] {
        // SAFETY: AVX is present, since `self` exists.
        unsafe { [_mm256_add_ps(a, c), _mm256_add_ps(b, d)] }
    }

    #[inline(always)]
    fn wide_sub(self, [a, b]: [__m256; 2], [c, d]: [__m256; 2]) -> [__m256; 2] {
        [self.sub(a, c), self.sub(b, d)]
    }

    #[inline(always)]
    fn wide_mul(self, [a, b]: [__m256; 2], [c, d]: [__m256; 2]) -> [__m256; 2] {
        [self.mul(a, c), self.mul(b, d)]
    }

    #[inline(always)]
    fn wide_div(self, [a, b]: [__m256; 2], [c, d]: [__m256; 2]) -> [__m256; 2] {
        // SAFETY: AVX is present, since `self` exists.
        unsafe { [_mm256_div_ps(a, c), _mm256_div_ps(b, d)] }
    }

    #[inline(always)]
    fn wide_abs(self, [a, b]: [__m256; 2]) -> [__m256; 2] {
        // SAFETY: AVX is present, since `self` exists.
        unsafe {
            let sign = _mm256_set1_ps(-0.0);
            [_mm256_andnot_ps(sign, a), _mm256_andnot_ps(sign, b)]
        }
    }

    #[inline(always)]
    fn wide_about_mul_add(self, [a, b]: [__m256; 2], [c, d]: [__m256; 2], [e, f]: [__m256; 2]) -> [__m256; 2] {
        [self.about_mul_add(a, c, e), self.about_mul_add(b, d, f)]
    }

    #[inline(always)]
    fn wide_max_or(self, [a, b]: [__m256; 2], [c, d]: [__m256; 2]) -> [__m256; 2] {
        [self.max_or(a, c), self.max_or(b, d)]
    }

    #[inline(always)]
    fn wide_min_or(self, [a, b]: [__m256; 2], [c, d]: [__m256; 2]) -> [__m256; 2] {
        [self.min_or(a, c), self.min_or(b, d)]
    }

    #[inline(always)]
    fn wide_at_most(self, [a, b]: [__m256; 2], [c, d]: [__m256; 2]) -> Mask {
        self.at_most(a, c) | self.at_most(b, d) << 8
    }

    #[inline(always)]
    fn wide_below(self, [a, b]: [__m256; 2], [c, d]: [__m256; 2]) -> Mask {
        // SAFETY: AVX is present, since `self` exists.
        unsafe {
            let low = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(a, c));
            let high = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(b, d));
            low as Mask | (high as Mask) << 8
        }
    }

    #[inline(always)]
    fn wide_select(self, mask: Mask, [a, b]: [__m256; 2], [c, d]: [__m256; 2]) -> [__m256; 2] {
        // SAFETY: AVX2 is present, since `self` exists.
        unsafe {
            let bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let low = _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(mask as i32), bits), bits);
            let high = _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32((mask >> 8) as i32), bits), bits);
            [_mm256_blendv_ps(c, a, _mm256_castsi256_ps(low)), _mm256_blendv_ps(d, b, _mm256_castsi256_ps(high))]
        }
    }

    #[inline(always)]
    fn wide_least(self, [a, b]: [__m256; 2]) -> f32 {
        // SAFETY: AVX is present, since `self` exists.
        unsafe {
            let eight = _mm256_min_ps(a, b);
            let four = _mm_min_ps(_mm256_castps256_ps128(eight), _mm256_extractf128_ps::<1>(eight));
            let two = _mm_min_ps(four, _mm_movehl_ps(four, four));
            _mm_cvtss_f32(_mm_min_ps(two, _mm_shuffle_ps::<1>(two, two)))
        }
    }

    #[inline(always)]
    fn wide_most(self, [a, b]: [__m256; 2]) -> f32 {
        // SAFETY: AVX is present, since `self` exists.
        unsafe {
            let eight = _mm256_max_ps(a, b);
            let four = _mm_max_ps(_mm256_castps256_ps128(eight), _mm256_extractf128_ps::<1>(eight));
            let two = _mm_max_ps(four, _mm_movehl_ps(four, four));
            _mm_cvtss_f32(_mm_max_ps(two, _mm_shuffle_ps::<1>(two, two)))
        }
    }

    #[inline(always)]
    fn gather<const N: usize, const K: usize>(self, values: &[[f32; N]], indices: &[u32; 16]) -> [F16; K] {
        let most = indices.iter().fold(0, |most, &index| if index > most { index } else { most });
        if most as usize >= readable::<N, K>(values) {
            return gather_each(values, indices);
        }
        // SAFETY: AVX is present, since `self` exists, and four numbers lie from each of the values on.
        let [x, y, z, w] = unsafe {
            let mut halves = [[_mm256_setzero_ps(); 4]; 2];
            for (half, axes) in halves.iter_mut().enumerate() {
                let mut rows = [_mm256_setzero_ps(); 4];
                for (lane, row) in rows.iter_mut().enumerate() {
                    let lane = 8 * half + lane;
                    *row = _mm256_set_m128(four(values, indices[lane + 4]), four(values, indices[lane]));
                }
                let [a, b, c, d] = rows;
                let low = [_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d)];
                let high = [_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d)];
                axes[0] = _mm256_shuffle_ps::<0b01_00_01_00>(low[0], low[1]);
                axes[1] = _mm256_shuffle_ps::<0b11_10_11_10>(low[0], low[1]);
                axes[2] = _mm256_shuffle_ps::<0b01_00_01_00>(high[0], high[1]);
                axes[3] = _mm256_shuffle_ps::<0b11_10_11_10>(high[0], high[1]);
            }
            let [low, high] = halves;
            [[low[0], high[0]], [low[1], high[1]], [low[2], high[2]], [low[3], high[3]]]
        };
        first([self.wide_store(x), self.wide_store(y), self.wide_store(z), self.wide_store(w)])
    }

    #[inline(always)]
    fn wide_equal(self, values: &[u32; 16], value: u32) -> Mask {
        let mut mask = 0;
        // SAFETY: AVX2 is present, since `self` exists; each half of sixteen numbers is 32 bytes.
        unsafe {
            for half in 0..2 {
                let values = _mm256_loadu_si256(values[8 * half..].as_ptr().cast());
                let equal = _mm256_cmpeq_epi32(values, _mm256_set1_epi32(value as i32));
                mask |= (_mm256_movemask_ps(_mm256_castsi256_ps(equal)) as Mask) << (8 * half);
            }
        }
        mask
    }

    #[inline(always)]
    fn wide_plane(
        self,
        normal: DVec3,
        corner: DVec3,
        origin: [[__m256; 2]; 3],
        direction: [[__m256; 2]; 3],
    ) -> [__m256; 2] {
        let mut result = origin[0];
        for half in 0..2 {
            let part = [
                [origin[0][half], origin[1][half], origin[2][half]],
                [direction[0][half], direction[1][half], direction[2][half]],
            ];
            result[half] = self.plane(normal, corner, part);
        }
        result
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
        // SAFETY: AVX-512 F is present, since `self` exists, and four numbers lie from each of the values on.
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
            // Four of a column of the rows each.
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
