//! Eight numbers at a time, written so that LLVM turns each operation into one vector instruction.
//!
//! Nothing here is fused or reassociated, so every instruction set gives the same bits.

use std::ops::{Add, Mul, Sub};

/// Triangles in a block and children of a node.
pub(super) const LANES: usize = 8;

/// Eight floats.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(32))]
pub(super) struct F8(pub(super) [f32; LANES]);

/// One byte a lane, lane 0 lowest; a byte is 1 where the condition holds.
pub(super) type Mask = u64;

/// A mask without lanes.
pub(super) const NO_LANES: Mask = 0;

/// The lowest lane of a mask that is not empty.
#[inline(always)]
pub(super) fn first_lane(mask: Mask) -> usize {
    (mask.trailing_zeros() >> 3) as usize & (LANES - 1)
}

/// The mask without its lowest lane.
#[inline(always)]
pub(super) fn without_first(mask: Mask) -> Mask {
    mask & mask.wrapping_sub(1)
}

/// The mask of a condition per lane.
#[inline(always)]
pub(super) fn mask(condition: impl Fn(usize) -> bool) -> Mask {
    let mut bytes = [0_u8; LANES];
    for (lane, byte) in bytes.iter_mut().enumerate() {
        *byte = u8::from(condition(lane));
    }
    u64::from_le_bytes(bytes)
}

impl F8 {
    /// The same number in every lane.
    #[inline(always)]
    pub(super) fn splat(value: f32) -> Self {
        Self([value; LANES])
    }

    #[inline(always)]
    fn zip(self, other: Self, operation: impl Fn(f32, f32) -> f32) -> Self {
        let mut result = self.0;
        for (lane, value) in result.iter_mut().enumerate() {
            *value = operation(self.0[lane], other.0[lane]);
        }
        Self(result)
    }

    /// The larger number; `other` where either is NaN (the semantics of the x86 instruction).
    #[inline(always)]
    pub(super) fn max_or(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }

    /// The smaller number; `other` where either is NaN (the semantics of the x86 instruction).
    #[inline(always)]
    pub(super) fn min_or(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { a } else { b })
    }

    /// Where `self <= other`; false where either is NaN.
    #[inline(always)]
    pub(super) fn at_most(self, other: Self) -> Mask {
        mask(|lane| self.0[lane] <= other.0[lane])
    }
}

impl Add for F8 {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
}

impl Sub for F8 {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
}

impl Mul for F8 {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
}
