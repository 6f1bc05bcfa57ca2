//! Ambient occlusion from what the camera sees: by horizons, by sectors of a bitmask, and by the difference of depths. Sixteen pixels of a row at a
//! time, in the processor's widest vectors; all instruction sets give the same bits.
//!
//! All look along `slices` directions from a pixel, `steps` times on each side. A direction is a plane through the eye and
//! the pixel's position: with unit vectors `V` to the eye and `T` across, positions `P + r T` lie on a straight line of the
//! picture, and what is seen there lies in the plane up to the rounding to pixels.
//!
//! Slice `index` of a pixel has the angle `π (index + u) / slices` around `V`, with `u` dimension 0 of counter 0 of the
//! pixel's key; the sides' jitters are the dimensions of counter `1 + index`. That of the sectors is dimension 1 of counter 0, and `index / slices` more for each slice.
//!
//! The result is off from the formulas in `f64` by at most 2e-6 (horizons, bitmask) and 3e-7 (depths), where rounding does not decide which
//! pixel a step reads or whether it counts; where it does, by what that step weighs.
//!
//! - `lanes`: the functions of angles and powers, with their errors.
//! - `frame`: what the pixels of a picture have in common.
//! - `pixels`: what is known of sixteen pixels, and where a slice of them leads.
//! - `horizons`, `bitmask`, `depths`: the occlusions.

mod bitmask;
mod depths;
mod frame;
mod horizons;
mod lanes;
mod pixels;
#[cfg(test)]
mod tests;

pub use bitmask::SECTORS;
pub use depths::DEPTH_TOLERANCE;
pub use frame::Occlusion;

use crate::trace::{Detected, Kernel, Simd, WIDE};
use curitiba_pipeline::backend::EffectJob;
use curitiba_pipeline::raster_effects::EffectProgram;
pub use lanes::power;
use pixels::Pixels;

/// Pixels that are computed together.
pub const SPAN: usize = WIDE;

/// Which occlusion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// By horizons.
    Horizons,
    /// By sectors that what is seen shuts.
    Bitmask,
    /// By the difference of depths.
    Depths,
}

impl Method {
    /// What a job of an occlusion asks for.
    #[must_use]
    pub fn of(job: &EffectJob<'_>) -> Self {
        match job.program {
            EffectProgram::DepthOcclusion => Self::Depths,
            _ if job.params.bitmask => Self::Bitmask,
            _ => Self::Horizons,
        }
    }
}

/// The open share of [`SPAN`] pixels of row `y` from column `x` on, to the power of the intensity; 1 in the background. Those
/// beyond the row's end have no meaning.
///
/// # Panics
/// If the first pixel is outside the picture.
#[must_use]
pub fn open_shares(occlusion: &Occlusion<'_>, method: Method, x: u32, y: u32) -> [f32; SPAN] {
    Detected::cached().run(Span { occlusion, method, x, y })
}

struct Span<'a> {
    occlusion: &'a Occlusion<'a>,
    method: Method,
    x: u32,
    y: u32,
}

impl Kernel<[f32; SPAN]> for Span<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> [f32; SPAN] {
        let Self { occlusion, method, x, y } = self;
        let pixels = Pixels::new(simd, occlusion, x, y);
        if !pixels.any_shown() {
            return [1.0; SPAN];
        }
        let open = match method {
            Method::Horizons => horizons::open(simd, occlusion, &pixels),
            Method::Bitmask => bitmask::open(simd, occlusion, &pixels),
            Method::Depths => depths::open(simd, occlusion, &pixels),
        };
        let mut shares = [0.0; SPAN];
        for lane in 0..SPAN {
            shares[lane] = power(open[lane], occlusion.intensity);
        }
        shares
    }
}
