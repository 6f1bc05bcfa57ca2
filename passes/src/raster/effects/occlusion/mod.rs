//! Screen-space ambient occlusion: by horizons, by visibility bitmasks, and by depth differences. Sixteen pixels of a
//! row are computed at once, in vectors of the best instruction set of the processor; all instruction sets give the same bits.
//!
//! All three look along `slices` directions from a pixel, `steps` times on each side. A slice is a plane through the
//! eye and the pixel's position `P`, with unit vectors `V` to the eye and `T` across. Positions `P + r T` lie on a
//! straight line of the picture, and the surfaces seen there lie in the plane, up to the rounding to pixels. The methods by horizons
//! and by bitmasks place their steps along that line, between one pixel and the place of `P + radius T`. The method by depths
//! places its steps by `r`.
//!
//! A pixel has four random words. Slice `index` has the angle `π (index + u) / slices` around `V`, where `u` is the first word as a
//! fraction. The jitters of its two sides are the last two words as fractions, plus `index` times [`JITTERS`]. The jitter of the sectors is
//! the second word as a fraction, plus `index / slices`.
//!
//! Errors against the same formulas in `f64`: at most 4e-6 (horizons, bitmask) and 3e-7 (depths), unless rounding
//! decides which pixel a step reads or whether the step counts. Then the error may be the weight of that step.
//!
//! - `lanes`: the functions of angles and powers, with their errors.
//! - `frame`: values that the pixels of a picture share.
//! - `pixels`: sixteen pixels, and the pixels that their slices lead to.
//! - `horizons`, `bitmask`, `depths`: the three methods.

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
pub use frame::{JITTERS, Occlusion, most_pixels};

use crate::trace::{Detected, Kernel, Simd, WIDE};
use curitiba_pipeline::backend::EffectJob;
use curitiba_pipeline::raster_effects::EffectProgram;
pub use lanes::power;
use pixels::Pixels;

/// Number of pixels that are computed together.
pub const SPAN: usize = WIDE;

/// A method of ambient occlusion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// By horizon angles.
    Horizons,
    /// By visibility bitmasks: samples shut (occlude) sectors of a slice.
    Bitmask,
    /// By depth differences.
    Depths,
}

impl Method {
    /// The method that a job's program and parameters select.
    #[must_use]
    pub fn of(job: &EffectJob<'_>) -> Self {
        match job.program {
            EffectProgram::DepthOcclusion => Self::Depths,
            _ if job.params.bitmask => Self::Bitmask,
            _ => Self::Horizons,
        }
    }
}

/// The open share of [`SPAN`] pixels of row `y` from column `x` on, to the power of the intensity; 1 in the background.
/// Values beyond the row's end are meaningless.
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
