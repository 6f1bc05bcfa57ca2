//! The colour spaces in which FLIP measures differences, converted from linear sRGB under D65.

use crate::color::encode_f64;

/// Matrix from linear sRGB to CIE XYZ (primaries and D65 white of IEC 61966-2-1).
const XYZ_FROM_RGB: [[f64; 3]; 3] = [
    [0.412_390_799_265_959, 0.357_584_339_383_878, 0.180_480_788_401_834],
    [0.212_639_005_871_510, 0.715_168_678_767_756, 0.072_192_315_360_734],
    [0.019_330_818_715_592, 0.119_194_779_794_626, 0.950_532_152_249_661],
];
/// Inverse of [`XYZ_FROM_RGB`].
const RGB_FROM_XYZ: [[f64; 3]; 3] = [
    [3.240_969_941_904_521, -1.537_383_177_570_093, -0.498_610_760_293_003],
    [-0.969_243_636_280_880, 1.875_967_501_507_721, 0.041_555_057_407_176],
    [0.055_630_079_696_994, -0.203_976_958_888_977, 1.056_971_514_242_879],
];

fn multiply(matrix: &[[f64; 3]; 3], vector: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row[0] * vector[0] + row[1] * vector[1] + row[2] * vector[2])
}

/// CIE XYZ of a linear sRGB colour, divided by the XYZ of white.
fn relative_xyz(rgb: [f64; 3]) -> [f64; 3] {
    let (xyz, white) = (multiply(&XYZ_FROM_RGB, rgb), multiply(&XYZ_FROM_RGB, [1.0; 3]));
    [0, 1, 2].map(|i| xyz[i] / white[i])
}

/// Linear sRGB to the opponent space Y, Cx, Cz (section 4.1 of the FLIP paper).
pub(super) fn opponent(rgb: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = relative_xyz(rgb);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// Opponent space to linear sRGB, possibly outside 0..=1.
pub(super) fn rgb_of_opponent([luminance, cx, cz]: [f64; 3]) -> [f64; 3] {
    let y = (luminance + 16.0) / 116.0;
    let relative = [y + cx / 500.0, y, y - cz / 200.0];
    let white = multiply(&XYZ_FROM_RGB, [1.0; 3]);
    multiply(&RGB_FROM_XYZ, [0, 1, 2].map(|i| relative[i] * white[i]))
}

/// Linear sRGB to CIELAB under D65.
pub(super) fn lab(rgb: [f64; 3]) -> [f64; 3] {
    let delta: f64 = 6.0 / 29.0;
    let f = |value: f64| {
        if value > delta.powi(3) { value.cbrt() } else { value / (3.0 * delta * delta) + 4.0 / 29.0 }
    };
    let [x, y, z] = relative_xyz(rgb).map(f);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// CIELAB under D65 to encoded sRGB, clamped to 0..=1.
pub(super) fn displayed_of_lab([lightness, a, b]: [f64; 3]) -> [f64; 3] {
    let delta: f64 = 6.0 / 29.0;
    let inverse = |value: f64| {
        if value > delta { value.powi(3) } else { 3.0 * delta * delta * (value - 4.0 / 29.0) }
    };
    let y = (lightness + 16.0) / 116.0;
    let white = multiply(&XYZ_FROM_RGB, [1.0; 3]);
    let relative = [y + a / 500.0, y, y - b / 200.0].map(inverse);
    multiply(&RGB_FROM_XYZ, [0, 1, 2].map(|i| relative[i] * white[i])).map(|value| encode_f64(value.clamp(0.0, 1.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::decode_f64;

    #[test]
    fn color_spaces_have_their_known_values() {
        for (rgb, expected) in [
            ([1.0, 1.0, 1.0], [100.0, 0.0, 0.0]),
            ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
            // CIELAB of the sRGB primaries under D65.
            ([1.0, 0.0, 0.0], [53.2408, 80.0925, 67.2032]),
            ([0.0, 1.0, 0.0], [87.7347, -86.1827, 83.1793]),
            ([0.0, 0.0, 1.0], [32.2970, 79.1875, -107.8602]),
        ] {
            let found = lab(rgb);
            for i in 0..3 {
                assert!((found[i] - expected[i]).abs() < 0.02, "{rgb:?}: {found:?}");
            }
            let back = rgb_of_opponent(opponent(rgb));
            assert!(back.iter().zip(rgb).all(|(a, b)| (a - b).abs() < 1e-12), "{rgb:?}: {back:?}");
        }
        assert!((decode_f64(0.5) - 0.214_041_14).abs() < 1e-8);
    }
}
