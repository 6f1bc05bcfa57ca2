//! Functions of one number that become vector code in a loop over lanes, because they have no branch and no call. The
//! standard library's functions are calls, and their last bit differs between platforms.

use std::f32::consts::{FRAC_PI_2, LN_2, PI};

/// Sixteen numbers, one for each pixel.
pub(super) type Lanes = [f32; crate::trace::WIDE];

/// Sine and cosine of `share * π`, for `share` in 0..=1, by the Taylor series around π / 2. Error below 3e-7.
#[inline(always)]
pub(super) fn half_turn(share: f32) -> [f32; 2] {
    let x = (share - 0.5) * PI;
    let xx = x * x;
    let sum = -1.0 / 39_916_800.0;
    let sum = sum * xx + 1.0 / 362_880.0;
    let sum = sum * xx - 1.0 / 5_040.0;
    let sum = sum * xx + 1.0 / 120.0;
    let sum = sum * xx - 1.0 / 6.0;
    let sin = sum * xx * x + x;
    let sum = 1.0 / 479_001_600.0;
    let sum = sum * xx - 1.0 / 3_628_800.0;
    let sum = sum * xx + 1.0 / 40_320.0;
    let sum = sum * xx - 1.0 / 720.0;
    let sum = sum * xx + 1.0 / 24.0;
    let sum = sum * xx - 0.5;
    let cos = sum * xx + 1.0;
    [cos, -sin]
}

/// The angle `h` of a direction from the axis of `along`, and the cosine and sine of twice that angle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Angle {
    /// In 0..=π. Error below 4e-7.
    pub(super) angle: f32,
    /// `cos 2h` and `sin 2h`. Error below 4e-7.
    pub(super) double: [f32; 2],
}

/// The [`Angle`] of the direction `(across, along)` with `across >= 0`, of any length but 0.
///
/// `q` is the smaller of `across` and `|along|`, divided by the larger. Its arc tangent is by Abramowitz and Stegun,
/// "Handbook of Mathematical Functions", 4.4.49: error below 2e-8 besides rounding. The cosine and sine of twice the
/// arc tangent are `(1 - q²) / (1 + q²)` and `2 q / (1 + q²)`.
#[inline(always)]
pub(super) fn angle(across: f32, along: f32) -> Angle {
    let height = along.abs();
    let steep = height >= across;
    let (short, long) = if steep { (across, height) } else { (height, across) };
    let q = short / long;
    let qq = q * q;
    let sum = 0.002_866_225_7;
    let sum = sum * qq - 0.016_165_737;
    let sum = sum * qq + 0.042_909_614;
    let sum = sum * qq - 0.075_289_64;
    let sum = sum * qq + 0.106_562_64;
    let sum = sum * qq - 0.142_089;
    let sum = sum * qq + 0.199_935_51;
    let sum = sum * qq - 0.333_331_45;
    let within = sum * qq * q + q;
    let upward = if steep { within } else { FRAC_PI_2 - within };
    let scale = 1.0 / (1.0 + qq);
    let (cos, sin) = ((1.0 - qq) * scale, 2.0 * q * scale);
    let down = along < 0.0;
    Angle {
        angle: if down { PI - upward } else { upward },
        double: [if steep { cos } else { -cos }, if down { -sin } else { sin }],
    }
}

/// `x`, 0..=1, to a power of at least 0. Exactly 1 where `x` is 1 or the exponent is 0; exactly 0 where `x` is 0 and
/// the exponent is not. Error below 3e-7.
///
/// The power is `2^(exponent log2 x)`. With `x = 2^e m` and `m` between `√½` and `√2`, the logarithm of `m` is
/// `2 artanh((m - 1) / (m + 1))`. The series of `artanh` is cut after the ninth power (relative error below 2e-9), the series of
/// the exponential function after the seventh (1e-8).
#[must_use]
#[inline(always)]
pub fn power(x: f32, exponent: f32) -> f32 {
    // The bits of `√½`: subtracting them leaves the power of two in the exponent's bits.
    const LEAST: u32 = 0x3f35_04f3;
    let bits = x.to_bits();
    let whole = (bits.wrapping_sub(LEAST) as i32) >> 23;
    let m = f32::from_bits(bits.wrapping_sub((whole as u32) << 23));
    let s = (m - 1.0) / (m + 1.0);
    let ss = s * s;
    let sum = ((ss * (1.0 / 9.0) + 1.0 / 7.0) * ss + 1.0 / 5.0) * ss + 1.0 / 3.0;
    let log = (sum * ss * s + s) * (2.0 / LN_2) + whole as f32;
    // Clamped, so that the bits of `scale` are those of a valid float. 2^-120 is 0 at any precision of interest.
    let log = exponent * log;
    let log = if log > -120.0 { log } else { -120.0 };
    // Adding and subtracting this rounds to an integer, which the sum holds in its low bits.
    const ROUND: f32 = 12_582_912.0;
    let rounded = log + ROUND;
    let f = (log - (rounded - ROUND)) * LN_2;
    let sum = ((f * (1.0 / 5_040.0) + 1.0 / 720.0) * f + 1.0 / 120.0) * f + 1.0 / 24.0;
    let sum = ((sum * f + 1.0 / 6.0) * f + 0.5) * f;
    let scale = f32::from_bits((rounded.to_bits() << 23).wrapping_add(0x3f80_0000));
    let result = (sum * f + f + 1.0) * scale;
    let nothing = (x <= 0.0) & (exponent > 0.0);
    if nothing { 0.0 } else { result }
}
