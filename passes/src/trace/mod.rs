//! The tracer seam: effects see rays, hits and [`Tracer`], and nothing of the acceleration structure.

use glam::Vec3;

/// A ray and the open interval of distances in which it meets surfaces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Origin, world.
    pub origin: Vec3,
    /// Direction, unit length; distances are multiples of it.
    pub direction: Vec3,
    /// Hits have `t > t_min`; 0 or more.
    pub t_min: f32,
    /// Hits have `t < t_max`; may be infinite.
    pub t_max: f32,
}

/// Where a ray meets a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance along the ray.
    pub t: f32,
    /// Triangle id, as in [`Geometry::triangles`](curitiba_pipeline::scene::Geometry::triangles).
    pub triangle: u32,
    /// Barycentric coordinate of corner 1.
    pub u: f32,
    /// Barycentric coordinate of corner 2.
    pub v: f32,
}

/// What effects ask of a scene.
///
/// Each query takes a closure that is shown every candidate hit in no particular order and says whether there really is
/// a surface: it is how alpha-cut textures and glass that shadow rays pass work. A candidate may be shown more than once.
pub trait Tracer: Sync {
    /// The nearest accepted hit.
    fn closest(&self, ray: &Ray, accept: impl FnMut(&Hit) -> bool) -> Option<Hit>;

    /// Whether any accepted hit exists; the order of the search is free.
    fn occluded(&self, ray: &Ray, accept: impl FnMut(&Hit) -> bool) -> bool;

    /// How many of `directions` are not blocked within `t_max` of `origin`: many rays from one origin.
    fn count_open(
        &self,
        origin: Vec3,
        t_min: f32,
        t_max: f32,
        directions: &[Vec3],
        accept: impl FnMut(&Hit) -> bool,
    ) -> u32 {
        let mut accept = accept;
        let blocked =
            |direction: &&Vec3| !self.occluded(&Ray { origin, direction: **direction, t_min, t_max }, &mut accept);
        directions.iter().filter(blocked).count() as u32
    }
}
