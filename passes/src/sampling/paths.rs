//! Points of the unit square for paths: a pair of numbers for each choice that a path makes.
//!
//! Every choice has its own Sobol sequence, Owen-scrambled and with a shuffled order, which comes from scrambling the index. So the points
//! that one index gives for different choices are uncorrelated, and the first 2^k points of each sequence remain a net (Burley 2020,
//! "Practical Hash-based Owen Scrambling", JCGT 9(4), section 4).

use super::hash::{self, unit};
use super::owen_sobol::{laine_karras, reversed_sobol, scramble_reversed};
use glam::Vec2;

/// A choice of a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Where the path starts in the pixel.
    Film,
    /// Where it starts on the lens.
    Lens,
    /// Which point of the light is sampled after that many bounces.
    Light(u32),
    /// The direction in which it continues after that many bounces.
    Bounce(u32),
}

impl Place {
    fn number(self) -> u32 {
        match self {
            Self::Film => 0,
            Self::Lens => 1,
            Self::Light(bounce) => 2 + 2 * bounce,
            Self::Bounce(bounce) => 3 + 2 * bounce,
        }
    }
}

/// The points of one path of a pixel.
#[derive(Debug, Clone, Copy)]
pub struct Points {
    key: u32,
    index: u32,
}

impl Points {
    /// The points of path `index` of the pixel with this key.
    #[must_use]
    pub fn new(key: u32, index: u32) -> Self {
        Self { key, index }
    }

    /// The point of a choice, in [0, 1)².
    #[must_use]
    pub fn at(&self, place: Place) -> Vec2 {
        let counter = hash::PATHS - 2 * place.number();
        let seeds = hash::dimensions(self.key, counter);
        let [order, _] = hash::dimensions(self.key, counter - 1);
        let index = laine_karras(self.index.reverse_bits(), order).reverse_bits();
        let point = reversed_sobol(index);
        let [x, y] = [0, 1].map(|d| unit(scramble_reversed(point[d], seeds[d])));
        Vec2::new(x, y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_points_of_a_choice_are_a_net_and_choices_are_independent() {
        for key in 0..50 {
            for place in [Place::Film, Place::Light(3), Place::Bounce(0)] {
                // 16 points: one in each of the 16 boxes of any shape with area 1/16.
                for [across, down] in [[16, 1], [8, 2], [4, 4], [2, 8], [1, 16]] {
                    let mut seen = [0; 16];
                    for index in 0..16 {
                        let at = Points::new(key, index).at(place);
                        let (x, y) = ((at.x * across as f32) as usize, (at.y * down as f32) as usize);
                        seen[y * across + x] += 1;
                    }
                    assert_eq!(seen, [1; 16], "{key} {place:?} {across} x {down}");
                }
            }
        }
        // For two choices of the same paths, the mean of the product is that of independent numbers, 1/4. Without a shuffled order for each
        // choice it would be near 1/3 or 1/6 for many keys.
        let mut worst = 0.0_f64;
        for key in 0..50 {
            let product = |index| {
                let points = Points::new(key, index);
                f64::from(points.at(Place::Film).x) * f64::from(points.at(Place::Bounce(0)).x)
            };
            let mean = (0..1024).map(product).sum::<f64>() / 1024.0;
            worst = worst.max((mean - 0.25).abs());
        }
        assert!(worst < 0.02, "{worst}");
    }
}
