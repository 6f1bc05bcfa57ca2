//! The instruction set of every processor: plain loops over arrays, which the compiler may turn into vectors.

use super::vector::{F8, F16, LANES, Mask, NO_LANES, Simd, WIDE, first_lane, without_first};
use glam::DVec3;

/// Plain loops over arrays.
///
/// The operations are `inline`, not `inline(always)`: the compiler then unrolls each loop once, before it is inlined, and not at every call. That
/// takes a quarter of this crate's compile time away, with the same bits and the same speed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plain;

#[inline]
fn zip(a: F8, b: F8, operation: impl Fn(f32, f32) -> f32) -> F8 {
    let mut result = a.0;
    for (lane, value) in result.iter_mut().enumerate() {
        *value = operation(a.0[lane], b.0[lane]);
    }
    F8(result)
}

impl Simd for Plain {
    type Vector = F8;

    #[inline]
    fn load(self, values: &F8) -> F8 {
        *values
    }

    #[inline]
    fn store(self, vector: F8) -> F8 {
        vector
    }

    #[inline]
    fn splat(self, value: f32) -> F8 {
        F8([value; LANES])
    }

    #[inline]
    fn add(self, a: F8, b: F8) -> F8 {
        zip(a, b, |a, b| a + b)
    }

    #[inline]
    fn sub(self, a: F8, b: F8) -> F8 {
        zip(a, b, |a, b| a - b)
    }

    #[inline]
    fn about_mul_add(self, a: F8, b: F8, c: F8) -> F8 {
        let product = self.mul(a, b);
        zip(product, c, |product, c| product + c)
    }

    #[inline]
    fn mul(self, a: F8, b: F8) -> F8 {
        zip(a, b, |a, b| a * b)
    }

    #[inline]
    fn max_or(self, a: F8, b: F8) -> F8 {
        zip(a, b, |a, b| if a > b { a } else { b })
    }

    #[inline]
    fn min_or(self, a: F8, b: F8) -> F8 {
        zip(a, b, |a, b| if a < b { a } else { b })
    }

    #[inline]
    fn at_most(self, a: F8, b: F8) -> Mask {
        let mut mask = NO_LANES;
        for lane in 0..LANES {
            mask |= Mask::from(a.0[lane] <= b.0[lane]) << lane;
        }
        mask
    }

    #[inline]
    fn negative(self, values: &[u32; LANES]) -> Mask {
        let mut mask = NO_LANES;
        for (lane, value) in values.iter().enumerate() {
            mask |= (value >> 31) << lane;
        }
        mask
    }

    #[inline]
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

    #[inline]
    fn wide_load(self, values: &F16) -> F16 {
        *values
    }

    #[inline]
    fn wide_store(self, vector: F16) -> F16 {
        vector
    }

    #[inline]
    fn wide_splat(self, value: f32) -> F16 {
        F16([value; WIDE])
    }

    #[inline]
    fn wide_add(self, a: F16, b: F16) -> F16 {
        wide_zip(a, b, |a, b| a + b)
    }

    #[inline]
    fn wide_sub(self, a: F16, b: F16) -> F16 {
        wide_zip(a, b, |a, b| a - b)
    }

    #[inline]
    fn wide_mul(self, a: F16, b: F16) -> F16 {
        wide_zip(a, b, |a, b| a * b)
    }

    #[inline]
    fn wide_div(self, a: F16, b: F16) -> F16 {
        wide_zip(a, b, |a, b| a / b)
    }

    #[inline]
    fn wide_abs(self, a: F16) -> F16 {
        F16(a.0.map(f32::abs))
    }

    #[inline]
    fn wide_about_mul_add(self, a: F16, b: F16, c: F16) -> F16 {
        self.wide_add(self.wide_mul(a, b), c)
    }

    #[inline]
    fn wide_max_or(self, a: F16, b: F16) -> F16 {
        wide_zip(a, b, |a, b| if a > b { a } else { b })
    }

    #[inline]
    fn wide_min_or(self, a: F16, b: F16) -> F16 {
        wide_zip(a, b, |a, b| if a < b { a } else { b })
    }

    #[inline]
    fn wide_at_most(self, a: F16, b: F16) -> Mask {
        wide_mask(a, b, |a, b| a <= b)
    }

    #[inline]
    fn wide_below(self, a: F16, b: F16) -> Mask {
        wide_mask(a, b, |a, b| a < b)
    }

    #[inline]
    fn wide_select(self, mask: Mask, a: F16, b: F16) -> F16 {
        let mut result = b.0;
        for (lane, value) in result.iter_mut().enumerate() {
            *value = if mask >> lane & 1 == 1 { a.0[lane] } else { *value };
        }
        F16(result)
    }

    #[inline]
    fn wide_least(self, a: F16) -> f32 {
        a.0.into_iter().fold(f32::INFINITY, |least, a| if a < least { a } else { least })
    }

    #[inline]
    fn wide_most(self, a: F16) -> f32 {
        a.0.into_iter().fold(f32::NEG_INFINITY, |most, a| if a > most { a } else { most })
    }

    #[inline]
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

    #[inline]
    fn prefetch<T>(self, _: &T) {}
}

#[inline]
fn wide_zip(a: F16, b: F16, operation: impl Fn(f32, f32) -> f32) -> F16 {
    let mut result = a.0;
    for (lane, value) in result.iter_mut().enumerate() {
        *value = operation(a.0[lane], b.0[lane]);
    }
    F16(result)
}

#[inline]
fn wide_mask(a: F16, b: F16, comparison: impl Fn(f32, f32) -> bool) -> Mask {
    let mut mask = NO_LANES;
    for lane in 0..WIDE {
        mask |= Mask::from(comparison(a.0[lane], b.0[lane])) << lane;
    }
    mask
}
