//! Low-discrepancy points, and the random bits that scramble them.

use glam::{DVec2, DVec3};
use std::f64::consts::TAU;

/// The use of a sequence of points; each use in a pixel has random numbers of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Purpose {
    /// Places in the pixel for camera rays.
    Pixel = 1,
    /// Occlusion directions, the first batch of a point.
    OcclusionA = 2,
    /// Occlusion directions, the second batch.
    OcclusionB = 3,
    /// Directions to the disc of a light.
    Disc = 4,
    /// Microfacets of rough glass.
    Facet = 5,
    /// Wavelengths.
    Wavelength = 6,
}

/// A bijection of 64 bits whose result looks random: the finaliser of SplitMix64 (Steele, Lea and Flood, "Fast splittable pseudorandom
/// number generators", OOPSLA 2014).
pub(super) fn mix(value: u64) -> u64 {
    let value = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let value = (value ^ (value >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let value = (value ^ (value >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    value ^ (value >> 31)
}

/// The key of a branch of a path, from the path's key and the number of the branch.
pub(super) fn branch(key: u64, way: u64) -> u64 {
    mix(key ^ (way + 1))
}

/// A (0, 2)-sequence in base 2: van der Corput's sequence and the second dimension of Sobol's. Random bits are XORed to
/// the digits (Kollig and Keller, "Efficient Multidimensional Sampling", Computer Graphics Forum 21(3), 2002), so that
/// each single point is uniform.
#[derive(Debug, Clone, Copy)]
pub(super) struct Points([u32; 2]);

impl Points {
    /// The points for a key and a purpose.
    pub fn new(key: u64, purpose: Purpose) -> Self {
        let bits = mix(key ^ mix(purpose as u64));
        Self([(bits >> 32) as u32, bits as u32])
    }

    /// The point with this index, in 0..1 along both axes.
    pub fn at(self, index: u32) -> DVec2 {
        let Self([shift_x, shift_y]) = self;
        let (mut bits, mut direction, mut rest) = (0_u32, 1_u32 << 31, index);
        while rest != 0 {
            if rest & 1 == 1 {
                bits ^= direction;
            }
            rest >>= 1;
            direction ^= direction >> 1;
        }
        let unit = |bits: u32| (f64::from(bits) + 0.5) / 4_294_967_296.0;
        DVec2::new(unit(index.reverse_bits() ^ shift_x), unit(bits ^ shift_y))
    }
}

/// A random point of the unit square. Points of different numbers, keys or purposes are independent.
pub(super) fn random(key: u64, purpose: Purpose, number: u32) -> DVec2 {
    let bits = mix(mix(key ^ mix(purpose as u64)) ^ u64::from(number));
    DVec2::new((bits >> 32) as f64 + 0.5, (bits & 0xffff_ffff) as f64 + 0.5) / 4_294_967_296.0
}

/// A cosine-distributed direction around a unit vector, from a uniform point of the unit square: the point of the
/// hemisphere above a uniform point of the unit disk (Malley's method).
pub(super) fn cosine_direction(point: DVec2, normal: DVec3) -> DVec3 {
    let (tangent, bitangent) = normal.any_orthonormal_pair();
    let (sin, cos) = (TAU * point.y).sin_cos();
    let radius = point.x.sqrt();
    tangent * (radius * cos) + bitangent * (radius * sin) + normal * (1.0 - point.x).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_box_of_an_equal_share_has_one_point_whatever_the_shift() {
        for key in 0..50 {
            let points = Points::new(key, Purpose::Pixel);
            for digits in 0..=5_u32 {
                let (columns, rows) = (1_u32 << digits, 32 >> digits);
                let mut seen = [false; 32];
                for index in 32..64 {
                    let point = points.at(index);
                    let (x, y) = ((point.x * f64::from(columns)) as u32, (point.y * f64::from(rows)) as u32);
                    assert!(!std::mem::replace(&mut seen[(y * columns + x) as usize], true), "{key} {index}");
                }
            }
        }
    }

    #[test]
    fn purposes_and_branches_have_other_points() {
        let first = |key, purpose| Points::new(key, purpose).at(0);
        assert_ne!(first(7, Purpose::OcclusionA), first(7, Purpose::OcclusionB));
        assert_ne!(first(branch(7, 0), Purpose::Pixel), first(branch(7, 1), Purpose::Pixel));
    }

    #[test]
    fn directions_have_the_mean_of_their_distribution() {
        let normal = DVec3::new(0.3, -0.8, 0.2).normalize();
        let points = Points::new(3, Purpose::OcclusionA);
        let count = 4096;
        let mean = (0..count).map(|index| cosine_direction(points.at(index), normal)).sum::<DVec3>() / f64::from(count);
        // The mean of a cosine-distributed direction is two thirds of its axis.
        assert!((mean - normal * (2.0 / 3.0)).length() < 1e-3, "{mean}");
    }
}
