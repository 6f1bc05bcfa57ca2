//! Quads that a rasteriser fills on its own device, from pictures that were drawn and traced there.
//!
//! The result equals the host's, bit for bit: pixels are rounded to the declared formats, and products (of two channels, or of
//! radiance and exposure) are rounded as in IEEE 754. 8-bit codes are looked up in tables that the host computes by its own rule
//! ([`Steps`]).

use crate::color::{ColorSpace, Display};
use crate::image::{PixelFormat, code_of};
use std::time::Duration;

/// Where a rasteriser fills quads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum QuadPlace {
    /// In host memory, where the rasteriser draws and the executor fills quads.
    #[default]
    Host,
    /// On the rasteriser's device.
    Device,
    /// The rasteriser could fill quads on its device, but the device is software that runs on the processor and is slower than
    /// the executor.
    Software,
}

/// A channel on the rasteriser's device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OnDevice {
    /// A channel of the last draw.
    Drawn {
        /// Number of that draw ([`HandOver::value`](crate::backend::HandOver::value)).
        value: u64,
        /// Channel, 0 to 2.
        channel: usize,
    },
    /// The picture that an effect or a ray pass kept on the device under this number.
    Made(usize),
}

/// A source of a quad.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DeviceSource {
    /// Where the source lies; it has the quad's size.
    pub place: OnDevice,
    /// The declared format, to which its pixels are rounded first.
    pub format: PixelFormat,
}

/// A quad that fills the whole window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeviceQuad {
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// The colour that it shows.
    pub color: DeviceSource,
    /// For the material `combine`: the source whose `x` multiplies the colour.
    pub factor: Option<DeviceSource>,
}

/// Form in which a quad is copied into host memory: `width * height` pixels, top row first.
#[derive(Debug)]
pub enum Shown<'a> {
    /// Four floats, 16 bytes a pixel.
    Floats(&'a mut [[f32; 4]]),
    /// Display codes, 4 bytes a pixel, as in [`Codes`](crate::image::Codes).
    Codes(Display, &'a mut [[u8; 4]]),
}

/// Times of a quad, and properties of its pixels.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct DeviceQuadStats {
    /// Host time until the device has filled it and copied it to memory that the host reads.
    pub host: Duration,
    /// Time on the device's own clock, if it has one.
    pub device: Option<Duration>,
    /// Host time of the copy from the memory that the host reads.
    pub read_back: Duration,
    /// Number of pixels with a value that is not finite.
    pub not_finite: u32,
    /// Whether all pixels have the same colour; alpha is ignored.
    pub is_blank: bool,
}

/// Thresholds of a monotonic function from numbers to 0..=255: entry `i` is the bit pattern of the least number whose value is `i +
/// 1`. For numbers that are not negative, bit patterns have the order of the numbers.
pub type Steps = [u32; 255];

/// The thresholds of a monotonic function that is 0 at 0 and 255 at 1.
fn steps(count: impl Fn(f32) -> u8) -> Steps {
    let first_with = |wanted: u8| {
        let (mut below, mut from) = (0, 1.0_f32.to_bits());
        while from - below > 1 {
            let middle = below.midpoint(from);
            if count(f32::from_bits(middle)) >= wanted { from = middle } else { below = middle }
        }
        from
    };
    std::array::from_fn(|step| first_with(step as u8 + 1))
}

/// The least number for each display code above 0. For [`ColorSpace::Linear`] the number is radiance after exposure and tone curve.
#[must_use]
pub fn code_steps(space: ColorSpace) -> Steps {
    steps(|value| code_of(Display::of(space), value))
}

/// The least number for each byte above 0 in [`PixelFormat::Rgba8Unorm`].
#[must_use]
pub fn byte_steps() -> Steps {
    steps(|value| {
        let mut pixel = [[value; 4]];
        PixelFormat::Rgba8Unorm.round(&mut pixel);
        (pixel[0][0] * 255.0).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::byte;

    fn counted(steps: &Steps, value: f32) -> u8 {
        steps.iter().filter(|step| **step <= value.to_bits()).count() as u8
    }

    #[test]
    fn steps_are_where_the_hosts_rule_steps() {
        let (report, linear, bytes) = (code_steps(ColorSpace::Report), code_steps(ColorSpace::Linear), byte_steps());
        for steps in [&report, &linear, &bytes] {
            assert!(steps.is_sorted_by(|a, b| a < b));
        }
        let near = |step: u32| [step - 1, step, step + 1].map(f32::from_bits);
        let spread = (0..=1.0_f32.to_bits()).step_by(4099).map(f32::from_bits);
        let edges = [report, linear, bytes].concat().into_iter().flat_map(near);
        for value in spread.chain(edges).chain([1.5, 1e30, f32::INFINITY]) {
            assert_eq!(counted(&report, value), byte(value), "{value}");
            assert_eq!(counted(&linear, value), crate::color::code(value), "{value}");
            let mut rounded = [[value; 4]];
            PixelFormat::Rgba8Unorm.round(&mut rounded);
            assert_eq!(f32::from(counted(&bytes, value)) / 255.0, rounded[0][0], "{value}");
        }
        assert_ne!(report, bytes, "control: the two rules differ on some numbers, or one table would do");
    }
}
