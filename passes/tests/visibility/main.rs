//! Visibility between triangles: closed forms, symmetry, soundness of decisions without rays, coverage of the errors,
//! and extreme places and sizes.

mod closed_forms;
mod devices;
mod errors;
mod places;
mod same;
mod sound;

use curitiba_passes::trace::{Bvh, Quality};
use curitiba_passes::visibility::{Effort, Estimator, Facing, Options, Room, Row, Surfaces};
use curitiba_pipeline::scene::{Batch, Geometry};
use glam::{DVec3, Vec3};

pub(crate) type Triangle = [Vec3; 3];

pub(crate) fn v(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

pub(crate) fn geometry(triangles: &[Triangle]) -> Geometry {
    let count = triangles.len() as u32;
    Geometry {
        positions: triangles.iter().flatten().copied().collect(),
        triangles: (0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
        batches: vec![Batch { material: 0, first: 0, count }],
        ..Geometry::default()
    }
}

/// A quadrilateral as two triangles, counter-clockwise seen from its front.
pub(crate) fn quad(a: Vec3, b: Vec3, c: Vec3, d: Vec3) -> [Triangle; 2] {
    [[a, b, c], [a, c, d]]
}

/// The unit right triangle at z = 0, which faces up, and the one above it at z = 1, which faces down.
pub(crate) fn facing() -> [Triangle; 2] {
    [[v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(0.0, 1.0, 0.0)], [v(0.0, 0.0, 1.0), v(0.0, 1.0, 1.0), v(1.0, 0.0, 1.0)]]
}

/// The half plane x < `c` at z = 0.5.
pub(crate) fn half_plane(c: f32) -> [Triangle; 2] {
    quad(v(-9.0, -9.0, 0.5), v(c, -9.0, 0.5), v(c, 9.0, 0.5), v(-9.0, 9.0, 0.5))
}

/// A box of twelve triangles that face inward, or outward.
pub(crate) fn boxed(low: Vec3, high: Vec3, inward: bool) -> Vec<Triangle> {
    let at = |i: usize| {
        let pick = |bit: usize, l: f32, h: f32| if i >> bit & 1 == 1 { h } else { l };
        v(pick(0, low.x, high.x), pick(1, low.y, high.y), pick(2, low.z, high.z))
    };
    // Counter-clockwise as seen from outside.
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = sides.iter().flat_map(|side| {
        let [a, b, c, d] = side.map(at);
        quad(a, b, c, d)
    });
    triangles.map(|[a, b, c]| if inward { [a, c, b] } else { [a, b, c] }).collect()
}

/// A sphere of 20 · 4^`levels` triangles around the origin, which face inward.
pub(crate) fn sphere(levels: u32) -> Vec<Triangle> {
    let t = (1.0 + 5f32.sqrt()) / 2.0;
    let mut points = Vec::new();
    for (a, b) in [(-1.0, t), (1.0, t), (-1.0, -t), (1.0, -t)] {
        points.push([v(a, b, 0.0), v(0.0, a, b), v(b, 0.0, a)]);
    }
    let corners: Vec<Vec3> = points.into_iter().flatten().map(Vec3::normalize).collect();
    let edge = (corners[0] - corners[3]).length().min((corners[0] - corners[1]).length());
    let mut triangles = Vec::new();
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                let [a, b, c] = [corners[i], corners[j], corners[k]];
                if [a - b, b - c, c - a].iter().all(|side| side.length() < edge * 1.01) {
                    let outward = (b - a).cross(c - a).dot(a) > 0.0;
                    triangles.push(if outward { [a, c, b] } else { [a, b, c] });
                }
            }
        }
    }
    assert_eq!(triangles.len(), 20);
    for _ in 0..levels {
        let split = |[a, b, c]: Triangle| {
            let [ab, bc, ca] = [(a + b).normalize(), (b + c).normalize(), (c + a).normalize()];
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        triangles = triangles.into_iter().flat_map(split).collect();
    }
    triangles
}

pub(crate) fn options(samples: u32) -> Options {
    Options { effort: Effort::Samples(samples), form_factors: true, ..Options::default() }
}

/// The rows of some pairs of a scene's triangles.
pub(crate) fn rows(triangles: &[Triangle], pairs: &[[u32; 2]], options: Options) -> Vec<Row> {
    let surfaces = Surfaces::new(&geometry(triangles), &[]);
    let bvh = Bvh::build(surfaces.geometry(), &surfaces.marks(), Quality::Balanced);
    let estimator = Estimator::new(&surfaces, &bvh, options).expect("the options are valid");
    let mut room = Room::default();
    pairs.iter().map(|pair| estimator.row(*pair, &mut room)).collect()
}

pub(crate) fn row(triangles: &[Triangle], pair: [u32; 2], options: Options) -> Row {
    rows(triangles, &[pair], options)[0]
}

pub(crate) fn all_pairs(count: usize) -> Vec<[u32; 2]> {
    let count = count as u32;
    (0..count).flat_map(|a| (a + 1..count).map(move |b| [a, b])).collect()
}

/// Sum of the form factors of each triangle, and the variance of that sum.
pub(crate) fn row_sums(count: usize, rows: &[Row]) -> Vec<(f64, f64)> {
    let mut sums = vec![(0.0, 0.0); count];
    for row in rows {
        let factors = row.form_factors.expect("they were asked for");
        for side in 0..2 {
            let (sum, variance) = &mut sums[row.pair[side] as usize];
            *sum += factors[side];
            *variance += row.form_factor_errors[side].powi(2);
        }
    }
    sums
}

/// A generator of numbers in [0, 1).
pub(crate) struct Random(pub u64);

impl Random {
    pub(crate) fn number(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn point(&mut self) -> Vec3 {
        v(self.number() as f32, self.number() as f32, self.number() as f32)
    }
}

/// A uniform point of a triangle. Folds the unit square, unlike the library, which takes a square root.
pub(crate) fn on([a, b, c]: &Triangle, mut x: f64, mut y: f64) -> DVec3 {
    if x + y > 1.0 {
        (x, y) = (1.0 - x, 1.0 - y);
    }
    let [a, b, c] = [a, b, c].map(|corner| corner.as_dvec3());
    a + x * (b - a) + y * (c - a)
}

pub(crate) fn normal([a, b, c]: &Triangle) -> DVec3 {
    let [a, b, c] = [a, b, c].map(|corner| corner.as_dvec3());
    (b - a).cross(c - a).normalize()
}

/// Distance by which rounding a scene to `f32` may move a point, relative to the point's distance from the origin. Triangles that were in one
/// plane are coplanar only within this distance.
const ROUNDING: f64 = 2e-6;

/// If a segment's end is farther than this from a plane, rounding cannot move the end to the other side of the plane.
pub(crate) fn known_distance(from: DVec3, to: DVec3) -> f64 {
    ROUNDING * from.length().max(to.length())
}

/// Whether the line of a segment crosses a triangle, and the segment's ends are on different sides of its plane, each at least `distance`
/// from it. With a negative `distance`, segments that end within `-distance` of the plane count as well.
pub(crate) fn blocks(triangle: &Triangle, from: DVec3, to: DVec3, distance: f64) -> bool {
    let [a, b, c] = triangle.map(|corner| corner.as_dvec3());
    let normal = normal(triangle);
    let [before, behind] = [from, to].map(|end| normal.dot(end - a));
    if before.signum() == behind.signum() && before.abs().min(behind.abs()) > -distance {
        return false;
    }
    if before.abs().min(behind.abs()) <= distance {
        return false;
    }
    // Möller and Trumbore in `f64`.
    let (e1, e2, along) = (b - a, c - a, to - from);
    let p = along.cross(e2);
    let determinant = e1.dot(p);
    let s = from - a;
    let q = s.cross(e1);
    let (u, v) = (s.dot(p) / determinant, along.dot(q) / determinant);
    u >= 0.0 && v >= 0.0 && u + v <= 1.0
}

/// Whether a segment leaves the front sides of both triangles, and each end is more than `distance` in front of the other triangle's plane.
pub(crate) fn is_valid(a: &Triangle, b: &Triangle, from: DVec3, to: DVec3, distance: f64) -> bool {
    normal(a).dot(to - from) > distance && normal(b).dot(from - to) > distance
}

/// The visibility of the first two triangles by brute force over a lattice (a Kronecker sequence with powers of the
/// root of x⁵ = x + 1), as the policy `skip` defines it. `None` if no segment is valid.
pub(crate) fn truth(triangles: &[Triangle], points: u32) -> Option<f64> {
    let [a, b] = [triangles[0], triangles[1]];
    let step = [1, 2, 3, 4].map(|power| 1.167_303_978_261_418_7_f64.powi(-power));
    let (mut valid, mut open) = (0_u32, 0_u32);
    for point in 0..points {
        let [x, y, z, w] = step.map(|step| (0.5 + f64::from(point) * step).fract());
        let (from, to) = (on(&a, x, y), on(&b, z, w));
        if is_valid(&a, &b, from, to, 0.0) {
            valid += 1;
            open += u32::from(!triangles[2..].iter().any(|triangle| blocks(triangle, from, to, 0.0)));
        }
    }
    (valid > 0).then(|| f64::from(open) / f64::from(valid))
}

pub(crate) const BOTH: [Facing; 2] = [Facing::Skip, Facing::Zero];
