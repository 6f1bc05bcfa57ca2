//! Quads that a rasteriser fills on its own device, from what was drawn and traced there.
//!
//! What they give is the host's, bit for bit: pixels are rounded to the declared formats, and products of two channels and of radiance
//! with the exposure are rounded as IEEE 754 says. Codes of 8 bits are found in tables that the host makes with its own rule
//! ([`Steps`]).

use crate::color::{ColorSpace, Display};
use crate::image::{PixelFormat, code_of};
use std::time::Duration;

/// Where a rasteriser fills quads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum QuadPlace {
    /// It draws in host memory, where the executor fills them.
    #[default]
    Host,
    /// On its device.
    Device,
    /// It could on its device, whose driver runs on the processor and is slower than the executor there.
    Software,
}

/// A channel on the rasteriser's device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OnDevice {
    /// A channel of what was drawn last.
    Drawn {
        /// The number of that draw ([`HandOver::value`](crate::backend::HandOver::value)).
        value: u64,
        /// 0 to 2.
        channel: usize,
    },
    /// The picture that an effect or a ray pass left there, under this number.
    Made(usize),
}

/// What a quad reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DeviceSource {
    /// Where it is; it has the quad's size.
    pub place: OnDevice,
    /// The declared format, to which the pixels are rounded first.
    pub format: PixelFormat,
}

/// A quad over the whole of the window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeviceQuad {
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// What it shows.
    pub color: DeviceSource,
    /// Of the material `combine`: what the colour is multiplied by, the `x` of it.
    pub factor: Option<DeviceSource>,
}

/// What of a quad is brought into host memory: `width * height` pixels, the top row first.
#[derive(Debug)]
pub enum Shown<'a> {
    /// 16 bytes a pixel.
    Floats(&'a mut [[f32; 4]]),
    /// 4 bytes a pixel: what is displayed, as [`Codes`](crate::image::Codes) has it.
    Codes(Display, &'a mut [[u8; 4]]),
}

/// What a quad took, and what it shows.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct DeviceQuadStats {
    /// Host time of filling it, with synchronisation.
    pub host: Duration,
    /// Time on the device's own clock, where it has one.
    pub device: Option<Duration>,
    /// Host time of bringing it into host memory.
    pub read_back: Duration,
    /// Pixels with a value that is not finite.
    pub not_finite: u32,
    /// Whether all pixels have one colour; alpha does not count.
    pub is_blank: bool,
}

/// The least number of each step of a function of one number that never falls and counts from 0 in steps of 1, as patterns of bits: of numbers
/// that are not below 0, the order of the patterns is that of the numbers.
pub type Steps = [u32; 255];

/// The steps of a function that counts from 0 at 0 to 255 at 1.
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

/// From which number on each code above 0 is displayed; of linear radiance, after exposure and tone curve.
#[must_use]
pub fn code_steps(space: ColorSpace) -> Steps {
    steps(|value| code_of(Display::of(space), value))
}

/// From which number on [`PixelFormat::Rgba8Unorm`] holds each byte above 0.
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
