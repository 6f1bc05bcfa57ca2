//! The transfer function of sRGB (IEC 61966-2-1): by formula for numbers, by tables for 8-bit codes.

/// The linear value of each 8-bit code.
pub static DECODED: [f32; 256] = decoded();

/// Encoded value below which the curve is a line.
const KNEE: f64 = 0.040_45;

/// The linear value of an encoded one. The function is not mirrored at 0: negative values stay on the linear segment, values above
/// 1 on the power curve.
#[must_use]
pub fn decode(encoded: f32) -> f32 {
    decode_f64(encoded.into()) as f32
}

/// [`decode`] in 64 bits.
pub(crate) fn decode_f64(encoded: f64) -> f64 {
    if encoded <= KNEE { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// The derivative of [`decode`].
#[must_use]
pub fn decode_slope(encoded: f32) -> f32 {
    if f64::from(encoded) <= KNEE { 1.0 / 12.92 } else { 2.4 / 1.055 * ((encoded + 0.055) / 1.055).powf(1.4) }
}

/// The encoded value of a linear one: the inverse of [`decode`].
#[must_use]
pub fn encode(linear: f32) -> f32 {
    encode_f64(linear.into()) as f32
}

/// [`encode`] in 64 bits.
pub(crate) fn encode_f64(linear: f64) -> f64 {
    if linear <= KNEE / 12.92 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// 8-bit code of a linear value: `round(255 * encode(linear))`, as if [`encode`] were exact. Values are clamped to 0 to 1; NaN
/// gives 0.
#[must_use]
#[inline]
pub fn code(linear: f32) -> u8 {
    // For NaN `max` returns 0.
    let linear = linear.max(0.0);
    if linear >= 1.0 {
        return 255;
    }
    // No interval of the table holds more than one threshold, so one comparison suffices.
    let first = FIRST[(linear * INTERVALS as f32) as usize];
    first + u8::from(linear >= THRESHOLDS[usize::from(first)])
}

/// Number of intervals of [`FIRST`] over 0 to 1. Each is narrower than the steps between codes, which are 1 / (255 x 12.92) on the
/// linear segment and wider on the power curve.
const INTERVALS: usize = 4096;

/// Entry `code` is the least `f32` whose code is above `code`; infinity for code 255.
static THRESHOLDS: [f32; 256] = thresholds();

/// The code of the lower end of each of the intervals that divide 0 to 1.
static FIRST: [u8; INTERVALS] = first();

/// [`decode`] as a `const fn`, by `x^2.4 = x² (x²)^(1/5)`.
const fn exact(encoded: f64) -> f64 {
    if encoded <= KNEE {
        return encoded / 12.92;
    }
    let base = (encoded + 0.055) / 1.055;
    let square = base * base;
    // Newton's method from above decreases until rounding ends it.
    let mut root = 1.0;
    let mut step = 0;
    while step < 64 {
        root -= (root * root * root * root * root - square) / (5.0 * root * root * root * root);
        step += 1;
    }
    square * root
}

const fn decoded() -> [f32; 256] {
    let mut table = [0.0; 256];
    let mut code = 0;
    while code < 256 {
        table[code] = exact(code as f64 / 255.0) as f32;
        code += 1;
    }
    table
}

const fn thresholds() -> [f32; 256] {
    let mut table = [f32::INFINITY; 256];
    let mut code = 0;
    while code < 255 {
        let between = exact((code as f64 + 0.5) / 255.0);
        let nearest = between as f32;
        // The least `f32` that is not below `between`.
        table[code] = if (nearest as f64) < between { nearest.next_up() } else { nearest };
        code += 1;
    }
    table
}

const fn first() -> [u8; INTERVALS] {
    let thresholds = thresholds();
    let mut table = [0; INTERVALS];
    let (mut interval, mut code) = (0, 0);
    while interval < INTERVALS {
        let low = interval as f32 / INTERVALS as f32;
        while low >= thresholds[code] {
            code += 1;
        }
        table[interval] = code as u8;
        interval += 1;
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The standard's formula, in 64 bits.
    fn standard(linear: f64) -> f64 {
        if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
    }

    #[test]
    fn every_code_comes_back() {
        let narrowest = THRESHOLDS.windows(2).map(|pair| pair[1] - pair[0]).fold(f32::INFINITY, f32::min);
        assert!(narrowest > 1.0 / INTERVALS as f32, "an interval could hold two: {narrowest}");
        for code in 0..=u8::MAX {
            let linear = DECODED[usize::from(code)];
            assert_eq!(super::code(linear), code);
            assert_eq!((encode(linear) * 255.0).round(), f32::from(code));
            let encoded = f64::from(code) / 255.0;
            let exact = if encoded <= 0.040_45 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) };
            assert!((f64::from(linear) - exact).abs() <= 1e-7 * exact, "{code}: {linear} and {exact}");
            assert!((f64::from(decode(encoded as f32)) - exact).abs() <= 5e-7 * exact, "{code}");
        }
        assert_eq!((DECODED[0], DECODED[255]), (0.0, 1.0));
    }

    #[test]
    fn codes_are_the_nearest_of_all_numbers() {
        // All floats would take minutes. The step of 1009 follows no pattern in the bits.
        for bits in (0..=1.0_f32.to_bits()).step_by(1009) {
            let linear = f32::from_bits(bits);
            let exact = 255.0 * standard(linear.into());
            // Where the formula's result is a tie up to rounding, both neighbours are right.
            let nearest = (exact + 0.5).floor();
            let tie = (exact + 0.5 - (exact + 0.5).round()).abs() < 1e-4;
            let found = f64::from(code(linear));
            assert!(found == nearest || tie && (found - nearest).abs() <= 1.0, "{linear}: {found}, not {exact}");
        }
    }

    #[test]
    fn codes_never_fall_and_cut_what_is_beyond() {
        let mut before = 0;
        for step in 0..=100_000 {
            let code = code(step as f32 / 100_000.0);
            assert!(code >= before && code - before <= 1, "{step}");
            before = code;
        }
        assert_eq!((before, code(-1.0), code(7.0), code(f32::NAN), code(f32::INFINITY)), (255, 0, 255, 0, 255));
        assert_eq!(code(f32::from_bits(1)), 0);
    }

    #[test]
    fn encoding_undoes_decoding() {
        for step in 0..=1000 {
            let value = step as f32 / 500.0;
            assert!((encode(decode(value)) - value).abs() < 1e-6, "{value}");
        }
        // The two branches meet to within the standard's own rounding.
        assert!((encode(0.003_130_8_f32.next_up()) - encode(0.003_130_8)).abs() < 1e-6);
    }
}
