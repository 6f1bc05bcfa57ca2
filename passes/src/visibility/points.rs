//! Points of the four-dimensional unit cube: two coordinates for each triangle of a pair.
//!
//! The integral over a pair has four dimensions. One two-dimensional point used for both triangles converges to a wrong value: 6.5 % off
//! for two parallel right triangles at a distance of 1.

use super::Sampler;
use crate::sampling::hash::pcg4d;
use crate::sampling::owen_sobol::{laine_karras, reversed_sobol};

/// Number of independent point sets of a pair; their spread gives the error.
pub const REPLICATES: usize = 8;

/// Last word of the input of the hashes here: it separates them from the hashes of pixels, paths and dimensions.
const PAIR: u32 = 3;

/// The unscrambled points of one replicate, by dimension.
#[derive(Debug, Clone)]
pub(super) struct Table {
    sampler: Sampler,
    /// Sobol: coordinates with reversed bits. Hammersley: the index (its coordinate depends on the number of points), then the radical
    /// inverses in bases 2, 3 and 5 in 32 bits.
    words: [Vec<u32>; 4],
}

impl Table {
    /// A table of at least `points` points.
    pub(super) fn new(sampler: Sampler, points: u32) -> Self {
        // Points are read in blocks of eight.
        let points = points.next_multiple_of(8);
        let mut words = [const { Vec::new() }; 4];
        for index in 0..points {
            let point = match sampler {
                Sampler::Sobol => sobol(index),
                Sampler::Hammersley => [index, inverse(index, 2), inverse(index, 3), inverse(index, 5)],
            };
            for (words, word) in words.iter_mut().zip(point) {
                words.push(word);
            }
        }
        Self { sampler, words }
    }

    /// Coordinate `dimension`, in (0, 1), of the eight points from `first` on, in a set of `points` points.
    #[inline(always)]
    pub(super) fn eight(&self, dimension: usize, first: usize, points: u32, seed: u32) -> [f64; 8] {
        const STEP: f64 = 1.0 / 4_294_967_296.0;
        let words = &self.words[dimension][first..first + 8];
        let mut values = [0.0; 8];
        match self.sampler {
            Sampler::Sobol => {
                for (value, word) in values.iter_mut().zip(words) {
                    *value = (f64::from(laine_karras(*word, seed).reverse_bits()) + 0.5) * STEP;
                }
            }
            Sampler::Hammersley => {
                let scale = if dimension == 0 { 4_294_967_296.0 / f64::from(points) } else { 1.0 };
                for (value, word) in values.iter_mut().zip(words) {
                    // Cranley-Patterson rotation: adds a random offset modulo 1, which wraps around as the word does.
                    let turned = ((f64::from(*word) * scale) as u32).wrapping_add(seed);
                    *value = (f64::from(turned) + 0.5) * STEP;
                }
            }
        }
        values
    }
}

/// The seeds of a replicate, one a dimension.
#[inline(always)]
pub(super) fn seeds([low, high]: [u32; 2], seed: u32, replicate: u32) -> [u32; 4] {
    let first = pcg4d([low, high, seed, PAIR]);
    pcg4d([first[0], first[1], first[2] ^ replicate, first[3].wrapping_add(replicate)])
}

/// A hash of the bits of a triangle's corners. It chooses the triangle's points, which therefore do not depend on its id.
pub(super) fn key(corners: &[[u32; 3]; 3]) -> [u32; 2] {
    let [a, b, c] = corners;
    let first = pcg4d([a[0], a[1], a[2], PAIR]);
    let second = pcg4d([b[0] ^ first[0], b[1] ^ first[1], b[2] ^ first[2], first[3]]);
    let third = pcg4d([c[0] ^ second[0], c[1] ^ second[1], c[2] ^ second[2], second[3]]);
    [third[2], third[3]]
}

/// The first four dimensions of the Sobol sequence, bits reversed: the two of the occlusion sampler, and dimensions 3 and 4 with the
/// direction numbers of Joe and Kuo 2008, "Constructing Sobol Sequences with Better Two-Dimensional Projections".
fn sobol(index: u32) -> [u32; 4] {
    let [x, y] = reversed_sobol(index);
    // Primitive polynomials and initial numbers: x² + x + 1 with 1, 3; x³ + x + 1 with 1, 3, 1.
    let (mut third, mut fourth) = ([1_u64, 3, 0], [1_u64, 3, 1]);
    let (mut z, mut w) = (0, 0);
    for digit in 0..32 {
        if index >> digit & 1 == 1 {
            z ^= ((third[0] << (31 - digit)) as u32).reverse_bits();
            w ^= ((fourth[0] << (31 - digit)) as u32).reverse_bits();
        }
        let next = third[1] << 1 ^ third[0] << 2 ^ third[0];
        third = [third[1], next, 0];
        let next = fourth[1] << 2 ^ fourth[0] << 3 ^ fourth[0];
        fourth = [fourth[1], fourth[2], next];
    }
    [x, y, z, w]
}

/// The radical inverse of `index` in units of 2⁻³²: its digits in base `base`, mirrored at the radix point.
fn inverse(mut index: u32, base: u32) -> u32 {
    let (mut value, mut place) = (0.0, 1.0 / f64::from(base));
    while index > 0 {
        value += f64::from(index % base) * place;
        index /= base;
        place /= f64::from(base);
    }
    (value * 4_294_967_296.0) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `digits` gives k for each dimension: boxes with sides 2^-k, as many as points. Returns how many of them do not hold exactly one
    /// point.
    fn misplaced(points: &[[f64; 4]], digits: [u32; 4]) -> usize {
        let mut cells = vec![0_u32; points.len()];
        for point in points {
            let mut cell = 0;
            for (value, digits) in point.iter().zip(digits) {
                cell = cell << digits | (value * f64::from(1_u32 << digits)) as usize;
            }
            cells[cell] += 1;
        }
        cells.iter().filter(|count| **count != 1).count()
    }

    fn points(table: &Table, count: usize, seeds: [u32; 4]) -> Vec<[f64; 4]> {
        let mut points = Vec::new();
        for first in (0..count).step_by(8) {
            let axes = [0, 1, 2, 3].map(|d| table.eight(d, first, count as u32, seeds[d]));
            points.extend((0..8).map(|lane| axes.map(|axis| axis[lane])));
        }
        points
    }

    #[test]
    fn scrambled_points_fill_the_boxes_of_every_pair_of_dimensions_as_joe_and_kuo_say() {
        let table = Table::new(Sampler::Sobol, 256);
        for replicate in 0..20 {
            let points = points(&table, 256, seeds([7, 9], 1, replicate));
            for dimension in 0..4 {
                let mut digits = [0; 4];
                digits[dimension] = 8;
                assert_eq!(misplaced(&points, digits), 0, "dimension {dimension}");
            }
            // Dimensions 1 and 2 have the quality parameter t = 0: one point in each box of 1/16 by 1/16.
            assert_eq!(misplaced(&points, [4, 4, 0, 0]), 0);
            // All four dimensions together have t = 3: each box of volume 2^-5 holds eight of 256 points.
            let mut cells = [0; 32];
            for p in &points {
                let at = |value: f64, digits: u32| (value * f64::from(1_u32 << digits)) as usize;
                cells[at(p[0], 1) * 16 + at(p[1], 1) * 8 + at(p[2], 1) * 4 + at(p[3], 2)] += 1;
            }
            assert_eq!(cells, [8; 32]);
            assert!(points.iter().flatten().all(|value| *value > 0.0 && *value < 1.0));
        }
    }

    #[test]
    fn the_third_and_fourth_dimension_are_the_published_ones() {
        let value = |index: u32, dimension: usize| f64::from(sobol(index)[dimension].reverse_bits()) / 4_294_967_296.0;
        // Points 1 to 7 of the sequence in digit order (not Gray code), computed by hand from the direction numbers 1/2, 3/4, 3/8 and 1/2,
        // 3/4, 1/8.
        let third: Vec<f64> = (1..8).map(|index| value(index, 2)).collect();
        assert_eq!(third, [0.5, 0.75, 0.25, 0.375, 0.875, 0.625, 0.125]);
        let fourth: Vec<f64> = (1..8).map(|index| value(index, 3)).collect();
        assert_eq!(fourth, [0.5, 0.75, 0.25, 0.125, 0.625, 0.875, 0.375]);
    }

    #[test]
    fn hammersley_points_are_rotated_as_a_whole() {
        let table = Table::new(Sampler::Hammersley, 64);
        let (still, turned) = (points(&table, 64, [0; 4]), points(&table, 64, [1 << 30; 4]));
        assert!((still[3][0] - 3.0 / 64.0).abs() < 1e-9 && (still[3][1] - 0.75).abs() < 1e-9);
        assert!((still[5][2] - 7.0 / 9.0).abs() < 1e-9 && (still[5][3] - 1.0 / 25.0).abs() < 1e-9);
        for (a, b) in still.iter().flatten().zip(turned.iter().flatten()) {
            assert!(((a + 0.25).fract() - b).abs() < 1e-9);
        }
    }
}
