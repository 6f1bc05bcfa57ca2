//! AVX2 with FMA: sixteen numbers are two registers.
#![allow(unsafe_code, reason = "intrinsics of instruction sets that a value of these types proves to be present")]

use super::common::{common, first, four, readable};
use crate::trace::simd::vector::{F8, F16, Kernel, Mask, Simd, gather_each};
use glam::DVec3;
use std::arch::x86_64::*;

/// The lanes of each mask of eight, lowest first, one byte each. `pdep` and `pext` could compute them, but take 165 cycles together on
/// AMD's processors before Zen 3, which implement them in microcode.
static COMPRESSED: [u64; 256] = {
    let mut compressed = [0; 256];
    let mut mask = 0;
    while mask < compressed.len() {
        let (mut lane, mut len) = (0, 0);
        while lane < 8 {
            if mask >> lane & 1 == 1 {
                compressed[mask] |= lane << (8 * len);
                len += 1;
            }
            lane += 1;
        }
        mask += 1;
    }
    compressed
};

/// AVX2, FMA and bit manipulation. A value exists only where the processor has them: [`Self::detect`] is the only way
/// to make one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Avx2(());

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

impl Avx2 {
    #[inline(always)]
    fn none(self) -> __m128 {
        // SAFETY: SSE is part of x86-64.
        unsafe { _mm_setzero_ps() }
    }

    /// The first components of sixteen values, their second ones, and so on.
    #[inline(always)]
    fn transposed(self, values: [__m128; 16]) -> [F16; 4] {
        // SAFETY: AVX is present, since `self` exists.
        let [low, high] = unsafe {
            let mut halves = [[_mm256_setzero_ps(); 4]; 2];
            for (half, axes) in halves.iter_mut().enumerate() {
                let mut rows = [_mm256_setzero_ps(); 4];
                for (lane, row) in rows.iter_mut().enumerate() {
                    let lane = 8 * half + lane;
                    *row = _mm256_set_m128(values[lane + 4], values[lane]);
                }
                let [a, b, c, d] = rows;
                let low = [_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d)];
                let high = [_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d)];
                axes[0] = _mm256_shuffle_ps::<0b01_00_01_00>(low[0], low[1]);
                axes[1] = _mm256_shuffle_ps::<0b11_10_11_10>(low[0], low[1]);
                axes[2] = _mm256_shuffle_ps::<0b01_00_01_00>(high[0], high[1]);
                axes[3] = _mm256_shuffle_ps::<0b11_10_11_10>(high[0], high[1]);
            }
            halves
        };
        [
            self.wide_store([low[0], high[0]]),
            self.wide_store([low[1], high[1]]),
            self.wide_store([low[2], high[2]]),
            self.wide_store([low[3], high[3]]),
        ]
    }
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
        let lanes = COMPRESSED[mask as usize & (COMPRESSED.len() - 1)];
        // SAFETY: AVX2 is present, since `self` exists; eight numbers are 32 bytes.
        unsafe {
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
        let mut rows = [self.none(); 16];
        for (row, &index) in rows.iter_mut().zip(indices) {
            // SAFETY: the index is below `readable`, so four numbers lie in `values` from the start of that value on.
            *row = unsafe { four(values, index) };
        }
        first(self.transposed(rows))
    }

    #[inline(always)]
    fn columns(self, rows: [&[[f32; 4]; 4]; 4]) -> [F16; 4] {
        let mut values = [self.none(); 16];
        for (value, row) in values.iter_mut().zip(rows.into_iter().flatten()) {
            // SAFETY: SSE is part of x86-64; four numbers are 16 bytes.
            *value = unsafe { _mm_loadu_ps(row.as_ptr()) };
        }
        self.transposed(values)
    }

    #[inline(always)]
    fn quarters(self, [a, b, c, d]: [&[u32; 4]; 4]) -> [u32; 16] {
        let mut joined = [0; 16];
        // SAFETY: AVX is present, since `self` exists; four numbers are 16 bytes, each half of sixteen 32.
        unsafe {
            let low = _mm256_loadu2_m128i(b.as_ptr().cast(), a.as_ptr().cast());
            let high = _mm256_loadu2_m128i(d.as_ptr().cast(), c.as_ptr().cast());
            _mm256_storeu_si256(joined.as_mut_ptr().cast(), low);
            _mm256_storeu_si256(joined[8..].as_mut_ptr().cast(), high);
        }
        joined
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
