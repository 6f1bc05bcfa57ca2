//! Spectral sampling, for glass with dispersion.
//!
//! Colours stay red, green and blue. The wavelength of a path only selects the index of refraction and the weight of the path's
//! light in each of the three channels. The weights are those of D65, whose colour is white: w(λ) = D65(λ) M x(λ), where x are the
//! CIE 1931 colour-matching functions and M converts XYZ to linear sRGB, each channel divided by its integral. Weights are negative
//! where a spectral colour lies outside sRGB, and in each channel they sum to 1 over all wavelengths. So no sample may be clamped,
//! and light that is not dispersed keeps its colour.

use glam::{DMat3, DVec3, Vec3};

/// A part of the spectrum and its weight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stratum {
    /// Representative wavelength, nanometres.
    pub wavelength: f32,
    /// Weight of its light in red, green and blue: a multiple of 2^-20, so that sums of weights are exact.
    pub weight: Vec3,
}

/// Largest number of strata.
pub const MOST_STRATA: u32 = 256;

/// Ends of the sampled spectrum, nanometres: only 0.002 % of visible light lies beyond.
const ENDS: [f64; 2] = [380.0, 780.0];
/// Steps of the integrals: one per nanometre.
const STEPS: usize = 400;
/// Unit of the weights.
const UNIT: f64 = 1.0 / 1_048_576.0;

/// Relative power of the standard illuminant D65 (ISO/CIE 11664-2) from 380 to 780 nm, every 10 nm.
const D65: [f64; 41] = [
    49.9755, 54.6482, 82.7549, 91.486, 93.4318, 86.6823, 104.865, 117.008, 117.812, 114.861, 115.923, 108.811, 109.354,
    107.802, 104.79, 107.689, 104.405, 104.046, 100.0, 96.3342, 95.788, 88.6856, 90.0062, 89.5991, 87.6987, 83.2886,
    83.6992, 80.0268, 80.2146, 82.2778, 78.2842, 69.7213, 71.6091, 74.349, 61.604, 69.8856, 75.087, 63.5927, 46.4182,
    66.8054, 63.3828,
];

/// CIE 1931 colour-matching functions at a wavelength in nanometres, within about 1 % of their maxima (multi-lobe fit of Wyman,
/// Sloan and Shirley, "Simple Analytic Approximations to the CIE XYZ Color Matching Functions", Journal of Computer Graphics
/// Techniques 2(2), 2013).
#[must_use]
pub fn color_matching(wavelength: f64) -> DVec3 {
    let lobe = |height: f64, center: f64, below: f64, above: f64| {
        let offset = (wavelength - center) * if wavelength < center { below } else { above };
        height * (-0.5 * offset * offset).exp()
    };
    DVec3::new(
        lobe(0.362, 442.0, 0.0624, 0.0374) + lobe(1.056, 599.8, 0.0264, 0.0323) + lobe(-0.065, 501.1, 0.0490, 0.0382),
        lobe(0.821, 568.8, 0.0213, 0.0247) + lobe(0.286, 530.9, 0.0613, 0.0322),
        lobe(1.217, 437.0, 0.0845, 0.0278) + lobe(0.681, 459.0, 0.0385, 0.0725),
    )
}

/// Relative power of D65 at a wavelength from 380 to 780 nm, linearly interpolated as the CIE recommends.
#[must_use]
pub fn daylight(wavelength: f64) -> f64 {
    let place = ((wavelength - ENDS[0]) / 10.0).clamp(0.0, (D65.len() - 1) as f64);
    let below = (place as usize).min(D65.len() - 2);
    D65[below] + (D65[below + 1] - D65[below]) * (place - below as f64)
}

/// Linear sRGB contribution of a wavelength to white light, not yet divided by the integrals.
fn rgb(wavelength: f64) -> DVec3 {
    // XYZ to linear sRGB (IEC 61966-2-1); rows of the matrix.
    let matrix = DMat3::from_cols(
        DVec3::new(3.240_454_2, -1.537_138_5, -0.498_531_4),
        DVec3::new(-0.969_266_0, 1.876_010_8, 0.041_556_0),
        DVec3::new(0.055_643_4, -0.204_025_9, 1.057_225_2),
    )
    .transpose();
    matrix * color_matching(wavelength) * daylight(wavelength)
}

/// Divides the spectrum into `count` strata (1 to [`MOST_STRATA`]), from violet to red. All have the same area under the sum of the
/// weights' absolute values, so that the three colours are sampled alike.
///
/// The weight of a stratum is the integral over the stratum. Its wavelength is the mean, weighted by that area. In each channel the
/// weights sum to exactly 1, in any order of addition.
#[must_use]
pub fn strata(count: u32) -> Vec<Stratum> {
    let count = count.clamp(1, MOST_STRATA) as usize;
    let cells: Vec<(f64, DVec3)> = (0..STEPS)
        .map(|step| ENDS[0] + (step as f64 + 0.5) * (ENDS[1] - ENDS[0]) / STEPS as f64)
        .map(|wavelength| (wavelength, rgb(wavelength)))
        .collect();
    let whole: DVec3 = cells.iter().map(|(_, weight)| weight).sum();
    let cells: Vec<(f64, DVec3)> = cells.iter().map(|(wavelength, weight)| (*wavelength, weight / whole)).collect();
    let area = |weight: DVec3| weight.abs().element_sum();
    let share = cells.iter().map(|(_, weight)| area(*weight)).sum::<f64>() / count as f64;
    let mut strata = vec![(0.0, 0.0, DVec3::ZERO); count];
    let (mut index, mut before) = (0, 0.0);
    for (wavelength, weight) in cells {
        // A step of the integral may be divided among several strata.
        let (whole, mut left) = (area(weight), area(weight));
        while left > 0.0 {
            let room = (index + 1) as f64 * share - before;
            if room <= 0.0 && index + 1 < count {
                index += 1;
                continue;
            }
            let part = if index + 1 == count { left } else { left.min(room) };
            let (moment, sum, weights) = &mut strata[index];
            *moment += part * wavelength;
            *sum += part;
            *weights += weight * (part / whole);
            left -= part;
            before += part;
        }
    }
    let weights = rounded(&strata.iter().map(|(_, _, weight)| *weight).collect::<Vec<_>>());
    strata
        .iter()
        .zip(weights)
        .map(|((moment, sum, _), weight)| Stratum { wavelength: (moment / sum) as f32, weight })
        .collect()
}

/// Rounds weights to multiples of [`UNIT`] with a sum of 1: the largest weight absorbs the rounding errors.
fn rounded(weights: &[DVec3]) -> Vec<Vec3> {
    let mut units: Vec<DVec3> = weights.iter().map(|weight| (weight / UNIT).round()).collect();
    for channel in 0..3 {
        let left = 1.0 / UNIT - units.iter().map(|unit| unit[channel]).sum::<f64>();
        if let Some(greatest) = units.iter_mut().max_by(|one, other| one[channel].total_cmp(&other[channel])) {
            greatest[channel] += left;
        }
    }
    units.iter().map(|unit| (unit * UNIT).as_vec3()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_colour_matching_functions_are_those_of_the_tables() {
        // CIE 1931, 2 degrees; the fit is off by up to 1.3 % of a function's maximum.
        for (wavelength, x, y, z) in [
            (420.0, 0.134_38, 0.004_0, 0.645_6),
            (450.0, 0.336_2, 0.038_0, 1.772_11),
            (500.0, 0.004_9, 0.323_0, 0.272_0),
            (550.0, 0.433_45, 0.994_95, 0.008_75),
            (600.0, 1.062_2, 0.631_0, 0.000_8),
            (650.0, 0.283_5, 0.107_0, 0.0),
            (700.0, 0.011_359, 0.004_102, 0.0),
        ] {
            let off = (color_matching(wavelength) - DVec3::new(x, y, z)).abs();
            assert!(off.x < 0.0145 && off.y < 0.0085 && off.z < 0.0225, "{wavelength}: {off}");
        }
        // The integral of each is 106.9 nm.
        let whole: DVec3 = (3600..8300).map(|tenth| color_matching(f64::from(tenth) * 0.1) * 0.1).sum();
        assert!((whole - 106.86).abs().max_element() < 0.6, "{whole}");
    }

    #[test]
    fn daylight_is_white() {
        assert_eq!((daylight(560.0), daylight(380.0), daylight(780.0)), (100.0, 49.9755, 63.3828));
        assert!((daylight(555.0) - 102.023).abs() < 1e-3);
        let whole: DVec3 = (380..780)
            .map(|nanometre| f64::from(nanometre) + 0.5)
            .map(|wavelength| color_matching(wavelength) * daylight(wavelength))
            .sum();
        let (x, y) = (whole.x / whole.element_sum(), whole.y / whole.element_sum());
        assert!((x - 0.3127).abs() < 3e-4 && (y - 0.3290).abs() < 3e-4, "{x} {y}");
    }

    #[test]
    fn weights_sum_to_exactly_one_in_any_order() {
        for count in (1..40).chain([64, 255, 256]) {
            let strata = strata(count);
            assert_eq!(strata.len(), count as usize);
            let sum = strata.iter().fold(Vec3::ZERO, |sum, stratum| sum + stratum.weight);
            let back = strata.iter().rev().fold(Vec3::ZERO, |sum, stratum| sum + stratum.weight);
            assert_eq!((sum, back), (Vec3::ONE, Vec3::ONE), "{count}");
            assert!(strata.windows(2).all(|pair| pair[0].wavelength < pair[1].wavelength), "{count}");
            assert!(strata.iter().all(|stratum| (380.0..780.0).contains(&stratum.wavelength)), "{count}");
        }
        assert_eq!(strata(1)[0].weight, Vec3::ONE);
        assert!(strata(32).iter().any(|stratum| stratum.weight.x < -1e-3), "no spectral colour lies within sRGB");
    }

    #[test]
    fn each_colour_is_where_its_light_is() {
        let strata = strata(64);
        let mean =
            |channel: usize| -> f32 { strata.iter().map(|stratum| stratum.weight[channel] * stratum.wavelength).sum() };
        let [red, green, blue] = [0, 1, 2].map(mean);
        // 642.5, 543.0 and 440.8 nm by the tables of 1931; negative weights push the outer two apart.
        let off = [red - 642.5, green - 543.0, blue - 440.8].map(f32::abs);
        assert!(off.iter().all(|off| *off < 4.0), "{red} {green} {blue}");
        // Each colour has its share of the strata: strata by luminance alone would give blue one in sixteen.
        for channel in 0..3 {
            let many = strata.iter().filter(|stratum| stratum.weight[channel] > 0.01).count();
            assert!(many > 12, "{channel}: {many}");
        }
    }
}
