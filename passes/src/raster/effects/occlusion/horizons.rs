//! Ambient occlusion by horizons.
#![allow(clippy::needless_range_loop, reason = "a lane indexes several arrays side by side")]

use super::frame::Occlusion;
use super::lanes::{Lanes, angle};
use super::pixels::{AHEAD, Pixels, Slice};
use crate::trace::{F16, Simd, WIDE};
use std::f32::consts::PI;

/// Squared weight below which a slice does not count, because the normal is almost perpendicular to its plane.
const LEAST_WEIGHT: f32 = 1e-6;

/// The two sides of a slice: the sign of their direction along `T`.
pub(super) const SIDES: [f32; 2] = [1.0, -1.0];

/// The plane of a slice.
pub(super) struct Plane {
    /// For the axes `T` and `V`: the vector whose scalar product with a difference of positions is its component along
    /// that axis, after the difference is moved into the slice's plane along the tangent plane.
    pub(super) along: [[Lanes; 3]; 2],
    /// Length of the normal's projection into the plane: the slice's weight. 0 where the slice does not count.
    pub(super) weight: Lanes,
    /// Cosine and sine of the projected normal's angle `γ` from `V` towards `T`.
    pub(super) normal: [Lanes; 2],
    /// Pixels from the nearest step, which is one pixel away, to the end of the radius, for each side. NaN where no step counts.
    span: [Lanes; 2],
}

/// The open share of the cosine-weighted hemisphere within the radius, by horizons.
///
/// Jimenez, Wu, Pesce and Jarabo, "Practical Real-Time Strategies for Accurate Indirect Occlusion", SIGGRAPH 2016 course,
/// section 4: with horizons `h1 <= 0 <= h2` and the projected normal's angle `γ`, all measured from `V`, a slice
/// contributes `|n_p| (arc(h1) + arc(h2))`, `arc(h) = (-cos(2h - γ) + cos γ + 2h sin γ) / 4`. What differs here:
/// - Slices are uniform in the angle around `V`, not in the picture's angle.
/// - Where a pixel's centre is off the slice's plane, its position is moved into the plane along the tangent plane. So
///   a flat surface seen at a grazing angle does not occlude itself.
/// - Positions farther than the radius in that plane are ignored, without a falloff, as a ray of this length would not
///   reach them.
/// - The sum is divided by the sum for unoccluded slices, `|n_p| (cos γ + γ sin γ)`, not by the number of slices. The
///   parts that horizons take away are summed, so that an open plane is exactly 1.
/// - A horizon is kept as a direction `(x, y)` along `T` and `V`, and compared by `y / x`: no root and no quotient in a
///   step.
#[inline(always)]
pub(super) fn open<S: Simd>(simd: S, occlusion: &Occlusion<'_>, pixels: &Pixels) -> Lanes {
    let (mut taken, mut whole) = ([0.0; WIDE], [0.0; WIDE]);
    for index in 0..occlusion.turns.len() {
        let slice = pixels.slice(occlusion, index);
        let plane = Plane::new(occlusion, pixels, &slice);
        let tilt = plane.tilt();
        for lane in 0..WIDE {
            let (cos, sin) = (plane.normal[0][lane], plane.normal[1][lane]);
            whole[lane] += plane.weight[lane] * (cos + tilt[lane] * sin);
        }
        if !plane.any_step_counts() {
            continue;
        }
        for side in 0..2 {
            let towards = SIDES[side];
            if let Some(horizon) = plane.horizon(simd, occlusion, pixels, &slice, side, towards) {
                plane.take(&horizon, towards, &tilt, &mut taken);
            }
        }
    }
    left(pixels, &taken, &whole)
}

/// The open share `1 - taken / whole`, 0..=1; 1 in the background and where no slice counts.
#[inline(always)]
pub(super) fn left(pixels: &Pixels, taken: &Lanes, whole: &Lanes) -> Lanes {
    let mut open = [1.0; WIDE];
    for lane in 0..WIDE {
        let share = 1.0 - taken[lane] / whole[lane];
        let share = if share > 0.0 { share } else { 0.0 };
        let share = if share < 1.0 { share } else { 1.0 };
        open[lane] = if (whole[lane] > 0.0) & (pixels.shown[lane] > 0.0) { share } else { 1.0 };
    }
    open
}

impl Plane {
    #[inline(always)]
    pub(super) fn new(occlusion: &Occlusion<'_>, pixels: &Pixels, slice: &Slice) -> Self {
        const NONE: Lanes = [0.0; WIDE];
        let mut plane = Self { along: [[NONE; 3]; 2], weight: NONE, normal: [NONE; 2], span: [NONE; 2] };
        let mut nearest = NONE;
        for lane in 0..WIDE {
            let (cos, sin) = (slice.turn[0][lane], slice.turn[1][lane]);
            let (up, tangent, bitangent) = (pixels.tilt[0][lane], pixels.tilt[1][lane], pixels.tilt[2][lane]);
            // The normal's component along `T`, and its component off the slice's plane, along `V x T`.
            let (across, off) = (tangent * cos + bitangent * sin, bitangent * cos - tangent * sin);
            let squared = across * across + up * up;
            let counts = (squared >= LEAST_WEIGHT) & (pixels.shown[lane] > 0.0);
            let weight = squared.sqrt();
            plane.weight[lane] = if counts { weight } else { 0.0 };
            plane.normal[0][lane] = if counts { up / weight } else { 1.0 };
            plane.normal[1][lane] = if counts { across / weight } else { 0.0 };
            nearest[lane] = if counts & (slice.pixel[lane] < occlusion.radius) { 1.0 } else { f32::NAN };
            // A move of one unit along `V x T` within the tangent plane changes `T` and `V` by this factor times the
            // normal's components.
            let shear = off / squared;
            let [v, t, s] = &pixels.basis;
            for axis in 0..3 {
                let (t, s) = (t[axis][lane], s[axis][lane]);
                let aside = (s * cos - t * sin) * shear;
                plane.along[0][axis][lane] = t * cos + s * sin + aside * across;
                plane.along[1][axis][lane] = v[axis][lane] + aside * up;
            }
        }
        // The loop over sides is the outer one: a loop over lanes that contains it is not compiled to vector code.
        for (span, towards) in plane.span.iter_mut().zip(SIDES) {
            for lane in 0..WIDE {
                let ends = pixels.pixels_to(occlusion, slice, occlusion.radius, towards, lane);
                span[lane] = ends - nearest[lane];
            }
        }
        plane
    }

    /// The projected normal's angle `γ`.
    #[inline(always)]
    pub(super) fn tilt(&self) -> Lanes {
        let mut tilt = [0.0; WIDE];
        for lane in 0..WIDE {
            let (cos, sin) = (self.normal[0][lane], self.normal[1][lane]);
            let size = angle(sin.abs(), cos).angle;
            tilt[lane] = if sin < 0.0 { -size } else { size };
        }
        tilt
    }

    /// Whether in any lane the slice counts and the radius is longer than one pixel of the picture.
    #[inline(always)]
    pub(super) fn any_step_counts(&self) -> bool {
        let mut any = false;
        for lane in 0..WIDE {
            any |= !self.span[0][lane].is_nan();
        }
        any
    }

    /// The horizon on one side, as a direction `[x, y]`: `x` along `T`, or along `-T` on side 1,
    /// and `y` along `V`. `None` where in no lane
    /// anything rises above the tangent plane.
    #[inline(always)]
    fn horizon<S: Simd>(
        &self,
        simd: S,
        occlusion: &Occlusion<'_>,
        pixels: &Pixels,
        slice: &Slice,
        side: usize,
        towards: f32,
    ) -> Option<[Lanes; 2]> {
        // Clamped in case the square overflows: a position with a difference that is infinite or NaN is never within
        // reach.
        let farthest = (occlusion.radius * occlusion.radius).min(f32::MAX);
        let (mut x, mut y) = (self.normal[0], self.normal[1]);
        for lane in 0..WIDE {
            y[lane] *= -towards;
        }
        self.each_step(simd, occlusion, pixels, slice, side, towards, |seen| {
            self.raise(pixels, seen, towards, farthest, &mut x, &mut y);
        });
        let mut raised = false;
        for lane in 0..WIDE {
            raised |= (x[lane] != self.normal[0][lane]) | (y[lane] != -towards * self.normal[1][lane]);
        }
        raised.then_some([x, y])
    }

    /// Calls `see` with the sixteen positions of the G-buffer at each step of one side.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "what a slice of a pixel is, and which side of it")]
    pub(super) fn each_step<S: Simd>(
        &self,
        simd: S,
        occlusion: &Occlusion<'_>,
        pixels: &Pixels,
        slice: &Slice,
        side: usize,
        towards: f32,
        mut see: impl FnMut(&[F16; 4]),
    ) {
        let interval = 1.0 / occlusion.steps as f32;
        let steps = occlusion.steps as usize;
        let mut first = 0;
        while first < steps {
            let count = AHEAD.min(steps - first);
            let mut ahead = [[0; WIDE]; AHEAD];
            for step in 0..count {
                let step_index = (first + step) as f32;
                ahead[step] = pixels.look(occlusion, slice, |lane| {
                    // Steps are denser near the pixel.
                    let share = (step_index + slice.jitter[side][lane]) * interval;
                    towards * (1.0 + self.span[side][lane] * (share * share))
                });
            }
            for step in 0..count {
                see(&simd.gather(occlusion.position, &ahead[step]));
            }
            first += AHEAD;
        }
    }

    /// Raises the horizon `(x, y)` to a sample, a position of the G-buffer, that is above it and within reach.
    /// `farthest` is the square of the greatest distance.
    #[inline(always)]
    fn raise(
        &self,
        pixels: &Pixels,
        [px, py, pz, pw]: &[F16; 4],
        towards: f32,
        farthest: f32,
        x: &mut Lanes,
        y: &mut Lanes,
    ) {
        let [across, up] = &self.along;
        for lane in 0..WIDE {
            let seen = [px.0[lane], py.0[lane], pz.0[lane]];
            let something = (seen[0] != 0.0) | (seen[1] != 0.0) | (seen[2] != 0.0) | (pw.0[lane] != 0.0);
            let dx = seen[0] - pixels.position[0].0[lane];
            let dy = seen[1] - pixels.position[1].0[lane];
            let dz = seen[2] - pixels.position[2].0[lane];
            let to_side = towards * (dx * across[0][lane] + dy * across[1][lane] + dz * across[2][lane]);
            let upward = dx * up[0][lane] + dy * up[1][lane] + dz * up[2][lane];
            let within = to_side * to_side + upward * upward <= farthest;
            // The move into the plane may bring a near pixel to the other side. For the pixel itself all differences
            // are 0.
            let higher = (to_side > 0.0) & (upward * x[lane] > y[lane] * to_side);
            let found = something & within & higher;
            x[lane] = if found { to_side } else { x[lane] };
            y[lane] = if found { upward } else { y[lane] };
        }
    }

    /// Adds what a horizon takes away: `arc` at the tangent plane, `γ ± π / 2`, less `arc` at this horizon.
    #[inline(always)]
    fn take(&self, [x, y]: &[Lanes; 2], towards: f32, tilt: &Lanes, taken: &mut Lanes) {
        for lane in 0..WIDE {
            let (cos, sin) = (self.normal[0][lane], towards * self.normal[1][lane]);
            let raised = (x[lane] != cos) | (y[lane] != -sin);
            let horizon = angle(x[lane], y[lane]);
            let [cos_2h, sin_2h] = horizon.double;
            let turned = PI + 2.0 * (towards * tilt[lane] - horizon.angle);
            let loss = 0.25 * self.weight[lane] * (cos * (1.0 + cos_2h) + sin * (sin_2h + turned));
            taken[lane] += if raised { loss } else { 0.0 };
        }
    }
}
