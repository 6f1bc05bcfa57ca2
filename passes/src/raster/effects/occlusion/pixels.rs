//! Sixteen pixels of a row, and one slice through each of them.
#![allow(clippy::needless_range_loop, reason = "a lane indexes several arrays side by side")]

use super::frame::{JITTERS, Occlusion};
use super::lanes::{Lanes, half_turn};
use crate::sampling::hash::{fraction, occlusion_bits, unit};
use crate::trace::{F16, Simd, WIDE};

/// Steps whose pixels are found before the first of them is read, so that several reads are in flight at a time.
pub(super) const AHEAD: usize = 8;

/// Sixteen pixels of a row. Each vector is kept as one array per axis.
pub(super) struct Pixels {
    /// Indices into the G-buffer; lanes beyond the row's end repeat the row's last pixel.
    pub(super) index: [u32; WIDE],
    /// 1 where there is a surface, else 0.
    pub(super) shown: Lanes,
    pub(super) position: [F16; 3],
    /// The unit normal, negated if it points away from the eye.
    pub(super) normal: [Lanes; 3],
    /// Unit vectors: `V` to the eye, and two across the view.
    pub(super) basis: [[Lanes; 3]; 3],
    /// Components of the normal in [`Self::basis`].
    pub(super) tilt: [Lanes; 3],
    /// Random words, from which the jitters of a slice's two sides derive.
    seeds: [[u32; WIDE]; 2],
    /// Column and row of the position in the picture, and its `w`.
    place: [Lanes; 3],
    /// Change of the place per unit of length along each of the two vectors across, in columns, in rows and of `w`.
    rates: [[Lanes; 3]; 2],
    /// Cosine and sine of the first slice's angle.
    turn: [Lanes; 2],
    /// A random number, 0..1: the second random word.
    pub(super) jitter: Lanes,
}

/// One slice through each of sixteen pixels.
pub(super) struct Slice {
    /// Cosine and sine of the slice's angle in the basis.
    pub(super) turn: [Lanes; 2],
    /// Unit direction of `T` in the picture, in columns and rows.
    along: [Lanes; 2],
    /// The position `P + r T` is seen `g r / (w + d r)` pixels away from the pixel's own place: this is `g`, then `d`.
    rate: [Lanes; 2],
    /// Length along `T` that covers one pixel of the picture.
    pub(super) pixel: Lanes,
    /// Relative position of the steps of each side in their interval, 0..1.
    pub(super) jitter: [Lanes; 2],
}

impl Pixels {
    /// The sixteen pixels of row `y` from column `x` on.
    #[inline(always)]
    pub(super) fn new<S: Simd>(simd: S, occlusion: &Occlusion<'_>, x: u32, y: u32) -> Self {
        const NONE: Lanes = [0.0; WIDE];
        let (mut index, mut bits) = ([0; WIDE], [[0; WIDE]; 4]);
        for lane in 0..WIDE {
            let column = (x + lane as u32).min(occlusion.width - 1);
            index[lane] = y * occlusion.width + column;
            let words = occlusion_bits(column, y, occlusion.seed);
            for word in 0..4 {
                bits[word][lane] = words[word];
            }
        }
        let position: [F16; 3] = simd.gather(occlusion.position, &index);
        let normals: [F16; 3] = simd.gather(occlusion.normal, &index);
        let mut pixels = Self {
            index,
            shown: NONE,
            position,
            normal: [NONE; 3],
            basis: [[NONE; 3]; 3],
            tilt: [NONE; 3],
            seeds: [bits[2], bits[3]],
            place: [NONE; 3],
            rates: [[NONE; 3]; 2],
            turn: [NONE; 2],
            jitter: NONE,
        };
        for lane in 0..WIDE {
            let p = [position[0].0[lane], position[1].0[lane], position[2].0[lane]];
            let n = [normals[0].0[lane], normals[1].0[lane], normals[2].0[lane]];
            let to = [occlusion.eye.x - p[0], occlusion.eye.y - p[1], occlusion.eye.z - p[2]];
            let scales = [1.0 / dot(to, to).sqrt(), 1.0 / dot(n, n).sqrt()];
            // As in `effects::facing`: the lengths are not 0, not infinite and not NaN.
            let usable =
                (scales[0] > 0.0) & (scales[0] < f32::INFINITY) & (scales[1] > 0.0) & (scales[1] < f32::INFINITY);
            pixels.shown[lane] = if usable { 1.0 } else { 0.0 };
            let v = [to[0] * scales[0], to[1] * scales[0], to[2] * scales[0]];
            let scale = if dot(n, v) < 0.0 { -scales[1] } else { scales[1] };
            let n = [n[0] * scale, n[1] * scale, n[2] * scale];
            // The basis of `sampling::hemisphere::Basis::around`.
            let sign = 1f32.copysign(v[2]);
            let a = -1.0 / (sign + v[2]);
            let b = v[0] * v[1] * a;
            let t = [1.0 + sign * v[0] * v[0] * a, sign * b, -sign * v[0]];
            let s = [b, sign + v[1] * v[1] * a, -v[1]];
            for axis in 0..3 {
                pixels.normal[axis][lane] = n[axis];
                pixels.basis[0][axis][lane] = v[axis];
                pixels.basis[1][axis][lane] = t[axis];
                pixels.basis[2][axis][lane] = s[axis];
            }
            pixels.tilt[0][lane] = dot(n, v);
            pixels.tilt[1][lane] = dot(n, t);
            pixels.tilt[2][lane] = dot(n, s);
        }
        let [columns, rows, depths] = occlusion.rows;
        for lane in 0..WIDE {
            // Positions relative to the eye keep digits that are lost for a camera far from the origin.
            let p = [
                position[0].0[lane] - occlusion.from.x,
                position[1].0[lane] - occlusion.from.y,
                position[2].0[lane] - occlusion.from.z,
            ];
            let w = along(depths, p) + depths[3];
            let place = [(along(columns, p) + columns[3]) / w, (along(rows, p) + rows[3]) / w];
            pixels.place[0][lane] = place[0];
            pixels.place[1][lane] = place[1];
            pixels.place[2][lane] = w;
            for side in 0..2 {
                let [x, y, z] = &pixels.basis[1 + side];
                let across = [x[lane], y[lane], z[lane]];
                let d = along(depths, across);
                pixels.rates[side][0][lane] = along(columns, across) - place[0] * d;
                pixels.rates[side][1][lane] = along(rows, across) - place[1] * d;
                pixels.rates[side][2][lane] = d;
            }
        }
        let share = 1.0 / occlusion.turns.len() as f32;
        for lane in 0..WIDE {
            let [sin, cos] = half_turn(unit(bits[0][lane]) * share);
            pixels.jitter[lane] = unit(bits[1][lane]);
            pixels.turn[0][lane] = cos;
            pixels.turn[1][lane] = sin;
        }
        pixels
    }

    /// Whether any of the pixels shows a surface.
    #[inline(always)]
    pub(super) fn any_shown(&self) -> bool {
        let mut any = 0.0;
        for lane in 0..WIDE {
            any += self.shown[lane];
        }
        any > 0.0
    }

    /// Slice `index` of each pixel.
    #[inline(always)]
    pub(super) fn slice(&self, occlusion: &Occlusion<'_>, index: usize) -> Slice {
        const NONE: Lanes = [0.0; WIDE];
        let mut slice = Slice { turn: [NONE; 2], along: [NONE; 2], rate: [NONE; 2], pixel: NONE, jitter: [NONE; 2] };
        let turned = occlusion.turns[index];
        for lane in 0..WIDE {
            let (cos, sin) = (self.turn[0][lane], self.turn[1][lane]);
            let (cos, sin) = (cos * turned[0] - sin * turned[1], sin * turned[0] + cos * turned[1]);
            let [tangent, bitangent] = &self.rates;
            let x = tangent[0][lane] * cos + bitangent[0][lane] * sin;
            let y = tangent[1][lane] * cos + bitangent[1][lane] * sin;
            slice.turn[0][lane] = cos;
            slice.turn[1][lane] = sin;
            let length = (x * x + y * y).sqrt();
            slice.along[0][lane] = x / length;
            slice.along[1][lane] = y / length;
            slice.rate[0][lane] = length;
            slice.rate[1][lane] = tangent[2][lane] * cos + bitangent[2][lane] * sin;
            slice.pixel[lane] = self.place[2][lane] / length;
        }
        for side in 0..2 {
            let moved = JITTERS[side].wrapping_mul(index as u32);
            for lane in 0..WIDE {
                slice.jitter[side][lane] = fraction(self.seeds[side][lane].wrapping_add(moved));
            }
        }
        slice
    }

    /// Distance in pixels at which the position at distance `reach` along the slice is seen. It is at most [`Occlusion::most`], and exactly
    /// that for a position behind the eye. `towards` is the sign of the slice's side.
    #[inline(always)]
    pub(super) fn pixels_to(
        &self,
        occlusion: &Occlusion<'_>,
        slice: &Slice,
        reach: f32,
        towards: f32,
        lane: usize,
    ) -> f32 {
        let w = self.place[2][lane] + towards * slice.rate[1][lane] * reach;
        let pixels = reach * slice.rate[0][lane] / w;
        if (w > 0.0) & (pixels < occlusion.most) { pixels } else { occlusion.most }
    }

    /// For each lane, the index of the pixel that is `pixels(lane)` pixels along the slice; the lane's own pixel if that is outside the picture.
    #[inline(always)]
    pub(super) fn look(&self, occlusion: &Occlusion<'_>, slice: &Slice, pixels: impl Fn(usize) -> f32) -> [u32; WIDE] {
        let (width, height) = (occlusion.width as f32, occlusion.height as f32);
        let mut index = self.index;
        for lane in 0..WIDE {
            let pixels = pixels(lane);
            let x = self.place[0][lane] + slice.along[0][lane] * pixels;
            let y = self.place[1][lane] + slice.along[1][lane] * pixels;
            let inside = (x >= 0.0) & (x < width) & (y >= 0.0) & (y < height);
            let found = whole_part(y).wrapping_mul(occlusion.width).wrapping_add(whole_part(x));
            index[lane] = if inside { found } else { self.index[lane] };
        }
        index
    }
}

/// The integer part of `x` in 0..2²³; any value for other `x`. Unlike `as`, it has no range test for each number.
#[inline(always)]
pub(super) fn whole_part(x: f32) -> u32 {
    // Adding this rounds to an integer, which the sum holds in its low bits.
    const ROUND: f32 = 8_388_608.0;
    let rounded = x + ROUND;
    let above = if rounded - ROUND > x { 1 } else { 0 };
    (rounded.to_bits() & 0x007f_ffff).wrapping_sub(above)
}

/// The dot product of the first three numbers of a matrix row with a vector.
#[inline(always)]
fn along(row: [f32; 4], v: [f32; 3]) -> f32 {
    row[0] * v[0] + row[1] * v[1] + row[2] * v[2]
}

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
