//! What two polygons exchange with nothing between them: `∫∫ cos cos / (π r²)` over both areas, which is an area times a form factor.
//!
//! By Stokes' theorem it is `1/2π ∮∮ ln r dp · dq` over both borders (Lambert 1760; Sparrow, "A New and Simpler Formulation for
//! Radiative Angle Factors", 1963).

use super::shaft::Polygon;
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// Nodes and weights of Gauss and Legendre on [0, 1], eight points: the lower half.
const GAUSS: [(f64, f64); 4] = [
    (0.019_855_071_751_231_856, 0.050_614_268_145_188_13),
    (0.101_666_761_293_186_63, 0.111_190_517_226_687_24),
    (0.237_233_795_041_835_5, 0.156_853_322_938_943_64),
    (0.408_282_678_752_175_1, 0.181_341_891_689_181),
];
/// Halvings of an edge at most: singular ends are graded until they do not matter.
const DEEP: u32 = 30;
/// How far apart, in radii of the larger, triangles must be for the rule of [`apart`].
pub(super) const APART: f64 = 4.0;

/// The exchange of two polygons, the area of the first times its form factor to the second. Each must lie in front of the other.
pub(super) fn exchange(p: &Polygon, q: &Polygon) -> f64 {
    let size = p.corners().iter().chain(q.corners()).fold(0.0_f64, |size, corner| size.max(corner.abs().max_element()));
    let least = 1e-9 * p.area().min(q.area());
    let mut sum = 0.0;
    for (from, to) in p.edges() {
        let along = to - from;
        for (start, end) in q.edges() {
            let cosine = along.dot(end - start);
            // Cutting a polygon where it touches a plane leaves edges of no length.
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
        // On one line, as two faces that share an edge have it: in closed form.
        let (c, d) = ((p - q).dot(unit), (p + u - q).dot(unit));
        let twice = |x: f64| if x == 0.0 { 0.0 } else { x * x * (0.5 * x.abs().ln() - 0.75) };
        return (twice(d) - twice(c) - twice(d - length) + twice(c - length)) / (length * (d - c));
    }
    let inner = |s: f64| {
        let to = p + s * u - q;
        let a = to.dot(unit);
        let h = (to - a * unit).length();
        let part = |x: f64| {
            let square = x * x + h * h;
            let log = if square > 0.0 { 0.5 * x * square.ln() } else { 0.0 };
            let turn = if h > 0.0 { h * (x / h).atan() } else { 0.0 };
            log - x + turn
        };
        (part(length - a) - part(-a)) / length
    };
    // What rounding makes of the inner integral: a difference of terms as large as the distance in edges.
    let noise = 1e-14 * (1.0 + size / length) * (1.0 + size.ln().abs() + length.ln().abs());
    let whole = gauss(&inner, 0.0, 1.0);
    halve(&inner, (0.0, 1.0), whole, (least, noise), DEEP)
}

fn gauss(f: &impl Fn(f64) -> f64, from: f64, to: f64) -> f64 {
    let width = to - from;
    GAUSS.iter().map(|(x, w)| w * (f(from + x * width) + f(to - x * width))).sum::<f64>() * width
}

/// Halves an interval until both halves say what the whole says, to `least` or to what rounding leaves.
fn halve(f: &impl Fn(f64) -> f64, (from, to): (f64, f64), whole: f64, (least, noise): (f64, f64), deep: u32) -> f64 {
    let middle = 0.5 * (from + to);
    let (low, high) = (gauss(f, from, middle), gauss(f, middle, to));
    let both = low + high;
    if deep == 0 || (both - whole).abs() <= least.max(noise * (to - from)) {
        return both;
    }
    let limits = (0.5 * least, noise);
    halve(f, (from, middle), low, limits, deep - 1) + halve(f, (middle, to), high, limits, deep - 1)
}

/// Barycentric coordinates and weights of seven points that integrate polynomials of degree 5 over a triangle (Radon 1948).
const RADON: [([f64; 3], f64); 7] = {
    const A: f64 = 0.059_715_871_789_769_82;
    const B: f64 = 0.470_142_064_105_115_1;
    const C: f64 = 0.797_426_985_353_087_3;
    const D: f64 = 0.101_286_507_323_456_34;
    const V: f64 = 0.132_394_152_788_506_2;
    const W: f64 = 0.125_939_180_544_827_15;
    [
        ([1.0 / 3.0; 3], 0.225),
        ([A, B, B], V),
        ([B, A, B], V),
        ([B, B, A], V),
        ([C, D, D], W),
        ([D, C, D], W),
        ([D, D, C], W),
    ]
};

/// The exchange of two whole triangles that are far apart for their size, by 7 x 7 points; nothing if they are not.
///
/// Where the gap is [`APART`] times the larger radius, the error is below 1e-5 of the result; it falls with the sixth power.
pub(super) fn apart(p: &[DVec3; 3], q: &[DVec3; 3]) -> Option<f64> {
    let middle = |t: &[DVec3; 3]| (t[0] + t[1] + t[2]) / 3.0;
    let radius = |t: &[DVec3; 3], middle: DVec3| t.iter().fold(0.0_f64, |r, corner| r.max(corner.distance(middle)));
    let (m, n) = (middle(p), middle(q));
    let (r, s) = (radius(p, m), radius(q, n));
    if m.distance(n) - r - s < APART * r.max(s) {
        return None;
    }
    // Twice the areas as vectors: the cosines times the areas, without roots.
    let [a, b] = [p, q].map(|t| (t[1] - t[0]).cross(t[2] - t[0]));
    let points = |t: &[DVec3; 3]| RADON.map(|([x, y, z], weight)| (x * t[0] + y * t[1] + z * t[2], weight));
    let (from, to) = (points(p), points(q));
    let mut sum = 0.0;
    for (x, weight) in &from {
        for (y, other) in &to {
            let d = *y - *x;
            let square = d.length_squared();
            sum += weight * other * a.dot(d) * -b.dot(d) / (square * square);
        }
    }
    Some(sum / (4.0 * PI))
}
