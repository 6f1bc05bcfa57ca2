//! The reference tracer.

use crate::trace::ray::{Hit, Ray};
use crate::trace::tracer::Tracer;
use curitiba_pipeline::scene::{Geometry, TriangleRanges};
use glam::{DVec3, Vec3};

/// Tests every triangle in `f64`: a reference for tests, far too slow for pictures.
///
/// Uses the triangle test of Möller and Trumbore ("Fast, Minimum Storage Ray/Triangle Intersection", 1997), a different
/// formula from the one of [`Bvh`](crate::trace::Bvh); edges belong to the triangle.
#[derive(Debug, Clone)]
pub struct BruteForce {
    triangles: Vec<([DVec3; 3], u32, bool)>,
    /// Triangles of the sky, which block no shadow or occlusion ray.
    sky: TriangleRanges,
}

impl BruteForce {
    /// Takes all triangles whose corners are finite; `transparent` as in [`Bvh::build`](crate::trace::Bvh::build).
    #[must_use]
    pub fn new(geometry: &Geometry, transparent: &[bool]) -> Self {
        Self { triangles: finite_triangles(geometry, transparent), sky: geometry.sky.clone() }
    }

    /// All candidates of a ray, in the order of their ids: (distance, barycentric coordinates of corners 1 and 2) in
    /// `f64`, triangle id, whether the triangle is transparent.
    pub fn candidates(&self, ray: &Ray) -> impl Iterator<Item = (DVec3, u32, bool)> {
        let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let finite = origin.is_finite() && direction.is_finite();
        let (t_min, t_max) = (f64::from(ray.t_min.max(0.0)), f64::from(ray.t_max));
        self.triangles.iter().filter(move |_| finite).filter_map(move |(corners, id, transparent)| {
            let found = intersect(corners, origin, direction)?;
            (found.x > t_min && found.x < t_max).then_some((found, *id, *transparent))
        })
    }
}

/// Distance and barycentric coordinates of corners 1 and 2 where a line meets a triangle, edges included; `None` for a
/// miss.
pub(crate) fn intersect([a, b, c]: &[DVec3; 3], origin: DVec3, direction: DVec3) -> Option<DVec3> {
    let (e1, e2) = (*b - *a, *c - *a);
    let p = direction.cross(e2);
    let determinant = e1.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let s = origin - *a;
    let u = s.dot(p) / determinant;
    let q = s.cross(e1);
    let v = direction.dot(q) / determinant;
    let t = e2.dot(q) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then_some(DVec3::new(t, u, v))
}

/// The triangles whose corners are finite: corners, id, whether transparent.
pub(crate) fn finite_triangles(geometry: &Geometry, transparent: &[bool]) -> Vec<([DVec3; 3], u32, bool)> {
    let is_transparent = |material: u32| transparent.get(material as usize).copied().unwrap_or(false);
    let mut flags = geometry.materials().map(is_transparent);
    let mut triangles = Vec::with_capacity(geometry.triangles.len());
    for (triangle, id) in geometry.triangles.iter().zip(0_u32..) {
        let flag = flags.next().unwrap_or(false);
        let corners = triangle.map(|vertex| geometry.positions.get(vertex as usize).copied().unwrap_or(Vec3::NAN));
        if corners.iter().all(|corner| corner.is_finite()) {
            triangles.push((corners.map(|corner| corner.as_dvec3()), id, flag));
        }
    }
    triangles
}

pub(crate) fn hit((found, triangle, _): (DVec3, u32, bool)) -> Hit {
    Hit { t: found.x as f32, triangle, u: found.y as f32, v: found.z as f32 }
}

impl Tracer for BruteForce {
    fn closest(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        let mut best: Option<(DVec3, u32, bool)> = None;
        for candidate in self.candidates(ray) {
            if best.is_none_or(|best| candidate.0.x < best.0.x) && (!candidate.2 || accept(&hit(candidate))) {
                best = Some(candidate);
            }
        }
        best.map(hit)
    }

    fn occluded(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> bool {
        let mut candidates = self.candidates(ray).filter(|candidate| !self.sky.contains(candidate.1));
        candidates.any(|candidate| !candidate.2 || accept(&hit(candidate)))
    }
}
