//! The instruction set of every processor: plain loops over arrays, which the compiler may turn into vectors.

use super::vector::{F8, F16, LANES, Mask, NO_LANES, Simd, WIDE, first_lane, without_first};
use glam::DVec3;

/// Plain loops over arrays.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plain;

#[inline(always)]
fn zip(a: F8, b: F8, operation: impl Fn(f32, f32) -> f32) -> F8 {
    let mut result = a.0;
    for (lane, value) in result.iter_mut().enumerate() {
        *value = operation(a.0[lane], b.0[lane]);
    }
    F8(result)
}

impl Simd for Plain {
    type Vector = F8;

    #[inline(always)]
    fn load(self, values: &F8) -> F8 {
        *values
    }

    #[inline(always)]
    fn store(self, vector: F8) -> F8 {
        vector
    }

    #[inline(always)]
    fn splat(self, value: f32) -> F8 {
        F8([value; LANES])
    }

    #[inline(always)]
    fn add(self, a: F8, b: F8) -> F8 {
        zip(a, b, |a, b| a + b)
    }

    #[inline(always)]
    fn sub(self, a: F8, b: F8) -> F8 {
        zip(a, b, |a, b| a - b)
    }

    #[inline(always)]
    fn about_mul_add(self, a: F8, b: F8, c: F8) -> F8 {
        let product = self.mul(a, b);
        zip(product, c, |product, c| product + c)
    }

    #[inline(always)]
    fn mul(self, a: F8, b: F8) -> F8 {
        zip(a, b, |a, b| a * b)
    }

    #[inline(always)]
    fn max_or(self, a: F8, b: F8) -> F8 {
        zip(a, b, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn min_or(self, a: F8, b: F8) -> F8 {
        zip(a, b, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn at_most(self, a: F8, b: F8) -> Mask {
        let mut mask = NO_LANES;
        for lane in 0..LANES {
            mask |= Mask::from(a.0[lane] <= b.0[lane]) << lane;
        }
        mask
    }

    #[inline(always)]
    fn negative(self, values: &[u32; LANES]) -> Mask {
        let mut mask = NO_LANES;
        for (lane, value) in values.iter().enumerate() {
            mask |= (value >> 31) << lane;
        }
        mask
    }

    #[inline(always)]
    fn compress(self, values: &[u32; LANES], mut mask: Mask) -> [u32; LANES] {
        let mut compressed = [0; LANES];
        for value in &mut compressed {
            if mask == NO_LANES {
                break;
            }
            *value = values[first_lane(mask)];
            mask = without_first(mask);
        }
        compressed
    }

    type Wide = F16;

    #[inline(always)]
    fn wide_load(self, values: &F16) -> F16 {
        *values
    }

    #[inline(always)]
    fn wide_store(self, vector: F16) -> F16 {
        vector
    }

    #[inline(always)]
    fn wide_splat(self, value: f32) -> F16 {
        F16([value; WIDE])
    }

    #[inline(always)]
    fn wide_add(self, a: F16, b: F16) -> F16 {
        wide_zip(a, b, |a, b| a + b)
    }

    #[inline(always)]
    fn wide_sub(self, a: F16, b: F16) -> F16 {
        wide_zip(a, b, |a, b| a - b)
    }

    #[inline(always)]
    fn wide_mul(self, a: F16, b: F16) -> F16 {
        wide_zip(a, b, |a, b| a * b)
    }

    #[inline(always)]
    fn wide_div(self, a: F16, b: F16) -> F16 {
        wide_zip(a, b, |a, b| a / b)
    }

    #[inline(always)]
    fn wide_abs(self, a: F16) -> F16 {
        F16(a.0.map(f32::abs))
    }

    #[inline(always)]
    fn wide_about_mul_add(self, a: F16, b: F16, c: F16) -> F16 {
        self.wide_add(self.wide_mul(a, b), c)
    }

    #[inline(always)]
    fn wide_max_or(self, a: F16, b: F16) -> F16 {
        wide_zip(a, b, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn wide_min_or(self, a: F16, b: F16) -> F16 {
        wide_zip(a, b, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn wide_at_most(self, a: F16, b: F16) -> Mask {
        wide_mask(a, b, |a, b| a <= b)
    }

    #[inline(always)]
    fn wide_below(self, a: F16, b: F16) -> Mask {
        wide_mask(a, b, |a, b| a < b)
    }

    #[inline(always)]
    fn wide_select(self, mask: Mask, a: F16, b: F16) -> F16 {
        let mut result = b.0;
        for (lane, value) in result.iter_mut().enumerate() {
            *value = if mask >> lane & 1 == 1 { a.0[lane] } else { *value };
        }
        F16(result)
    }

    #[inline(always)]
    fn wide_least(self, a: F16) -> f32 {
        a.0.into_iter().fold(f32::INFINITY, |least, a| if a < least { a } else { least })
    }

    #[inline(always)]
    fn wide_most(self, a: F16) -> f32 {
        a.0.into_iter().fold(f32::NEG_INFINITY, |most, a| if a > most { a } else { most })
    }

    #[inline(always)]
    fn wide_plane(self, normal: DVec3, corner: DVec3, origin: [F16; 3], direction: [F16; 3]) -> F16 {
        let mut result = [0.0; WIDE];
        for (lane, value) in result.iter_mut().enumerate() {
            let at = |values: &[F16; 3]| {
                DVec3::new(values[0].0[lane].into(), values[1].0[lane].into(), values[2].0[lane].into())
            };
            *value = (normal.dot(corner - at(&origin)) / normal.dot(at(&direction))) as f32;
        }
        F16(result)
    }

    #[inline(always)]
    fn prefetch<T>(self, _: &T) {}
}

#[inline(always)]
fn wide_zip(a: F16, b: F16, operation: impl Fn(f32, f32) -> f32) -> F16 {
    let mut result = a.0;
    for (lane, value) in result.iter_mut().enumerate() {
        *value = operation(a.0[lane], b.0[lane]);
    }
    F16(result)
}

#[inline(always)]
fn wide_mask(a: F16, b: F16, comparison: impl Fn(f32, f32) -> bool) -> Mask {
    let mut mask = NO_LANES;
    for lane in 0..WIDE {
        mask |= Mask::from(comparison(a.0[lane], b.0[lane])) << lane;
    }
    mask
}
