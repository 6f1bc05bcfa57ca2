//! The unblocked exchange of two polygons: `∫∫ cos cos / (π r²)` over both areas, which is an area times a form factor.
//!
//! By Stokes' theorem it is `1/2π ∮∮ ln r dp · dq` over both borders (Lambert 1760; Sparrow, "A New and Simpler Formulation for Radiative
//! Angle Factors", 1963).

use super::shaft::Polygon;
use crate::trace::{Detected, Kernel, Simd};
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, LN_2, PI, SQRT_2, TAU};

/// Nodes that are evaluated together.
const NODES: usize = 8;
/// Nodes of the eight-point Gauss-Legendre rule on [0, 1].
const AT: [f64; NODES] = [
    0.019_855_071_751_231_856,
    0.101_666_761_293_186_63,
    0.237_233_795_041_835_5,
    0.408_282_678_752_175_1,
    0.591_717_321_247_825,
    0.762_766_204_958_164_5,
    0.898_333_238_706_813_4,
    0.980_144_928_248_768_1,
];
/// Weights of these nodes.
const WEIGHT: [f64; NODES] = [
    0.050_614_268_145_188_13,
    0.111_190_517_226_687_24,
    0.156_853_322_938_943_64,
    0.181_341_891_689_181,
    0.181_341_891_689_181,
    0.156_853_322_938_943_64,
    0.111_190_517_226_687_24,
    0.050_614_268_145_188_13,
];
/// Greatest number of halvings of an edge: towards singular ends the parts shrink until they no longer matter.
const DEEP: u32 = 30;

/// The exchange of two polygons: the area of the first times its form factor to the second. Each must lie in front of the other.
pub(super) fn exchange(p: &Polygon, q: &Polygon) -> f64 {
    let size = p.corners().iter().chain(q.corners()).fold(0.0_f64, |size, corner| size.max(corner.abs().max_element()));
    let least = 1e-9 * p.area().min(q.area());
    let mut sum = 0.0;
    for (from, to) in p.edges() {
        let along = to - from;
        for (start, end) in q.edges() {
            let cosine = along.dot(end - start);
            // A polygon that was cut where it touches a plane has edges of length zero.
            let short = along.length().min(start.distance(end)) <= 1e-13 * size;
            if cosine != 0.0 && !short {
                sum += cosine * mean_log((from, along), (start, end - start), least / cosine.abs(), size);
            }
        }
    }
    (sum / TAU).abs()
}

/// `∫∫ ln |p + s u - q - t v| ds dt` over s and t in 0..1.
fn mean_log((p, u): (DVec3, DVec3), (q, v): (DVec3, DVec3), least: f64, size: f64) -> f64 {
    let length = v.length();
    let unit = v / length;
    let off = |point: DVec3| {
        let to = point - q;
        (to - to.dot(unit) * unit).length()
    };
    if off(p) + off(p + u) <= 1e-14 * size {
        // Both edges on one line, as for two faces that share an edge: closed form.
        let (c, d) = ((p - q).dot(unit), (p + u - q).dot(unit));
        let twice = |x: f64| if x == 0.0 { 0.0 } else { x * x * (0.5 * x.abs().ln() - 0.75) };
        return (twice(d) - twice(c) - twice(d - length) + twice(c - length)) / (length * (d - c));
    }
    let inner = Inner { start: p - q, along: u, unit, length };
    // Rounding error of the inner integral: it is a difference of terms as large as the distance in units of the edge length.
    let noise = 1e-14 * (1.0 + size / length) * (1.0 + size.ln().abs() + length.ln().abs());
    let whole = inner.mean(0.0, 1.0);
    inner.halve((0.0, 1.0), whole, (least, noise), DEEP)
}

/// The mean of `ln r` over one edge, for a point that moves along the other edge.
struct Inner {
    /// Start of the point's path, relative to the start of the edge.
    start: DVec3,
    /// The point's path: from `start` to `start + along`.
    along: DVec3,
    /// Direction and length of the edge.
    unit: DVec3,
    length: f64,
}

impl Inner {
    /// The integral over the part from `from` to `to` of the path (0 to 1), by eight points.
    fn mean(&self, from: f64, to: f64) -> f64 {
        Detected::cached().run(Nodes { inner: self, from, width: to - from })
    }

    /// Halves an interval until the halves agree with the whole, within `least` or within the rounding error.
    fn halve(&self, (from, to): (f64, f64), whole: f64, (least, noise): (f64, f64), deep: u32) -> f64 {
        let middle = 0.5 * (from + to);
        let (low, high) = (self.mean(from, middle), self.mean(middle, to));
        let both = low + high;
        if deep == 0 || (both - whole).abs() <= least.max(noise * (to - from)) {
            return both;
        }
        let limits = (0.5 * least, noise);
        self.halve((from, middle), low, limits, deep - 1) + self.halve((middle, to), high, limits, deep - 1)
    }
}

struct Nodes<'a> {
    inner: &'a Inner,
    from: f64,
    width: f64,
}

impl Kernel<f64> for Nodes<'_> {
    /// Let `a` be the position, along the edge, of the foot of the perpendicular from the point to the edge's line, and `h` the
    /// perpendicular's length. The integral of `ln √(x² + h²)` from `-a` to `b = length - a` is `(b ln(b² + h²) + a ln(a² + h²)) / 2 -
    /// length + h (atan(b/h) + atan(a/h))`; the sum of the two arctangents is one angle with the tangent `h length / (h² - a b)`.
    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> f64 {
        let Self { inner: Inner { start, along, unit, length }, from, width } = self;
        let (mut foot, mut rest, mut height) = ([0.0; NODES], [0.0; NODES], [0.0; NODES]);
        let (mut near, mut far, mut square) = ([0.0; NODES], [0.0; NODES], [0.0; NODES]);
        for lane in 0..NODES {
            let s = from + width * AT[lane];
            let (x, y, z) = (start.x + s * along.x, start.y + s * along.y, start.z + s * along.z);
            let a = x * unit.x + y * unit.y + z * unit.z;
            let (x, y, z) = (x - a * unit.x, y - a * unit.y, z - a * unit.z);
            square[lane] = x * x + y * y + z * z;
            height[lane] = square[lane].sqrt();
            foot[lane] = a;
            rest[lane] = length - a;
            near[lane] = a * a + square[lane];
            far[lane] = rest[lane] * rest[lane] + square[lane];
        }
        let (near, far) = (logarithms(&near), logarithms(&far));
        let (mut across, mut down) = ([0.0; NODES], [0.0; NODES]);
        for lane in 0..NODES {
            across[lane] = height[lane] * length;
            down[lane] = square[lane] - foot[lane] * rest[lane];
        }
        let arcs = arcs(&across, &down);
        let mut sum = 0.0;
        for lane in 0..NODES {
            let logs = 0.5 * (rest[lane] * far[lane] + foot[lane] * near[lane]);
            sum += WEIGHT[lane] * (logs - length + height[lane] * arcs[lane]);
        }
        sum * width / length
    }
}

/// Natural logarithms, to a few units in the last place. Values below the least normal number count as that number.
///
/// With `x = m 2^e`, m from √½ to √2, and `s = (m - 1) / (m + 1)` it is `e ln 2 + 2 (s + s³/3 + s⁵/5 + …)`.
#[inline(always)]
fn logarithms(values: &[f64; NODES]) -> [f64; NODES] {
    const TERMS: u32 = 11;
    const HALF_ROOT: u64 = (0.5 * SQRT_2).to_bits();
    let mut logs = [0.0; NODES];
    for lane in 0..NODES {
        let value = values[lane];
        let bits = if value > f64::MIN_POSITIVE { value } else { f64::MIN_POSITIVE }.to_bits();
        let exponent = (bits.wrapping_sub(HALF_ROOT) as i64) >> 52;
        let m = f64::from_bits(bits.wrapping_sub((exponent << 52) as u64));
        let s = (m - 1.0) / (m + 1.0);
        let square = s * s;
        let mut series = 0.0;
        for term in (0..TERMS).rev() {
            series = series * square + 1.0 / f64::from(2 * term + 1);
        }
        logs[lane] = exponent as f64 * LN_2 + 2.0 * s * series;
    }
    logs
}

/// The angles, from 0 to π, of points (`down`, `across`) with `across >= 0`, to a few units in the last place; π/2 at the origin.
///
/// Reduced by symmetry to π/8 around the axis, the angle is Gregory's series of a tangent of at most √2 - 1.
#[inline(always)]
fn arcs(across: &[f64; NODES], down: &[f64; NODES]) -> [f64; NODES] {
    const TERMS: u32 = 22;
    let mut arcs = [0.0; NODES];
    for lane in 0..NODES {
        let (y, x) = (across[lane], down[lane].abs());
        let (low, high) = if y < x { (y, x) } else { (x, y) };
        // Reflected at the diagonal if the tangent is above √2 - 1.
        let turned = low > (SQRT_2 - 1.0) * high;
        let above = if turned { low - high } else { low };
        let below = if turned { low + high } else { high };
        let tangent = above / if below > f64::MIN_POSITIVE { below } else { f64::MIN_POSITIVE };
        let square = tangent * tangent;
        let mut series = 0.0;
        for term in (0..TERMS).rev() {
            let sign = if term % 2 == 0 { 1.0 } else { -1.0 };
            series = series * square + sign / f64::from(2 * term + 1);
        }
        let arc = tangent * series + if turned { FRAC_PI_4 } else { 0.0 };
        let arc = if y < x { arc } else { FRAC_PI_2 - arc };
        arcs[lane] = if down[lane] < 0.0 { PI - arc } else { arc };
    }
    arcs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithms_and_arcs_are_those_of_the_standard_library() {
        let mut worst = [0.0_f64; 2];
        for step in 0..20_000 {
            let value = (f64::from(step) * 0.0137 - 137.0).exp2();
            let logs = logarithms(&[value; NODES]);
            worst[0] = worst[0].max((logs[3] - value.ln()).abs() / value.ln().abs().max(1e-3));
            let angle = f64::from(step) * (PI / 20_000.0);
            let size = 1.0 + f64::from(step % 7);
            let (y, x) = (size * angle.sin(), size * angle.cos());
            let found = arcs(&[y; NODES], &[x; NODES])[5];
            worst[1] = worst[1].max((found - y.atan2(x)).abs());
        }
        assert!(worst[0] < 2e-15 && worst[1] < 1e-15, "{worst:?}");
        assert_eq!(arcs(&[0.0; NODES], &[0.0; NODES])[0], FRAC_PI_2);
        assert_eq!(arcs(&[0.0; NODES], &[-2.0; NODES])[0], PI);
        assert!(logarithms(&[0.0; NODES])[0] < -700.0);
    }
}
