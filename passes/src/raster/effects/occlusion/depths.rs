//! Ambient occlusion by depth differences.
#![allow(clippy::needless_range_loop, reason = "a lane indexes several arrays side by side")]

use super::frame::Occlusion;
use super::horizons::SIDES;
use super::lanes::Lanes;
use super::pixels::{AHEAD, Pixels};
use crate::trace::{F16, Simd, WIDE, higher};

/// Height above the tangent plane from which a sample occludes, in radii. It separates an occluder from the surface
/// itself where the shading normal is some degrees off the surface's plane.
pub const DEPTH_TOLERANCE: f32 = 0.1;

/// The open share of the samples around the pixel, by the difference of depths.
///
/// A sample occludes where it is on the camera's side of the tangent plane by more than [`DEPTH_TOLERANCE`] radii and the rounding error.
/// There is no range check (Mittring, "Finding Next Gen: CryEngine 2", SIGGRAPH 2007 course, section 8.5.4.3, has one),
/// so a distant object in front darkens what is behind its outline. Samples are uniform in the disk of the radius
/// across the view; samples outside the picture, and those in the pixel itself, do not count.
#[inline(always)]
pub(super) fn open<S: Simd>(simd: S, occlusion: &Occlusion<'_>, pixels: &Pixels) -> Lanes {
    let mut tolerance = [0.0; WIDE];
    for lane in 0..WIDE {
        let [x, y, z] = &pixels.position;
        let largest = higher(x.0[lane].abs(), higher(y.0[lane].abs(), z.0[lane].abs()));
        tolerance[lane] = higher(DEPTH_TOLERANCE * occlusion.radius, 4.0 * f32::EPSILON * largest);
    }
    let steps = occlusion.steps as usize;
    let interval = 1.0 / occlusion.steps as f32;
    // Integers in `f32`, exact up to 2²⁴; there are at most 8192 samples.
    let (mut occluded, mut samples) = ([0.0; WIDE], [0.0; WIDE]);
    for index in 0..occlusion.turns.len() {
        let slice = pixels.slice(occlusion, index);
        for side in 0..2 {
            let towards = SIDES[side];
            let mut first = 0;
            while first < steps {
                let count = AHEAD.min(steps - first);
                let mut ahead = [[0; WIDE]; AHEAD];
                for step in 0..count {
                    let step_index = (first + step) as f32;
                    ahead[step] = pixels.look(occlusion, &slice, |lane| {
                        let reach = occlusion.radius * ((step_index + slice.jitter[side][lane]) * interval).sqrt();
                        towards * pixels.pixels_to(occlusion, &slice, reach, towards, lane)
                    });
                }
                for step in 0..count {
                    let seen: [F16; 4] = simd.gather(occlusion.position, &ahead[step]);
                    count_above(pixels, &seen, &tolerance, &mut occluded);
                    for lane in 0..WIDE {
                        samples[lane] += if ahead[step][lane] != pixels.index[lane] { 1.0 } else { 0.0 };
                    }
                }
                first += AHEAD;
            }
        }
    }
    let mut open = [1.0; WIDE];
    for lane in 0..WIDE {
        let share = 1.0 - occluded[lane] / if samples[lane] > 0.0 { samples[lane] } else { 1.0 };
        open[lane] = if pixels.shown[lane] > 0.0 { share } else { 1.0 };
    }
    open
}

/// Counts the lanes whose sample, a position of the G-buffer, is above the tangent plane by more than the tolerance.
#[inline(always)]
fn count_above(pixels: &Pixels, [px, py, pz, pw]: &[F16; 4], tolerance: &Lanes, occluded: &mut Lanes) {
    for lane in 0..WIDE {
        let seen = [px.0[lane], py.0[lane], pz.0[lane]];
        let something = (seen[0] != 0.0) | (seen[1] != 0.0) | (seen[2] != 0.0) | (pw.0[lane] != 0.0);
        let dx = seen[0] - pixels.position[0].0[lane];
        let dy = seen[1] - pixels.position[1].0[lane];
        let dz = seen[2] - pixels.position[2].0[lane];
        let height = dx * pixels.normal[0][lane] + dy * pixels.normal[1][lane] + dz * pixels.normal[2][lane];
        let finite = dx.abs() + dy.abs() + dz.abs() < f32::INFINITY;
        let above = something & finite & (height > tolerance[lane]);
        occluded[lane] += if above { 1.0 } else { 0.0 };
    }
}
