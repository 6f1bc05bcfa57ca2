//! Which ways of a path are followed where glass divides it: all that a pass asks for, or those of a sample. A way is one of the continuations of
//! the path from the surface that divides it.

use crate::effects::optics::SCATTERED;
use crate::sampling::hash::{FACET_ORDER, FACETS, HALF, SPECTRUM, dimensions, path_key, unit};
use crate::sampling::owen_sobol::{laine_karras, reversed_sobol, scramble_reversed};
use glam::Vec2;
use std::cell::Cell;
use std::ops::Range;

/// The ways of a path. The programs are compiled for each kind, so that a program that follows all ways does not pay for samples.
pub(in crate::effects) trait Ways: Copy {
    /// Whether the ways are a sample: each way has one wavelength of the spectrum, and not all of them.
    const SAMPLED: bool;

    /// The key of the ways' random numbers, given the pixel's own key.
    fn key(&self, pixel: u32) -> u32;

    /// The numbers of the ways on from rough glass that are followed; `all` is the number that the pass requests.
    fn numbers(&self, all: u32) -> Range<u32>;

    /// The point that chooses the microfacet which a way meets at the surface of this key. `points` are those of the pass. `None` if the way has
    /// no point.
    fn facet(&self, points: &[[u32; 2]], way: u32, key: u32) -> Option<Vec2>;

    /// Which of `count` parts of the spectrum a way has at the surface of this key.
    fn part_of_spectrum(&self, way: u32, key: u32, count: usize) -> usize;

    /// The key of the random numbers that are drawn where a path ends; `way` is the number of the path's way, or `None` if it was not
    /// divided.
    fn own_key(&self, key: u32, way: Option<u32>) -> u32;

    /// Notes a stochastic event of the path.
    fn note(&self, met: Met);
}

/// The bit of [`Met::bits`] for a path where chance decided whether a way was followed.
pub const MET_CHANCE: u8 = 1;
/// The bit of [`Met::bits`] for a path that was divided.
pub const MET_DIVIDED: u8 = 2;

/// The stochastic events of a sample: another sample may differ there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Met {
    /// The path was divided, by rough glass or by glass that disperses light.
    pub divided: bool,
    /// Chance decided whether a way was followed.
    pub chance: bool,
}

impl Met {
    pub(super) const DIVIDED: Self = Self { divided: true, chance: false };
    pub(super) const CHANCE: Self = Self { divided: false, chance: true };

    /// Whether another sample of the pixel may differ.
    #[must_use]
    pub fn stochastic(self) -> bool {
        self.divided || self.chance
    }

    /// The events as bits: [`MET_CHANCE`] and [`MET_DIVIDED`].
    #[must_use]
    pub fn bits(self) -> u8 {
        (u8::from(self.chance) * MET_CHANCE) | (u8::from(self.divided) * MET_DIVIDED)
    }

    /// The inverse of [`Self::bits`].
    #[must_use]
    pub fn of_bits(bits: u8) -> Self {
        Self { divided: bits & MET_DIVIDED != 0, chance: bits & MET_CHANCE != 0 }
    }
}

/// All ways that the pass asks for.
#[derive(Debug, Clone, Copy)]
pub(in crate::effects) struct AllWays;

impl Ways for AllWays {
    const SAMPLED: bool = false;

    #[inline(always)]
    fn key(&self, pixel: u32) -> u32 {
        pixel
    }

    #[inline(always)]
    fn numbers(&self, all: u32) -> Range<u32> {
        0..all
    }

    #[inline(always)]
    fn facet(&self, points: &[[u32; 2]], way: u32, key: u32) -> Option<Vec2> {
        let point = points.get(way as usize)?;
        let seeds = dimensions(key, FACETS);
        let [x, y] = [0, 1].map(|axis| unit(scramble_reversed(point[axis], seeds[axis])));
        Some(Vec2::new(x, y))
    }

    #[inline(always)]
    fn part_of_spectrum(&self, way: u32, _: u32, count: usize) -> usize {
        way as usize % count
    }

    /// The ways on from rough glass share the keys of their surfaces, so that their points fill each other's gaps. Where they end, each
    /// has a key of its own.
    #[inline(always)]
    fn own_key(&self, key: u32, way: Option<u32>) -> u32 {
        way.map_or(key, |way| path_key(key, SCATTERED + way))
    }

    #[inline(always)]
    fn note(&self, _: Met) {}
}

/// Some ways of one of the two halves of a pixel's sample. The colours of both halves are independent.
///
/// Each surface has its own order of the Sobol points as well as its own scrambling (Burley 2020, "Practical Hash-based Owen
/// Scrambling", JCGT 9(4), section 4). With one order for all surfaces, the facets of two surfaces would depend on each other, and the
/// mean over all ways would not be the mean over all pairs of facets.
#[derive(Debug, Clone, Copy)]
pub struct Sample<'m> {
    /// Which half: 0 or 1.
    pub half: u32,
    /// Number of the first way.
    pub first: u32,
    /// Number of ways on from the first surface that divides the path.
    pub ways: u32,
    /// Position of the pixel's way 0 in the sequence.
    pub offset: u32,
    /// The stochastic events that the sample met.
    pub met: &'m Cell<Met>,
}

impl Sample<'_> {
    /// The key of the random numbers of a half, given the pixel's own key.
    #[must_use]
    pub fn key_of_half(pixel: u32, half: u32) -> u32 {
        if half == 0 { pixel } else { path_key(pixel, HALF) }
    }
}

impl Ways for Sample<'_> {
    const SAMPLED: bool = true;

    fn key(&self, pixel: u32) -> u32 {
        Self::key_of_half(pixel, self.half)
    }

    fn numbers(&self, _: u32) -> Range<u32> {
        self.first..self.first + self.ways
    }

    fn facet(&self, _: &[[u32; 2]], way: u32, key: u32) -> Option<Vec2> {
        let [order, _] = dimensions(key, FACET_ORDER);
        let point = reversed_sobol(in_order(self.offset.wrapping_add(way), order));
        let seeds = dimensions(key, FACETS);
        let [x, y] = [0, 1].map(|axis| unit(scramble_reversed(point[axis], seeds[axis])));
        Some(Vec2::new(x, y))
    }

    /// If there are 2^k parts, an aligned block of 2^k ways has one way in each of them.
    fn part_of_spectrum(&self, way: u32, key: u32, count: usize) -> usize {
        let [seed, order] = dimensions(key, SPECTRUM);
        let place = scramble_reversed(in_order(self.offset.wrapping_add(way), order), seed);
        ((u64::from(place) * count as u64) >> 32) as usize
    }

    /// A path that was not divided has another key each time it is followed; the key of the first time is that of [`AllWays`].
    fn own_key(&self, key: u32, way: Option<u32>) -> u32 {
        match way.or((self.first > 0).then_some(self.first)) {
            Some(way) => path_key(key, SCATTERED.wrapping_add(way)),
            None => key,
        }
    }

    fn note(&self, met: Met) {
        let before = self.met.get();
        self.met.set(Met { divided: before.divided | met.divided, chance: before.chance | met.chance });
    }
}

/// A number in a shuffled order, in which each aligned block of 2^k numbers stays a block.
pub(super) fn in_order(number: u32, order: u32) -> u32 {
    laine_karras(number.reverse_bits(), order).reverse_bits()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::hash::pixel_key;

    fn sample(met: &Cell<Met>) -> Sample<'_> {
        Sample { half: 0, first: 0, ways: 1, offset: 0, met }
    }

    #[test]
    fn ways_are_spread_over_the_square_and_over_the_spectrum() {
        let met = Cell::default();
        let sample = sample(&met);
        for key in 0..50 {
            let key = pixel_key(key, 0, 9);
            let mut cells = [0; 16];
            let mut parts = [0; 16];
            for way in 0..16 {
                let at = sample.facet(&[], way, key).expect("it has one");
                cells[(at.y * 4.0) as usize * 4 + (at.x * 4.0) as usize] += 1;
                parts[sample.part_of_spectrum(way, key, 16)] += 1;
            }
            assert_eq!((cells, parts), ([1; 16], [1; 16]), "{key}");
            assert!(
                (0..16)
                    .all(|way| sample.part_of_spectrum(way, key, 3) < 3 && sample.part_of_spectrum(way, key, 1) == 0)
            );
        }
    }

    /// The mean of the product of two surfaces' numbers is that of independent numbers, 1/4. In the control, all surfaces take the points in
    /// one order: for most keys the mean is far from 1/4, however many ways there are.
    #[test]
    fn facets_of_two_surfaces_do_not_depend_on_each_other() {
        let met = Cell::default();
        let sample = sample(&met);
        let points: Vec<[u32; 2]> = (0..1024).map(reversed_sobol).collect();
        let off = |facet: &dyn Fn(u32, u32) -> Option<Vec2>, key: u32| {
            let keys = [path_key(key, 0), path_key(key, 1)];
            let product =
                |way| keys.map(|key| facet(way, key).map_or(0.0, |at| f64::from(at.x))).iter().product::<f64>();
            ((0..1024).map(product).sum::<f64>() / 1024.0 - 0.25).abs()
        };
        let mean = |facet: &dyn Fn(u32, u32) -> Option<Vec2>| (0..50).map(|key| off(facet, key)).sum::<f64>() / 50.0;
        let own_order = mean(&|way, key| sample.facet(&[], way, key));
        let one_order = mean(&|way, key| AllWays.facet(&points, way, key));
        assert!(own_order < 0.003 && one_order > 0.02, "{own_order} {one_order}");
    }
}
