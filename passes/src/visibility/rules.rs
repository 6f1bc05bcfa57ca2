//! The unblocked exchange of two triangles that are far enough apart, by a quadrature rule over both.

use crate::trace::{Detected, Kernel, Simd};
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::OnceLock;

/// Quadrature rules: for gaps of at least the first number, in radii of the larger triangle, the number of Gauss-Legendre points along each
/// of the two directions of a triangle.
///
/// At each of the gaps, over 1500 random pairs (slender triangles and some of a tenth of the size among them), the error was at most 1.4e-6
/// of the result.
const RULES: [(f64, usize); 5] = [(16.0, 3), (4.0, 4), (1.5, 6), (0.75, 8), (0.25, 10)];
/// Points that are evaluated together.
const LANES: usize = 8;
/// Points of the largest rule, padded to whole lanes.
const MOST: usize = 104;

/// Points of a triangle: barycentric coordinates of its second and third corner, and weights that sum to 1. Padding points have weight 0.
#[derive(Debug)]
struct Rule {
    points: Vec<[f64; 3]>,
}

impl Rule {
    /// Gauss-Legendre points from a corner to the opposite edge, and along that edge (Stroud, "Approximate Calculation of Multiple
    /// Integrals", 1971, section 2.5).
    fn new(order: usize) -> Self {
        let line = gauss_legendre(order);
        let mut points: Vec<_> = line
            .iter()
            .flat_map(|(u, a)| line.iter().map(move |(v, b)| [u * (1.0 - v), u * v, 2.0 * u * a * b]))
            .collect();
        points.resize(points.len().next_multiple_of(LANES), [0.0; 3]);
        Self { points }
    }

    fn all() -> &'static [Self; RULES.len()] {
        static ALL: OnceLock<[Rule; RULES.len()]> = OnceLock::new();
        ALL.get_or_init(|| RULES.map(|(_, order)| Self::new(order)))
    }
}

/// Nodes and weights of the Gauss-Legendre rule on [0, 1], by Newton's method.
fn gauss_legendre(order: usize) -> Vec<(f64, f64)> {
    let count = order as f64;
    // The Legendre polynomial of degree `order`, and its derivative.
    let legendre = |x: f64| {
        let (mut before, mut here) = (1.0, x);
        for degree in 2..=order {
            let n = degree as f64;
            (before, here) = (here, ((2.0 * n - 1.0) * x * here - (n - 1.0) * before) / n);
        }
        (here, count * (x * here - before) / (x * x - 1.0))
    };
    let node = |index: usize| {
        let mut x = (FRAC_PI_2 * (2.0 * index as f64 + 1.5) / (count + 0.5)).cos();
        for _ in 0..8 {
            let (value, slope) = legendre(x);
            x -= value / slope;
        }
        let (_, slope) = legendre(x);
        (0.5 * (1.0 - x), 1.0 / ((1.0 - x * x) * slope * slope))
    };
    (0..order).map(node).collect()
}

/// The exchange of two whole triangles, each in front of the other; `None` if they are too close for any rule.
pub(super) fn apart(p: &[DVec3; 3], q: &[DVec3; 3]) -> Option<f64> {
    let middle = |t: &[DVec3; 3]| (t[0] + t[1] + t[2]) / 3.0;
    let radius = |t: &[DVec3; 3], middle: DVec3| t.iter().fold(0.0_f64, |r, corner| r.max(corner.distance(middle)));
    let (m, n) = (middle(p), middle(q));
    let (r, s) = (radius(p, m), radius(q, n));
    let gap = (m.distance(n) - r - s) / r.max(s);
    let rule = RULES.iter().position(|(least, _)| gap >= *least)?;
    Some(Detected::cached().run(Product { p, q, rule: &Rule::all()[rule] }))
}

struct Product<'a> {
    p: &'a [DVec3; 3],
    q: &'a [DVec3; 3],
    rule: &'a Rule,
}

impl Kernel<f64> for Product<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> f64 {
        let Self { p, q, rule: Rule { points } } = self;
        let point = |t: &[DVec3; 3], u: f64, v: f64| t[0] + u * (t[1] - t[0]) + v * (t[2] - t[0]);
        // Twice the area vectors: their dot products with a direction are cosine times area, without square roots.
        let [a, b] = [p, q].map(|t| (t[1] - t[0]).cross(t[2] - t[0]));
        let mut to = [[0.0; MOST]; 4];
        for (index, [u, v, weight]) in points.iter().enumerate() {
            let y = point(q, *u, *v);
            [to[0][index], to[1][index], to[2][index], to[3][index]] = [y.x, y.y, y.z, *weight];
        }
        let [xs, ys, zs, weights] = &to;
        let mut sum = 0.0;
        for [u, v, weight] in points {
            let from = point(p, *u, *v);
            let mut sums = [0.0; LANES];
            for first in (0..points.len()).step_by(LANES) {
                for (lane, sum) in sums.iter_mut().enumerate() {
                    let index = first + lane;
                    let (x, y, z) = (xs[index] - from.x, ys[index] - from.y, zs[index] - from.z);
                    let square = x * x + y * y + z * z;
                    let leaving = a.x * x + a.y * y + a.z * z;
                    let arriving = b.x * x + b.y * y + b.z * z;
                    *sum += weights[index] * leaving * arriving / (square * square);
                }
            }
            sum += weight * sums.iter().sum::<f64>();
        }
        -sum / (4.0 * PI)
    }
}

#[cfg(test)]
mod tests {
    use super::super::contour::exchange;
    use super::super::shaft::Polygon;
    use super::*;

    #[test]
    fn the_nodes_are_those_of_the_tables() {
        // Abramowitz and Stegun, table 25.4.
        let four = gauss_legendre(4);
        assert!((four[0].0 - 0.5 * (1.0 - 0.861_136_311_594_053)).abs() < 1e-15);
        assert!((four[0].1 - 0.5 * 0.347_854_845_137_454).abs() < 1e-15);
        assert!((four[1].1 - 0.5 * 0.652_145_154_862_546).abs() < 1e-15);
        let ten = gauss_legendre(10);
        assert!((ten[0].0 - 0.5 * (1.0 - 0.973_906_528_517_172)).abs() < 1e-15);
        for (_, order) in RULES {
            let rule = Rule::new(order);
            assert!(rule.points.len() <= MOST && rule.points.len().is_multiple_of(LANES));
            assert!((rule.points.iter().map(|[_, _, weight]| weight).sum::<f64>() - 1.0).abs() < 1e-14);
        }
    }

    /// The contour integral works at any distance, and serves as the reference.
    #[test]
    fn rules_and_the_contour_agree_at_every_gap() {
        let mut state = 7_u64;
        let mut number = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0
        };
        let mut vector = || DVec3::new(number(), number(), number());
        let (mut worst, mut served) = (0.0_f64, 0);
        while served < 400 {
            let shape = |corners: [DVec3; 3], size: f64| {
                let middle = corners.iter().sum::<DVec3>() / 3.0;
                let radius = corners.iter().fold(0.0_f64, |r, corner| r.max(corner.distance(middle)));
                corners.map(|corner| (corner - middle) * (size / radius))
            };
            let p = shape([vector(), vector(), vector()], 1.0);
            let size = [1.0, 0.5, 0.1][served % 3];
            let gap = RULES[served % RULES.len()].0 * 1.001;
            let place = vector().normalize() * (1.0 + size + gap);
            let q = shape([vector(), vector(), vector()], size).map(|corner| corner + place);
            let above = |t: &[DVec3; 3], other: &[DVec3; 3]| {
                let normal = (t[1] - t[0]).cross(t[2] - t[0]);
                other.iter().all(|corner| normal.dot(*corner - t[0]) > 0.0)
            };
            if !above(&p, &q) || !above(&q, &p) {
                continue;
            }
            served += 1;
            let exact = exchange(&Polygon::above(p, |_| 1.0), &Polygon::above(q, |_| 1.0));
            let open = (p[1] - p[0]).cross(p[2] - p[0]).length() * (q[1] - q[0]).cross(q[2] - q[0]).length()
                / (4.0 * PI * (gap + 1.0 + size).powi(2));
            let found = apart(&p, &q).expect("far enough");
            worst = worst.max((found - exact).abs() / open);
            // The contour integral of a small far triangle is a difference of large numbers.
            assert!((found - exact).abs() < 3e-6 * exact + 1e-8 * open, "{found} {exact} {gap}");
        }
        assert!(worst > 0.0);
        let near = [DVec3::ZERO, DVec3::X, DVec3::Y];
        assert_eq!(apart(&near, &near.map(|corner| corner + 0.5 * DVec3::Z)), None);
    }
}
