//! What colour values mean, and how they are brought to a screen.
//!
//! | `color` | colours of files | shading | EXR | PNG |
//! |---|---|---|---|---|
//! | `report` | used as stored | with display values, as the report's engine | display values | cut to 0..=1 |
//! | `linear` | decoded from sRGB | with linear radiance | linear radiance | exposure, tone curve, sRGB transfer |
//!
//! The unit of radiance: a white diffuse surface that faces a light of colour 1 reflects a radiance of 1 from that light, and 0.3 from
//! ambient light. So a light of colour 1 has the irradiance π.

mod transfer;

pub use transfer::{DECODED, code, decode, decode_slope, encode};
pub(crate) use transfer::{decode_f64, encode_f64};

use crate::diagnostic::valid_names;
use glam::{Vec3, Vec4};
use std::fmt;
use std::str::FromStr;

/// Largest absolute value of a colour component of a light, a background or a material. Up to this limit reflected light stays below
/// `f32::MAX`, even where the surface's colour is decoded from sRGB: `(1e9)^2.4 * 1e9 < 4e30`.
pub const BRIGHTEST: f32 = 1e9;

/// Whether all components of a colour are numbers up to [`BRIGHTEST`].
#[must_use]
pub fn in_range(color: Vec3) -> bool {
    color.abs().cmple(Vec3::splat(BRIGHTEST)).all()
}

/// What the numbers of a project's colours mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub enum ColorSpace {
    /// Display values, used as they are stored, as in the report's engine.
    #[default]
    Report,
    /// Linear radiance; sRGB values in files are decoded when they are loaded.
    Linear,
}

named!(ColorSpace, "report" => Report, "linear" => Linear);

impl ColorSpace {
    /// Converts display values from a file or an option into the values that programs shade with. Alpha is unchanged.
    #[must_use]
    pub fn of_display(self, color: Vec4) -> Vec4 {
        match self {
            Self::Report => color,
            Self::Linear => color.truncate().map(|value| decode(value).min(f32::MAX)).extend(color.w),
        }
    }
}

impl fmt::Display for ColorSpace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for ColorSpace {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::named(text).ok_or_else(|| valid_names(text, Self::NAMED.iter().map(|(name, _)| *name)))
    }
}

/// Tone curve: how radiance above 1 is brought into the range of a screen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub enum Tone {
    /// No curve: values above 1 are clipped.
    #[default]
    None,
    /// Colours are scaled by `(1 + Y / W²) / (1 + Y)`, where `Y` is their luminance (weights of ITU-R BT.709) and `W` = 4 is the luminance
    /// that becomes 1: Reinhard, Stark, Shirley and Ferwerda, "Photographic Tone Reproduction for Digital Images", SIGGRAPH 2002,
    /// equation 4.
    Reinhard,
}

named!(Tone, "none" => None, "reinhard" => Reinhard);

impl Tone {
    /// The luminance that [`Self::Reinhard`] maps to 1.
    pub const WHITE: f32 = 4.0;

    /// Applies the curve to a linear colour.
    fn apply(self, color: Vec3) -> Vec3 {
        match self {
            Self::None => color,
            Self::Reinhard => {
                let luminance = color.dot(Vec3::new(0.2126, 0.7152, 0.0722)).max(0.0);
                // An infinite one would make the second fraction NaN.
                let luminance = if luminance.is_finite() { luminance } else { f32::MAX };
                // `(1 + Y / W²) / (1 + Y)`, split into two fractions so that no luminance overflows.
                let scale = 1.0 / (1.0 + luminance) + luminance / (1.0 + luminance) / (Self::WHITE * Self::WHITE);
                color * scale
            }
        }
    }
}

impl FromStr for Tone {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::named(text).ok_or_else(|| valid_names(text, Self::NAMED.iter().map(|(name, _)| *name)))
    }
}

/// How pixel values are converted to display values.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Display {
    /// Colour space of the pixels.
    pub space: ColorSpace,
    /// Linear radiance is multiplied by 2 to the power of this.
    pub exposure: f32,
    /// Tone curve, applied after the exposure.
    pub tone: Tone,
}

impl Display {
    /// Largest absolute exposure in stops: 2^64 and 2^-64 are normal `f32` numbers.
    pub const MAX_EXPOSURE: f32 = 64.0;

    /// The display of pixels in `space` with exposure 0 and no tone curve.
    #[must_use]
    pub fn of(space: ColorSpace) -> Self {
        Self { space, ..Self::default() }
    }

    /// Parses an exposure in stops, from -[`Self::MAX_EXPOSURE`] to [`Self::MAX_EXPOSURE`].
    ///
    /// # Errors
    /// A message that says what would be valid.
    pub fn parse_exposure(text: &str) -> Result<f32, String> {
        let stops: Option<f32> = text.trim().parse().ok().filter(|stops: &f32| stops.abs() <= Self::MAX_EXPOSURE);
        let most = Self::MAX_EXPOSURE;
        stops.ok_or_else(|| format!("`{text}` is no number of stops from -{most} to {most}, such as -1 or 0.5"))
    }

    fn linear(&self, [r, g, b, _]: [f32; 4]) -> Vec3 {
        self.tone.apply(Vec3::new(r, g, b) * self.exposure.exp2())
    }

    /// The display value of a pixel: 0 to 1, not rounded. NaN becomes 0; alpha is unchanged.
    #[must_use]
    pub fn displayed(&self, pixel: [f32; 4]) -> [f32; 4] {
        let shown = match self.space {
            ColorSpace::Report => Vec4::from(pixel).truncate().map(|value| value.clamp(0.0, 1.0)),
            ColorSpace::Linear => self.linear(pixel).map(|value| encode(value.clamp(0.0, 1.0))),
        };
        shown.map(|value| if value.is_nan() { 0.0 } else { value }).extend(pixel[3]).into()
    }

    /// The value to hand to an encoder that multiplies by 255 and rounds: display values unchanged; for linear radiance the 8-bit
    /// code divided by 255, so that only [`code`] rounds.
    #[must_use]
    pub fn stored(&self, pixel: [f32; 4]) -> [f32; 4] {
        match self.space {
            ColorSpace::Report => pixel,
            ColorSpace::Linear => {
                self.linear(pixel).map(|value| f32::from(code(value)) / 255.0).extend(pixel[3]).into()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn display_values_pass_and_radiance_is_encoded() {
        let report = Display::default();
        assert_eq!(report.stored([0.3, 1.5, -1.0, 0.25]), [0.3, 1.5, -1.0, 0.25]);
        assert_eq!(report.displayed([0.3, 1.5, f32::NAN, 0.25]), [0.3, 1.0, 0.0, 0.25]);
        let linear = Display::of(ColorSpace::Linear);
        // Reference values of sRGB: linear 0.5 has code 188; code 128 decodes to 0.2158 (0.2140 is code 127.5).
        let stored = linear.stored([0.5, 0.215_860_5, f32::NAN, 1.0]);
        assert_eq!(stored, [188.0 / 255.0, 128.0 / 255.0, 0.0, 1.0]);
        assert_eq!(linear.stored([f32::INFINITY, -3.0, 1.0, 0.0]), [1.0, 0.0, 1.0, 0.0]);
        let shown = linear.displayed([0.214_041_14, 1.0, f32::INFINITY, 0.5]);
        assert!((shown[0] - 0.5).abs() < 1e-6 && shown[1..] == [1.0, 1.0, 0.5], "{shown:?}");
    }

    #[test]
    fn a_stop_doubles_radiance() {
        let exposed = |exposure| Display { exposure, ..Display::of(ColorSpace::Linear) };
        for value in [0.01, 0.1, 0.4] {
            let twice = Display::of(ColorSpace::Linear).stored([2.0 * value, value, 0.0, 1.0]);
            assert_eq!(exposed(1.0).stored([value, 0.5 * value, 0.0, 1.0]), twice);
            assert_eq!(exposed(-1.0).stored([4.0 * value, 2.0 * value, 0.0, 1.0]), twice);
            assert_ne!(exposed(0.0).stored([value, 0.5 * value, 0.0, 1.0]), twice, "control");
        }
        assert!(["nan", "65", "-64.5", "x", ""].iter().all(|text| Display::parse_exposure(text).is_err()));
        assert_eq!(Display::parse_exposure("-64"), Ok(-64.0));
    }

    #[test]
    fn reinhards_curve_is_the_papers() {
        let grey = |value: f32| Tone::Reinhard.apply(Vec3::splat(value)).x;
        for value in [0.0_f32, 1e-6, 0.18, 1.0, 4.0, 100.0] {
            let exact = f64::from(value);
            let paper = exact * (1.0 + exact / 16.0) / (1.0 + exact);
            assert!((f64::from(grey(value)) - paper).abs() <= 1e-6 * paper, "{value}");
        }
        assert!((grey(4.0) - 1.0).abs() < 1e-6, "the white point");
        assert!(grey(f32::MAX).is_finite() && grey(f32::MAX) > 1.0);
        // What is infinite is white, as without a curve. Channels that are finite beside it are those at the greatest luminance.
        let display = Display { tone: Tone::Reinhard, ..Display::of(ColorSpace::Linear) };
        for pixel in [[f32::INFINITY, f32::INFINITY, f32::INFINITY, 1.0], [f32::INFINITY, 16.0, f32::MAX, 1.0]] {
            assert_eq!((display.displayed(pixel), display.stored(pixel)), ([1.0; 4], [1.0; 4]), "{pixel:?}");
        }
        assert_eq!(grey(f32::INFINITY), f32::INFINITY);
        assert_eq!(display.displayed([f32::NAN, 1.0, 0.0, 1.0]), [0.0, 1.0, 0.0, 1.0], "NaN stays black");
        // The curve keeps the hue: the ratios of the channels.
        let color = Tone::Reinhard.apply(Vec3::new(3.0, 1.5, 0.75));
        assert!((color.x / color.y - 2.0).abs() < 1e-6 && (color.y / color.z - 2.0).abs() < 1e-6);
    }

    #[test]
    fn names_are_read_as_they_are_written() {
        for (name, space) in ColorSpace::NAMED {
            assert_eq!((space.name(), name.parse()), (*name, Ok(*space)));
        }
        for (name, tone) in Tone::NAMED {
            assert_eq!((tone.name(), name.parse()), (*name, Ok(*tone)));
        }
        assert!("liner".parse::<ColorSpace>().expect_err("a typing error").contains("did you mean `linear`?"));
        assert!("aces".parse::<Tone>().is_err());
    }

    #[test]
    fn alpha_is_no_colour() {
        let color = Vec4::new(0.5, 1.0, 0.0, 0.5);
        assert_eq!(ColorSpace::Report.of_display(color), color);
        let linear = ColorSpace::Linear.of_display(color);
        assert!((linear.x - 0.214_041_14).abs() < 1e-7 && linear.y == 1.0 && linear.z == 0.0 && linear.w == 0.5);
    }
}
