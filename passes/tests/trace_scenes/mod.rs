//! Generated scenes and rays for the tracer's tests and benches.
#![allow(dead_code, reason = "each test binary uses a part")]

use curitiba_passes::trace::{Hit, InstructionSet, Ray};
use curitiba_pipeline::scene::{Batch, Geometry};
use glam::Vec3;
use std::collections::HashMap;

/// The instruction sets to test; a processor may lack some.
pub const SETS: [InstructionSet; 3] = [InstructionSet::Avx512, InstructionSet::Avx2, InstructionSet::Portable];

/// A rule for transparent triangles that depends only on the hit.
pub fn accepts(hit: &Hit) -> bool {
    hit.u > 0.4 || hit.triangle.is_multiple_of(3)
}

/// A hit as bits, for exact comparison.
pub fn bits(hit: &Hit) -> (u32, u32, u32, u32) {
    (hit.triangle, hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits())
}

/// Least and greatest coordinates of all vertices; 0 and 1 if there are none.
pub fn bounds(geometry: &Geometry) -> (Vec3, Vec3) {
    let start = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (low, high) = geometry.positions.iter().fold(start, |(l, h), &p| (l.min(p), h.max(p)));
    if geometry.positions.is_empty() { (Vec3::ZERO, Vec3::ONE) } else { (low, high) }
}

/// A small random generator (PCG, O'Neill 2014), the same in every run.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    pub fn bits(&mut self) -> u32 {
        let old = self.0;
        self.0 = old.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let shifted = (((old >> 18) ^ old) >> 27) as u32;
        shifted.rotate_right((old >> 59) as u32)
    }

    /// A number in 0..1.
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 8) as f32 / 16_777_216.0
    }

    pub fn below(&mut self, count: usize) -> usize {
        ((u64::from(self.bits()) * count as u64) >> 32) as usize
    }

    /// A point of the cube -1..1.
    pub fn cube(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }

    /// A point of the unit sphere.
    pub fn direction(&mut self) -> Vec3 {
        loop {
            let point = self.cube();
            if (0.01..1.0).contains(&point.length_squared()) {
                return point.normalize();
            }
        }
    }

    /// A cosine-distributed direction around a unit vector.
    pub fn cosine(&mut self, normal: Vec3) -> Vec3 {
        (self.direction() * 0.999 + normal).normalize()
    }
}

/// A geometry with one batch for each entry: a material and its triangles.
pub fn geometry(batches: &[(u32, Vec<[Vec3; 3]>)]) -> Geometry {
    let mut geometry = Geometry::default();
    for (material, triangles) in batches {
        let first = geometry.triangles.len() as u32;
        geometry.batches.push(Batch { material: *material, first, count: triangles.len() as u32 });
        for triangle in triangles {
            let vertex = geometry.positions.len() as u32;
            geometry.positions.extend(triangle);
            geometry.triangles.push([vertex, vertex + 1, vertex + 2]);
        }
    }
    geometry
}

/// Small triangles in the cube -1..1.
pub fn soup(count: usize, size: f32, random: &mut Random) -> Vec<[Vec3; 3]> {
    (0..count)
        .map(|_| {
            let center = random.cube();
            [(); 3].map(|()| center + random.cube() * size)
        })
        .collect()
}

/// A height field of `2 (cells)²` triangles over -10..10 in x and z.
pub fn terrain(cells: usize) -> Vec<[Vec3; 3]> {
    let point = |i: usize, j: usize| {
        let [x, z] = [i, j].map(|k| k as f32 / cells as f32 * 20.0 - 10.0);
        let y = (x * 0.7).sin() * (z * 0.5).cos() * 1.5 + (x * 3.1 + z * 2.3).sin() * 0.25 + (x * 11.0).sin() * 0.06;
        Vec3::new(x, y + (z * 13.0 + x * 5.0).sin() * 0.05, z)
    };
    let mut triangles = Vec::with_capacity(2 * cells * cells);
    for i in 0..cells {
        for j in 0..cells {
            let [a, b, c, d] = [point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)];
            triangles.extend([[a, c, b], [a, d, c]]);
        }
    }
    triangles
}

/// Axis-aligned quads on integer coordinates; many share planes, edges and corners.
pub fn quads(count: usize, random: &mut Random) -> Vec<[Vec3; 3]> {
    let mut triangles = Vec::with_capacity(2 * count);
    for _ in 0..count {
        let corner = Vec3::from([(); 3].map(|()| random.below(8) as f32));
        let axis = random.below(3);
        let side =
            |k: usize, length: f32| Vec3::from([0, 1, 2].map(|i| if i == (axis + k) % 3 { length } else { 0.0 }));
        let (u, v) = (side(1, 1.0 + random.below(3) as f32), side(2, 1.0 + random.below(3) as f32));
        triangles.extend([[corner, corner + u, corner + u + v], [corner, corner + u + v, corner + v]]);
    }
    triangles
}

/// A closed sphere of radius 1 around `center` with `20 * 4^levels` triangles that share their vertices exactly.
pub fn icosphere(levels: u32, center: Vec3) -> Geometry {
    let g = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let mut points: Vec<[f64; 3]> = Vec::new();
    for (a, b) in [(1.0, g), (-1.0, g), (1.0, -g), (-1.0, -g)] {
        points.extend([[0.0, a, b], [a, b, 0.0], [b, 0.0, a]]);
    }
    let distance = |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>();
    let mut triangles = Vec::new();
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                if [(i, j), (j, k), (i, k)].iter().all(|&(a, b)| distance(points[a], points[b]) < 4.1) {
                    triangles.push([i, j, k]);
                }
            }
        }
    }
    assert_eq!(triangles.len(), 20);
    for _ in 0..levels {
        let mut middles: HashMap<(usize, usize), usize> = HashMap::new();
        let mut finer = Vec::with_capacity(4 * triangles.len());
        for [a, b, c] in triangles {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(p, q)| {
                *middles.entry((p.min(q), p.max(q))).or_insert_with(|| {
                    points.push([0, 1, 2].map(|i| (points[p][i] + points[q][i]) / 2.0));
                    points.len() - 1
                })
            });
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = finer;
        for point in &mut points {
            let length = distance(*point, [0.0; 3]).sqrt();
            *point = point.map(|x| x / length);
        }
    }
    let positions = points.iter().map(|p| Vec3::from(p.map(|x| x as f32)) + center).collect();
    let triangles: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(|vertex| vertex as u32)).collect();
    let batches = vec![Batch { material: 0, first: 0, count: triangles.len() as u32 }];
    Geometry { positions, triangles, batches, ..Geometry::default() }
}

/// The triangle test of Möller and Trumbore in `f32`, without a tree: the negative control for watertightness.
fn ordinary_test(ray: &Ray, [a, b, c]: [Vec3; 3]) -> bool {
    let (e1, e2) = (b - a, c - a);
    let p = ray.direction.cross(e2);
    let inverse = 1.0 / e1.dot(p);
    let s = ray.origin - a;
    let u = s.dot(p) * inverse;
    let q = s.cross(e1);
    let v = ray.direction.dot(q) * inverse;
    u >= 0.0 && v >= 0.0 && u + v <= 1.0 && e2.dot(q) * inverse > ray.t_min
}

/// Whether a ray misses all triangles of a mesh by that test.
pub fn passes_ordinary_test(mesh: &Geometry, ray: &Ray) -> bool {
    !(0..mesh.triangles.len() as u32).any(|triangle| ordinary_test(ray, mesh.corners(triangle)))
}

/// A ray of infinite length.
pub fn ray(origin: Vec3, direction: Vec3) -> Ray {
    Ray { origin, direction, t_min: 0.0, t_max: f32::INFINITY }
}
