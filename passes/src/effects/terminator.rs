//! The shadow terminator: light on triangles that approximate a smooth surface, where either the triangle or the smooth surface, but not both,
//! faces the light.
//!
//! A triangle that faces the light is dark where the smooth surface faces away, so that the border of the light is
//! a smooth curve and does not follow the edges of triangles.
//!
//! Where the triangle faces away and the smooth surface does not, a point of the triangle is lifted onto the smooth surface, which the normals at
//! the corners describe. For each corner, the point is projected onto the tangent plane if it lies below that plane. The three projections are
//! weighted by the barycentric coordinates (Hanika, "Hacking the Shadow Terminator", Ray Tracing Gems II, 2021, chapter 4). The shadow ray starts
//! at the lifted point. A second ray tests the segment from the triangle to the lifted point, so that an occluder in between blocks the light.

use super::coverage::Coverage;
use super::interpolate::{locate, weighed};
use super::light::SHADOWED;
use super::pass::Pass;
use crate::trace::{Hit, Purpose, Ray, SurfacePoint, Tracer, higher};
use curitiba_pipeline::scene::Geometry;
use glam::Vec3;

/// Least cosine between a triangle's normal and those at its corners for which the triangle counts as a piece of a
/// round surface.
pub const ROUND: f32 = 0.85;

/// A point of a triangle lifted onto the smooth surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lifted {
    /// Origin off the triangle, on the lit side.
    from: Vec3,
    /// Vector from `from` to the smooth surface; not 0.
    way: Vec3,
}

impl Lifted {
    /// Origin of the ray to the light.
    pub(super) fn origin(&self) -> Vec3 {
        self.from + self.way
    }

    /// Ray from the triangle to the lifted point.
    fn ray(&self) -> Ray {
        let length = self.way.length();
        Ray { origin: self.from, direction: self.way * (1.0 / length), t_min: 0.0, t_max: length }
    }
}

/// The normals at a triangle's corners, flipped to the side of unit normal `facing`. `None` where the triangle approximates no round surface: there
/// are no vertex normals, or they are equal, or one is more than 32 degrees off the triangle's normal ([`ROUND`]).
fn round_normals(geometry: &Geometry, triangle: u32, facing: Vec3) -> Option<[Vec3; 3]> {
    if geometry.normals.is_empty() {
        return None;
    }
    let normals = geometry.triangles[triangle as usize].map(|corner| geometry.normals[corner as usize]);
    if normals[0] == normals[1] && normals[1] == normals[2] {
        return None;
    }
    let cosines = normals.map(|normal| normal.dot(facing));
    if cosines.iter().all(|cosine| *cosine >= ROUND) {
        Some(normals)
    } else if cosines.iter().all(|cosine| -*cosine >= ROUND) {
        Some(normals.map(|normal| -normal))
    } else {
        None
    }
}

/// The normal whose horizon bounds the light at a point of a triangle, on the side of unit normal `facing`. Where the triangle approximates a
/// round surface, it is that surface's normal, of any length above 0; else it is `facing`.
///
/// # Panics
/// If there is no such triangle.
#[must_use]
pub fn horizon(geometry: &Geometry, triangle: u32, point: &SurfacePoint, facing: Vec3) -> Vec3 {
    round_normals(geometry, triangle, facing)
        .map_or(facing, |normals| weighed(normals, &locate(geometry, triangle, point.position)))
}

/// Whether a point of a triangle, on the side of unit normal `facing`, faces away from light in the unit direction `to_light`: the triangle faces
/// away, or the round surface that it approximates does.
///
/// # Panics
/// If there is no such triangle.
#[must_use]
pub fn is_turned(geometry: &Geometry, triangle: u32, point: &SurfacePoint, (facing, to_light): (Vec3, Vec3)) -> bool {
    if facing.dot(to_light) <= 0.0 {
        return true;
    }
    round_normals(geometry, triangle, facing).is_some_and(|normals| {
        // If the normals at all corners face the light, so do the interpolated ones.
        let is_lit = normals.iter().all(|normal| normal.dot(to_light) > 0.0);
        !is_lit && weighed(normals, &locate(geometry, triangle, point.position)).dot(to_light) <= 0.0
    })
}

/// Vector from a point of a triangle to the smooth surface. The point is on the side of unit normal `facing`, which is
/// facing away from the light; `to_light` is the unit direction to the light.
///
/// The vector is 0 where the smooth surface faces away as well, where the triangle approximates no round one, and
/// where the point lies below none of the tangent planes at the corners.
///
/// # Panics
/// If there is no such triangle.
#[must_use]
pub fn way_onto_round(
    geometry: &Geometry,
    triangle: u32,
    point: &SurfacePoint,
    (facing, to_light): (Vec3, Vec3),
) -> Vec3 {
    let Some(normals) = round_normals(geometry, triangle, facing) else { return Vec3::ZERO };
    let at = locate(geometry, triangle, point.position);
    if weighed(normals, &at).dot(to_light) <= 0.0 {
        return Vec3::ZERO;
    }
    let corners = geometry.corners(triangle);
    let lift = |corner: Vec3, normal: Vec3| normal * higher(0.0, -(point.position - corner).dot(normal));
    let way = weighed(std::array::from_fn(|i| lift(corners[i], normals[i])), &at);
    if way.is_finite() { way } else { Vec3::ZERO }
}

impl<T: Tracer, C> Pass<'_, T, C> {
    /// Lifts a point of a triangle whose side of normal `facing` faces away from light in direction `to_light`.
    /// `None` where the point is dark without a ray ([`way_onto_round`]), and on spheres.
    pub(super) fn lifted(
        &self,
        triangle: u32,
        point: &SurfacePoint,
        (facing, to_light): (Vec3, Vec3),
    ) -> Option<Lifted> {
        if self.sphere(triangle).is_some() {
            return None;
        }
        let way = way_onto_round(&self.job.scene.geometry, triangle, point, (facing, to_light));
        (way != Vec3::ZERO).then(|| Lifted { from: point.spawn(facing), way })
    }

    /// [`is_turned`] for the scene's triangles. For spheres only the side of normal `facing` decides.
    pub(super) fn is_turned(&self, triangle: u32, point: &SurfacePoint, (facing, to_light): (Vec3, Vec3)) -> bool {
        match self.sphere(triangle) {
            Some(_) => facing.dot(to_light) <= 0.0,
            None => is_turned(&self.job.scene.geometry, triangle, point, (facing, to_light)),
        }
    }

    /// [`horizon`] for the scene's triangles; for spheres it is `facing`.
    pub(super) fn horizon(&self, triangle: u32, point: &SurfacePoint, facing: Vec3) -> Vec3 {
        match self.sphere(triangle) {
            Some(_) => facing,
            None => horizon(&self.job.scene.geometry, triangle, point, facing),
        }
    }
}

impl<T: Tracer, C: Coverage> Pass<'_, T, C> {
    /// Whether something lies between a triangle and the lifted point. Traces a shadow ray.
    pub(super) fn is_cut_off(&self, lifted: &Lifted, rays: &mut u64, stops: impl FnMut(&Hit) -> bool) -> bool {
        *rays += 1;
        self.announce_visibility(Purpose::Shadow, 1.0);
        self.tracer.occluded(&lifted.ray(), stops)
    }

    /// The light's share in `deferredShadows` at a lifted point.
    pub(super) fn light_at_lifted(&self, lifted: &Lifted, rays: &mut u64) -> f32 {
        let covers = |hit: &Hit| self.covers(hit);
        if self.is_cut_off(lifted, rays, covers) {
            return SHADOWED;
        }
        *rays += 1;
        if self.sees_light(lifted.origin(), covers) { 1.0 } else { SHADOWED }
    }
}
