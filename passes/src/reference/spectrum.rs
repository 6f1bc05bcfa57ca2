//! Wavelengths, for bodies that disperse light.

use curitiba_pipeline::glass::{color_matching, daylight};
use glam::{DMat3, DVec3};
use std::sync::LazyLock;

/// Ends of the spectrum, nanometres.
const ENDS: [f64; 2] = [380.0, 780.0];
/// Number of steps of integrals over the spectrum.
const STEPS: usize = 4000;

/// White light: D65 by wavelength in linear sRGB, each channel divided by its integral.
struct White {
    /// Weights of the steps in red, green and blue. They sum to 1.
    weights: Vec<DVec3>,
    /// Sums of the absolute values of the weights in all channels, up to and including each step.
    sums: Vec<f64>,
}

static WHITE: LazyLock<White> = LazyLock::new(|| {
    // XYZ to linear sRGB (IEC 61966-2-1), by columns.
    let to_rgb = DMat3::from_cols_array(&[
        3.240_454_2,
        -0.969_266_0,
        0.055_643_4,
        -1.537_138_5,
        1.876_010_8,
        -0.204_025_9,
        -0.498_531_4,
        0.041_556_0,
        1.057_225_2,
    ]);
    let light = |step: usize| {
        let wavelength = wavelength(step as f64 + 0.5);
        to_rgb * color_matching(wavelength) * daylight(wavelength)
    };
    let lights: Vec<DVec3> = (0..STEPS).map(light).collect();
    let whole: DVec3 = lights.iter().sum();
    let weights: Vec<DVec3> = lights.iter().map(|light| *light / whole).collect();
    let mut sum = 0.0;
    let sums = weights.iter().map(|weight| {
        sum += weight.abs().element_sum();
        sum
    });
    White { sums: sums.collect(), weights }
});

fn wavelength(steps: f64) -> f64 {
    ENDS[0] + (ENDS[1] - ENDS[0]) * steps / STEPS as f64
}

/// The wavelength, in nanometres, that a number from 0 to 1 chooses, and the weight of its light in red, green and blue. The mean of this
/// weight over all numbers is 1.
pub(super) fn chosen(number: f64) -> (f64, DVec3) {
    let White { weights, sums } = &*WHITE;
    let whole = sums[STEPS - 1];
    let step = sums.partition_point(|sum| *sum < number * whole).min(STEPS - 1);
    let before = if step == 0 { 0.0 } else { sums[step - 1] };
    let own = sums[step] - before;
    let within = ((number * whole - before) / own).clamp(0.0, 1.0);
    (wavelength(step as f64 + within), weights[step] * (whole / own))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_stays_white_and_each_colour_is_where_its_light_is() {
        const COUNT: u32 = 1 << 14;
        let all = (0..COUNT).map(|number| chosen((f64::from(number) + 0.5) / f64::from(COUNT)));
        let (mut white, mut mean) = (DVec3::ZERO, DVec3::ZERO);
        for (wavelength, weight) in all {
            assert!((380.0..=780.0).contains(&wavelength) && weight.is_finite());
            white += weight / f64::from(COUNT);
            mean += weight * wavelength / f64::from(COUNT);
        }
        assert!((white - DVec3::ONE).abs().max_element() < 1e-3, "{white}");
        // Means by the tables of 1931; negative weights push the outer two apart.
        let off = (mean - DVec3::new(642.5, 543.0, 440.8)).abs();
        assert!(off.max_element() < 4.0, "{mean}");
    }
}
