//! Vectors of eight and sixteen numbers. Except in [`Simd::about_mul_add`] and [`Simd::wide_about_mul_add`] nothing is fused or
//! reassociated, so every instruction set gives the same bits.

use glam::{DVec3, Vec3};

/// Lanes of a vector: triangles in a leaf, and children of a node.
pub(crate) const LANES: usize = 8;

/// Eight floats in memory.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(32))]
pub(crate) struct F8(pub(crate) [f32; LANES]);

/// Lanes of a wide vector.
pub(crate) const WIDE: usize = 2 * LANES;

/// Sixteen floats in memory.
#[derive(Debug, Clone, Copy, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(64))]
pub(crate) struct F16(pub(crate) [f32; WIDE]);

/// The three-dimensional vector in one lane of sixteen such vectors, which are stored by axis.
#[inline(always)]
pub(crate) fn vector_at(axes: &[F16; 3], lane: usize) -> Vec3 {
    Vec3::new(axes[0].0[lane], axes[1].0[lane], axes[2].0[lane])
}

impl F16 {
    pub(crate) const ZERO: Self = Self([0.0; WIDE]);
}

/// [`Simd::gather`], one value after the other.
pub(crate) fn gather_each<const N: usize, const K: usize>(values: &[[f32; N]], indices: &[u32; WIDE]) -> [F16; K] {
    let mut gathered = [F16::ZERO; K];
    for (lane, &index) in indices.iter().enumerate() {
        for (axis, gathered) in gathered.iter_mut().enumerate() {
            gathered.0[lane] = values[index as usize][axis];
        }
    }
    gathered
}

/// One bit a lane, lane 0 lowest.
pub(crate) type Mask = u32;

/// The empty mask.
pub(crate) const NO_LANES: Mask = 0;

/// The lowest lane of a mask that is not empty.
#[inline(always)]
pub(crate) fn first_lane(mask: Mask) -> usize {
    mask.trailing_zeros() as usize & (LANES - 1)
}

/// The lowest lane of sixteen, of a mask that is not empty.
#[inline(always)]
pub(crate) fn first_wide_lane(mask: Mask) -> usize {
    mask.trailing_zeros() as usize & (WIDE - 1)
}

/// The mask without its lowest lane.
#[inline(always)]
pub(crate) fn without_first(mask: Mask) -> Mask {
    mask & mask.wrapping_sub(1)
}

/// The lower of two numbers, in one instruction; `f32::min` takes more, because of NaN.
#[inline(always)]
pub(crate) fn lower(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The higher of two numbers.
#[inline(always)]
pub(crate) fn higher(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Eight floats in registers, and what an instruction set does with them.
///
/// A value of the implementing type is the proof that the processor has the instruction set. Functions that use it are `#[inline(always)]`,
/// up to the function that is compiled for the instruction set. They pass no vector to a closure: a closure is compiled for the instruction
/// set only where it is inlined.
pub(crate) trait Simd: Copy {
    type Vector: Copy;
    fn load(self, values: &F8) -> Self::Vector;
    fn store(self, vector: Self::Vector) -> F8;
    fn splat(self, value: f32) -> Self::Vector;
    fn add(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    fn sub(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// `a * b + c`, fused where the processor can. Only for estimates with an error bound, since the bits differ between instruction sets.
    fn about_mul_add(self, a: Self::Vector, b: Self::Vector, c: Self::Vector) -> Self::Vector;
    fn mul(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// `a > b ? a : b`: `b` where either is NaN.
    fn max_or(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// `a < b ? a : b`: `b` where either is NaN.
    fn min_or(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// The lanes with `a <= b`; false where either is NaN.
    fn at_most(self, a: Self::Vector, b: Self::Vector) -> Mask;

    /// The lanes whose top bit is set.
    fn negative(self, values: &[u32; LANES]) -> Mask;
    /// Moves the numbers in the lanes of a mask to the front; the lanes behind them have no meaning.
    fn compress(self, values: &[u32; LANES], mask: Mask) -> [u32; LANES];

    /// Sixteen floats in registers.
    type Wide: Copy;
    fn wide_load(self, values: &F16) -> Self::Wide;
    fn wide_store(self, vector: Self::Wide) -> F16;
    fn wide_splat(self, value: f32) -> Self::Wide;
    fn wide_add(self, a: Self::Wide, b: Self::Wide) -> Self::Wide;
    fn wide_sub(self, a: Self::Wide, b: Self::Wide) -> Self::Wide;
    fn wide_mul(self, a: Self::Wide, b: Self::Wide) -> Self::Wide;
    fn wide_div(self, a: Self::Wide, b: Self::Wide) -> Self::Wide;
    fn wide_abs(self, a: Self::Wide) -> Self::Wide;
    /// As [`Self::about_mul_add`].
    fn wide_about_mul_add(self, a: Self::Wide, b: Self::Wide, c: Self::Wide) -> Self::Wide;
    /// As [`Self::max_or`].
    fn wide_max_or(self, a: Self::Wide, b: Self::Wide) -> Self::Wide;
    /// As [`Self::min_or`].
    fn wide_min_or(self, a: Self::Wide, b: Self::Wide) -> Self::Wide;
    /// As [`Self::at_most`].
    fn wide_at_most(self, a: Self::Wide, b: Self::Wide) -> Mask;
    /// The lanes with `a < b`; false where either is NaN.
    fn wide_below(self, a: Self::Wide, b: Self::Wide) -> Mask;
    /// `a` in the lanes of the mask, `b` in the others.
    fn wide_select(self, mask: Mask, a: Self::Wide, b: Self::Wide) -> Self::Wide;
    /// The least of sixteen numbers.
    fn wide_least(self, a: Self::Wide) -> f32;
    /// The greatest of sixteen numbers.
    fn wide_most(self, a: Self::Wide) -> f32;
    /// `normal · (corner - origin) / normal · direction` in `f64`, summed from x to z, then rounded to `f32`.
    fn wide_plane(
        self,
        normal: DVec3,
        corner: DVec3,
        origin: [Self::Wide; 3],
        direction: [Self::Wide; 3],
    ) -> Self::Wide;
    /// Gathers the values at sixteen indices, and returns the first `K` (three or four) of their `N` numbers, as one vector each. Numbers
    /// are moved as bits.
    ///
    /// # Panics
    /// If there is no such value.
    fn gather<const N: usize, const K: usize>(self, values: &[[f32; N]], indices: &[u32; WIDE]) -> [F16; K] {
        gather_each(values, indices)
    }

    /// Transposes sixteen values of four numbers: from rows of four values each to one vector a component. Numbers are moved as bits.
    #[inline(always)]
    fn columns(self, rows: [&[[f32; 4]; 4]; 4]) -> [F16; 4] {
        let mut columns = [F16::ZERO; 4];
        for (lane, value) in rows.into_iter().flatten().enumerate() {
            for (column, component) in columns.iter_mut().zip(value) {
                column.0[lane] = *component;
            }
        }
        columns
    }

    /// Joins four arrays of four numbers. After four separate copies, a vector load of the whole result would stall.
    #[inline(always)]
    fn quarters(self, quarters: [&[u32; 4]; 4]) -> [u32; WIDE] {
        let mut joined = [0; WIDE];
        for (part, quarter) in joined.as_chunks_mut().0.iter_mut().zip(quarters) {
            *part = *quarter;
        }
        joined
    }

    /// The lanes that hold `value`.
    #[inline(always)]
    fn wide_equal(self, values: &[u32; WIDE], value: u32) -> Mask {
        let mut mask = NO_LANES;
        for (lane, other) in values.iter().enumerate() {
            mask |= Mask::from(*other == value) << lane;
        }
        mask
    }

    /// Prefetches the memory of a value. This changes only the time that reading it takes.
    fn prefetch<T>(self, value: &T);
}

/// Work that is compiled for several instruction sets; `run` must be `#[inline(always)]`.
pub(crate) trait Kernel<T> {
    fn run<S: Simd>(self, simd: S) -> T;
}

/// Loads three vectors, one an axis.
#[inline(always)]
pub(crate) fn load_axes<S: Simd>(simd: S, [x, y, z]: &[F16; 3]) -> [S::Wide; 3] {
    [simd.wide_load(x), simd.wide_load(y), simd.wide_load(z)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::simd::{Detected, InstructionSet};

    struct Moves;

    impl Kernel<([F16; 4], [u32; WIDE], [Mask; 3])> for Moves {
        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> ([F16; 4], [u32; WIDE], [Mask; 3]) {
            let rows =
                [0, 1, 2, 3].map(|row| [0, 1, 2, 3].map(|x| [0, 1, 2, 3].map(|w| (100 * row + 10 * x + w) as f32)));
            let quarters = [[9, 8, 7, 6], [u32::MAX, 1, 2, 3], [9, 9, 0, 1 << 31], [4, 5, 6, 7]];
            let joined = simd.quarters(quarters.each_ref());
            let equal = [9, u32::MAX, 0].map(|value| simd.wide_equal(&joined, value));
            (simd.columns(rows.each_ref()), joined, equal)
        }
    }

    struct Compress([u32; LANES], Mask);

    impl Kernel<[u32; LANES]> for Compress {
        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> [u32; LANES] {
            simd.compress(&self.0, self.1)
        }
    }

    #[test]
    fn lanes_of_every_mask_move_to_the_front() {
        let values = [70, 61, 52, 43, 34, 25, 16, u32::MAX];
        for simd in [InstructionSet::Avx512, InstructionSet::Avx2, InstructionSet::Portable]
            .into_iter()
            .filter_map(Detected::new)
        {
            for mask in 0..1 << LANES {
                let chosen: Vec<u32> =
                    (0..LANES).filter(|lane| mask >> lane & 1 == 1).map(|lane| values[lane]).collect();
                let compressed = simd.run(Compress(values, mask));
                assert_eq!(compressed[..chosen.len()], chosen, "{simd:?} {mask:08b}");
            }
        }
    }

    #[test]
    fn values_are_moved_to_where_they_belong() {
        for simd in [InstructionSet::Avx512, InstructionSet::Avx2, InstructionSet::Portable]
            .into_iter()
            .filter_map(Detected::new)
        {
            let (columns, joined, equal) = simd.run(Moves);
            for (component, column) in columns.iter().enumerate() {
                let expected: [usize; WIDE] =
                    std::array::from_fn(|lane| 100 * (lane / 4) + 10 * (lane % 4) + component);
                assert_eq!(column.0, expected.map(|value| value as f32), "{simd:?}");
            }
            assert_eq!(joined, [9, 8, 7, 6, u32::MAX, 1, 2, 3, 9, 9, 0, 1 << 31, 4, 5, 6, 7]);
            assert_eq!(equal, [0b11_0000_0001, 1 << 4, 1 << 10], "{simd:?}");
        }
    }
}
