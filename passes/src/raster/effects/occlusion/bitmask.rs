//! Ambient occlusion by visibility bitmasks.
#![allow(clippy::needless_range_loop, reason = "a lane indexes several arrays side by side")]

use super::frame::Occlusion;
use super::horizons::{Plane, SIDES, left};
use super::lanes::{Lanes, angle};
use super::pixels::{Pixels, whole_part};
use crate::trace::{F16, Simd, WIDE};
use std::f32::consts::PI;

/// Sectors of a slice, one bit each.
pub const SECTORS: u32 = u32::BITS;

/// How the contribution of a slice is divided into sectors.
struct Sectors {
    /// The contribution of the whole slice, `cos γ + γ sin γ`.
    whole: Lanes,
    /// For each side, the contribution between `V` and the tangent plane.
    limit: [Lanes; 2],
    /// Relative position inside a sector of the angle that is tested, 0..1.
    jitter: Lanes,
}

/// The open share of the cosine-weighted hemisphere within the radius. Each surface seen counts as `thickness` deep, with
/// open space behind it.
///
/// Therrien, Levesque and Gilet, "Screen Space Indirect Lighting with Visibility Bitmask", The Visual Computer 39,
/// 2023: a slice is divided into sectors, and each sample seen shuts the sectors between its front and its back. A
/// horizon would shut all sectors below it; with bitmasks, light passes behind a post. Steps and slice weights are those
/// of the method by horizons. The differences from the paper:
/// - Sectors have equal contributions, not equal angles, so a slice's share is the number of its open sectors. The
///   contribution from `V` to an angle `h` is `arc(h)` of the horizons.
/// - Each sector is tested at a single angle, and is shut if that angle is hidden. The angle's place within its sector is
///   random for each pixel, so nothing is rounded to whole sectors.
/// - The back of a sample lies behind its front along the line from the eye, not along `V`.
/// - Only the part of a sample within the radius counts, as a ray as long as the radius would meet only that part. The
///   part may begin behind the front.
#[inline(always)]
pub(super) fn open<S: Simd>(simd: S, occlusion: &Occlusion<'_>, pixels: &Pixels) -> Lanes {
    let (mut taken, mut all) = ([0.0; WIDE], [0.0; WIDE]);
    let mut eye = [0.0; WIDE];
    for lane in 0..WIDE {
        let [x, y, z] = &pixels.position;
        let to = [occlusion.eye.x - x.0[lane], occlusion.eye.y - y.0[lane], occlusion.eye.z - z.0[lane]];
        eye[lane] = (to[0] * to[0] + to[1] * to[1] + to[2] * to[2]).sqrt();
    }
    let slices = occlusion.turns.len();
    for index in 0..slices {
        let slice = pixels.slice(occlusion, index);
        let plane = Plane::new(occlusion, pixels, &slice);
        let sectors = Sectors::new(&plane, pixels, index as f32 / slices as f32);
        for lane in 0..WIDE {
            all[lane] += plane.weight[lane] * sectors.whole[lane];
        }
        if !plane.any_step_counts() {
            continue;
        }
        let mut shut = [0; WIDE];
        for side in 0..2 {
            plane.each_step(simd, occlusion, pixels, &slice, side, SIDES[side], |seen| {
                sectors.shut(occlusion, pixels, &plane, seen, side, &eye, &mut shut);
            });
        }
        for lane in 0..WIDE {
            let share = shut[lane].count_ones() as f32 * (1.0 / SECTORS as f32);
            taken[lane] += plane.weight[lane] * sectors.whole[lane] * share;
        }
    }
    left(pixels, &taken, &all)
}

impl Sectors {
    /// The sectors of a slice; `turn` is the slice's index over the number of slices, 0..1.
    #[inline(always)]
    fn new(plane: &Plane, pixels: &Pixels, turn: f32) -> Self {
        const NONE: Lanes = [0.0; WIDE];
        let mut sectors = Self { whole: NONE, limit: [NONE; 2], jitter: NONE };
        let tilt = plane.tilt();
        for lane in 0..WIDE {
            let (cos, sin) = (plane.normal[0][lane], plane.normal[1][lane]);
            sectors.whole[lane] = cos + tilt[lane] * sin;
            for side in 0..2 {
                let towards = SIDES[side];
                let (sin, tilt) = (towards * sin, towards * tilt[lane]);
                sectors.limit[side][lane] = 0.25 * (2.0 * cos + (PI + 2.0 * tilt) * sin);
            }
            let jitter = pixels.jitter[lane] + turn;
            sectors.jitter[lane] = if jitter < 1.0 { jitter } else { jitter - 1.0 };
        }
        sectors
    }

    /// Shuts the sectors that a sample, a position of the G-buffer, hides.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "a step of a side of a slice, and what it changes")]
    fn shut(
        &self,
        occlusion: &Occlusion<'_>,
        pixels: &Pixels,
        plane: &Plane,
        [px, py, pz, pw]: &[F16; 4],
        side: usize,
        eye: &Lanes,
        shut: &mut [u32; WIDE],
    ) {
        let towards = SIDES[side];
        let [across, up] = &plane.along;
        for lane in 0..WIDE {
            let seen = [px.0[lane], py.0[lane], pz.0[lane]];
            let something = (seen[0] != 0.0) | (seen[1] != 0.0) | (seen[2] != 0.0) | (pw.0[lane] != 0.0);
            let dx = seen[0] - pixels.position[0].0[lane];
            let dy = seen[1] - pixels.position[1].0[lane];
            let dz = seen[2] - pixels.position[2].0[lane];
            let x = towards * (dx * across[0][lane] + dy * across[1][lane] + dz * across[2][lane]);
            let y = dx * up[0][lane] + dy * up[1][lane] + dz * up[2][lane];
            // Direction of the line from the eye, which is at (0, eye) in the plane, to the sample.
            let away = y - eye[lane];
            let scale = 1.0 / (x * x + away * away).sqrt();
            let (step_x, step_y) = (x * scale, away * scale);
            // Distances from the sample, along that direction, at which the line enters and leaves the disk of the radius around the pixel's
            // position.
            let middle = x * step_x + y * step_y;
            let inside = middle * middle + (occlusion.radius * occlusion.radius - (x * x + y * y));
            let chord = if inside > 0.0 { inside } else { 0.0 };
            let chord = chord.sqrt();
            let first = -middle - chord;
            let first = if first > 0.0 { first } else { 0.0 };
            let last = chord - middle;
            let last = if last < occlusion.thickness { last } else { occlusion.thickness };
            // For the pixel itself all differences are 0.
            let found = something & (x > 0.0) & (inside > 0.0) & (last > first);
            let a = self.part(plane, side, lane, x + first * step_x, y + first * step_y);
            let b = self.part(plane, side, lane, x + last * step_x, y + last * step_y);
            let (low, high) = if a < b { (a, b) } else { (b, a) };
            let mask = below(high) & !below(low);
            shut[lane] |= if found { mask } else { 0 };
        }
    }

    /// The number of sectors, 0..=32, whose tested angle lies before the direction `(x, y)` of a side. Sectors are counted from the tangent
    /// plane on side 1 to that on side 0. The caller truncates the number.
    #[inline(always)]
    fn part(&self, plane: &Plane, side: usize, lane: usize, x: f32, y: f32) -> f32 {
        let (cos, sin) = (plane.normal[0][lane], SIDES[side] * plane.normal[1][lane]);
        let direction = angle(x, y);
        let [cos_2h, sin_2h] = direction.double;
        // `arc` of the horizons: (cos γ - cos(2h - γ) + 2h sin γ) / 4.
        let arc = 0.25 * (cos - (cos_2h * cos + sin_2h * sin) + 2.0 * direction.angle * sin);
        let limit = self.limit[side][lane];
        // At the tangent plane and below it, the limit.
        let arc = if x * sin + y * cos > 0.0 { arc } else { limit };
        let place = if side == 0 { self.limit[1][lane] + arc } else { self.limit[1][lane] - arc };
        let part = place / self.whole[lane] * SECTORS as f32 - self.jitter[lane] + 1.0;
        let part = if part > 0.0 { part } else { 0.0 };
        if part < SECTORS as f32 { part } else { SECTORS as f32 }
    }
}

/// A mask of the lowest bits: as many as the integer part of `count`, 0..=32.
#[inline(always)]
fn below(count: f32) -> u32 {
    let count = whole_part(count);
    if count == 0 { 0 } else { u32::MAX >> ((SECTORS - count) & (SECTORS - 1)) }
}
