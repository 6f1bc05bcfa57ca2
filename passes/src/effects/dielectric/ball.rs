//! Refraction of parallel light by a sphere of glass, in a plane that contains the axis: closed forms, in `f64`.
//!
//! The sphere has radius 1, its centre at the origin and the index of refraction n; light travels along the axis z. A ray with the angle of
//! incidence i meets the sphere at the distance sin i from the axis. When it leaves the sphere it is deflected by delta = 2 (i - t) towards the
//! axis, where sin t = sin i / n, and its line again passes the centre at the distance sin i. So its signed distance from a point (x, z) of its
//! plane is
//!
//! ```text
//! m(i) = x cos delta + z sin delta - sin i
//! ```
//!
//! Where m = 0, the irradiance at the point across the ray is T sin i cos i / (|x| |dm/di|) times the irradiance of the light across the axis: the
//! ratio of the cross sections of a tube of light before and behind the sphere, times the share T that is transmitted. This factor is infinite on
//! caustics, where dm/di or x is 0. What is computed is its mean over a disc perpendicular to the ray, which is finite everywhere and conserves
//! power.

use glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, PI};

/// Number of equal intervals of the angle of incidence, from 0 to a right angle. Each interval is searched for an extremum of m.
pub const CELLS: usize = 64;

/// Number of points of a quadrature. For lit points so near to the axis that rays from all sides reach them, it is [`POINTS_AT_AXIS`].
pub const POINTS: usize = 8;
/// See [`POINTS`].
pub const POINTS_AT_AXIS: usize = 32;

/// Refraction by a sphere of one index of refraction, above 1.
#[derive(Debug, Clone)]
pub struct Ball {
    index: f64,
    nodes: Vec<Turned>,
    points: [Vec<DVec2>; 2],
}

/// A ray that has passed through the sphere, in its plane of incidence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turned {
    /// Sine and cosine of the angle of incidence. The sine is also the distance at which the ray passes the centre.
    pub sin: f64,
    /// See [`Self::sin`].
    pub cos: f64,
    /// Cosine of the angle of refraction, inside the sphere.
    pub inner: f64,
    /// Unit direction in which the ray leaves: x is away from the axis, on the side where the ray met the sphere; y is along the axis.
    pub direction: DVec2,
    /// Derivative of the ray's deflection, delta, with respect to the angle of incidence.
    rate: f64,
}

impl Turned {
    /// The ray of an angle of incidence in radians, behind a sphere of this index.
    #[must_use]
    pub fn at(incidence: f64, index: f64) -> Self {
        let (sin, cos) = incidence.sin_cos();
        let inner_sin = sin / index;
        let inner = (1.0 - inner_sin * inner_sin).sqrt();
        // Sine and cosine of i - t; the ray is deflected by twice that angle.
        let (half_sin, half_cos) = (sin * inner - cos * inner_sin, cos * inner + sin * inner_sin);
        let direction = DVec2::new(-2.0 * half_sin * half_cos, half_cos * half_cos - half_sin * half_sin);
        Self { sin, cos, inner, direction, rate: 2.0 * (1.0 - cos / (index * inner)) }
    }

    /// Derivative of the ray's deflection, delta, with respect to the angle of incidence.
    #[must_use]
    pub fn rate(&self) -> f64 {
        self.rate
    }

    /// Signed distance of the ray from a point: m of the module's documentation.
    fn miss(&self, at: DVec2) -> f64 {
        at.x * self.direction.y - at.y * self.direction.x - self.sin
    }

    /// Derivative of m with respect to the angle of incidence.
    fn miss_rate(&self, at: DVec2) -> f64 {
        self.rate * self.along(at) - self.cos
    }

    /// Coordinate of a point along the ray, from where the ray's line is nearest to the centre.
    fn along(&self, at: DVec2) -> f64 {
        at.dot(self.direction)
    }

    /// Whether a point lies beyond the ray's exit from the sphere, measured along the ray.
    fn reaches(&self, at: DVec2) -> bool {
        self.along(at) > self.cos
    }

    /// Where the ray meets the sphere.
    #[must_use]
    pub fn entry(&self) -> DVec2 {
        DVec2::new(self.sin, -self.cos)
    }

    /// Where the ray leaves the sphere.
    #[must_use]
    pub fn exit(&self) -> DVec2 {
        self.sin * DVec2::new(self.direction.y, -self.direction.x) + self.cos * self.direction
    }

    /// Half of the range of angles by which the ray may be rotated about the axis and still pass the point nearer than `width`; at most a right
    /// angle.
    ///
    /// Rotated by psi, with u = 1 - cos psi, the ray passes the point at a distance D with D² = x² (2u - u²) + (m - x u cos delta)².
    fn half_angle(&self, at: DVec2, width: f64) -> f64 {
        let (miss, x, c, s) = (self.miss(at), at.x, self.direction.y, self.direction.x);
        // The ray is near enough where a u² - b u + c0 > 0, for u from 0 to 1. Rotations by more than a right angle belong to the ray on the other
        // side of the axis.
        let (a, b, c0) = (x * x * s * s, 2.0 * x * (x - miss * c), (width - miss) * (width + miss));
        let discriminant = b * b - 4.0 * a * c0;
        if discriminant < 0.0 || (b <= 0.0 && c0 >= 0.0) {
            return FRAC_PI_2;
        }
        if x == 0.0 {
            return 0.0;
        }
        let angle = |u: f64| 2.0 * (0.5 * u.clamp(0.0, 1.0)).sqrt().asin();
        let root = discriminant.sqrt();
        if b <= 0.0 {
            return FRAC_PI_2 - angle(2.0 * c0 / (b - root));
        }
        let q = b + root;
        angle(2.0 * c0 / q) + if 2.0 * a > q { 0.0f64.max(FRAC_PI_2 - angle(0.5 * q / a)) } else { 0.0 }
    }
}

/// Rays of adjacent angles of incidence that reach a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bundle {
    /// The ray of the mean angle of incidence, weighted by the irradiance without losses.
    pub ray: Turned,
    /// 1 if the rays met the sphere on the point's side of the axis, -1 if they met it on the other side.
    pub side: f64,
    /// Irradiance across the bundle's direction, by colour, relative to the irradiance of the light across its own direction.
    pub strength: DVec3,
}

/// Sums over the rays of a bundle.
#[derive(Clone, Copy)]
struct Sum {
    strength: DVec3,
    /// Sum of the weights; `incidence` is the sum of the angles of incidence times their weights, and `end` the greatest angle.
    weight: f64,
    incidence: f64,
    end: f64,
}

impl Ball {
    /// The refraction by a sphere of this index, above 1.
    #[must_use]
    pub fn new(index: f64) -> Self {
        let nodes = (0..=CELLS).map(|node| Turned::at(at_node(node), index)).collect();
        let points = [POINTS, POINTS_AT_AXIS].map(|count| {
            let on_sine = |DVec2 { x, y }| {
                let (sin, cos) = (FRAC_PI_2 * x).sin_cos();
                DVec2::new(sin, FRAC_PI_2 * y * cos)
            };
            gauss_legendre(count).map(on_sine).collect()
        });
        Self { index, nodes, points }
    }

    /// The index of refraction.
    #[must_use]
    pub fn index(&self) -> f64 {
        self.index
    }

    /// The rays of `CELLS + 1` angles of incidence from 0 to a right angle, in equal steps.
    #[must_use]
    pub fn nodes(&self) -> &[Turned] {
        &self.nodes
    }

    /// Points between -1 and 1 and their weights: first of the quadrature for most lit points, then of the one for points near the axis.
    pub fn quadratures(&self) -> impl Iterator<Item = DVec2> {
        self.points.iter().flatten().copied()
    }

    /// Calls `each` with the bundles that reach a point outside the sphere. Their irradiance is the mean over discs of radius `width` (above 0)
    /// perpendicular to the rays. `at` is the point's distance from the axis, at least 0, and its coordinate along the axis. The radius of the
    /// sphere is the unit of length. `kept` returns the share of its light that a ray keeps, by colour.
    pub fn bundles(&self, at: DVec2, width: f64, kept: impl Fn(&Turned) -> DVec3, mut each: impl FnMut(Bundle)) {
        for side in [1.0, -1.0] {
            let at = DVec2::new(at.x * side, at.y);
            let mut open: Option<Sum> = None;
            // Rotation about the axis may bring a ray nearer to the point than it is in the plane, but only if the point is near the axis.
            let reach = if at.x.abs() < width { width + at.x.abs() } else { width };
            self.pieces(at, reach, |low, high| {
                let sum = self.sum(at, width, [low, high], &kept);
                match &mut open {
                    Some(before) if before.end >= low => {
                        before.strength += sum.strength;
                        before.weight += sum.weight;
                        before.incidence += sum.incidence;
                        before.end = high;
                    }
                    _ => self.close(open.replace(sum), side, &mut each),
                }
            });
            self.close(open, side, &mut each);
        }
    }

    fn close(&self, sum: Option<Sum>, side: f64, each: &mut impl FnMut(Bundle)) {
        if let Some(Sum { strength, weight, incidence, .. }) = sum.filter(|sum| sum.weight > 0.0) {
            each(Bundle { ray: Turned::at(incidence / weight, self.index), side, strength });
        }
    }

    /// Calls `each` with the intervals of the angle of incidence, in ascending order, whose rays pass a point nearer than `reach`. Within an
    /// interval m is monotonic.
    fn pieces(&self, at: DVec2, reach: f64, mut each: impl FnMut(f64, f64)) {
        let step = FRAC_PI_2 / CELLS as f64;
        let known = |ray: &Turned| ([ray.miss(at), ray.miss_rate(at)], ray.reaches(at));
        let (mut before, mut reached) = known(&self.nodes[0]);
        for (cell, node) in self.nodes[1..].iter().enumerate() {
            let (after, reaches) = known(node);
            let turns = before[1] * after[1] < 0.0;
            let slack = if turns { step * before[1].abs().max(after[1].abs()) } else { 0.0 };
            let beyond = |side: f64| (before[0] * side).min(after[0] * side) > reach + slack;
            if (reached || reaches) && !beyond(1.0) && !beyond(-1.0) {
                let ends = [at_node(cell), at_node(cell + 1)];
                if turns {
                    let top = root(ends, before[1], |i| (Turned::at(i, self.index).miss_rate(at), None), 1e-9);
                    let middle = Turned::at(top, self.index).miss(at);
                    self.piece(at, reach, [(ends[0], before[0]), (top, middle)], &mut each);
                    self.piece(at, reach, [(top, middle), (ends[1], after[0])], &mut each);
                } else {
                    self.piece(at, reach, [(ends[0], before[0]), (ends[1], after[0])], &mut each);
                }
            }
            (before, reached) = (after, reaches);
        }
    }

    /// Calls `each` with the part of an interval whose rays are within reach. `low` and `high` are its two angles, each with its m; m is monotonic
    /// between them.
    fn piece(&self, at: DVec2, reach: f64, [low, high]: [(f64, f64); 2], each: &mut impl FnMut(f64, f64)) {
        if low.1.min(high.1) > reach || low.1.max(high.1) < -reach {
            return;
        }
        let end = |own: (f64, f64)| {
            if own.1.abs() <= reach {
                return own.0;
            }
            let border = reach.copysign(own.1);
            let miss = |i: f64| {
                let ray = Turned::at(i, self.index);
                (ray.miss(at) - border, Some(ray.miss_rate(at)))
            };
            root([low.0, high.0], low.1 - border, miss, 1e-9 * reach)
        };
        let (low, high) = (end(low), end(high));
        if low < high {
            each(low, high);
        }
    }

    /// The light of the angles of incidence from `low` to `high`. Towards these ends the integrand falls as the square root of the distance from
    /// them. The quadrature substitutes the sine of an angle for its variable: as a function of that angle the integrand is smooth.
    fn sum(&self, at: DVec2, width: f64, [low, high]: [f64; 2], kept: impl Fn(&Turned) -> DVec3) -> Sum {
        let mut sum = Sum { strength: DVec3::ZERO, weight: 0.0, incidence: 0.0, end: high };
        let points = &self.points[usize::from(at.x.abs() < 2.0 * width)];
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        for point in points {
            let incidence = middle + half * point.x;
            let ray = Turned::at(incidence, self.index);
            if ray.reaches(at) {
                let area = half * point.y * ray.sin * ray.cos * 2.0 * ray.half_angle(at, width) / (PI * width * width);
                sum.strength += area * kept(&ray);
                sum.weight += area;
                sum.incidence += area * incidence;
            }
        }
        sum
    }
}

/// Points and weights of Gauss-Legendre quadrature from -1 to 1, by Newton's method on the recurrence of Legendre polynomials.
fn gauss_legendre(count: usize) -> impl Iterator<Item = DVec2> {
    (0..count).map(move |point| {
        let mut x = (PI * (point as f64 + 0.75) / (count as f64 + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..8 {
            let (mut value, mut before) = (x, 1.0);
            for degree in 2..=count {
                let degree = degree as f64;
                (value, before) = (((2.0 * degree - 1.0) * x * value - (degree - 1.0) * before) / degree, value);
            }
            slope = count as f64 * (x * value - before) / (x * x - 1.0);
            x -= value / slope;
        }
        DVec2::new(x, 2.0 / ((1.0 - x * x) * slope * slope))
    })
}

fn at_node(node: usize) -> f64 {
    FRAC_PI_2 * node as f64 / CELLS as f64
}

/// The root of a function between two places at which its signs differ; `first` has the function's sign at the first place. Takes Newton's steps
/// where there is a derivative, else secants, and bisects where a step leaves the interval. Ends where the function's absolute value is at most
/// `tolerance`, at the latest after 60 steps.
fn root(
    [mut low, mut high]: [f64; 2],
    first: f64,
    function: impl Fn(f64) -> (f64, Option<f64>),
    tolerance: f64,
) -> f64 {
    let mut place = 0.5 * (low + high);
    let mut known: Option<(f64, f64)> = None;
    for _ in 0..60 {
        let (value, rate) = function(place);
        if value.abs() <= tolerance {
            break;
        }
        if (value < 0.0) == (first < 0.0) {
            low = place
        } else {
            high = place
        }
        let rate = rate.or_else(|| known.map(|(other, its)| (value - its) / (place - other)));
        known = Some((place, value));
        let next = rate.map_or(f64::NAN, |rate| place - value / rate);
        let inside = next > low && next < high;
        place = if inside { next } else { 0.5 * (low + high) };
        if high - low <= f64::EPSILON {
            break;
        }
    }
    place
}
