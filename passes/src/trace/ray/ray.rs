//! One ray, what it hits, and a fan of rays from one point.

use glam::Vec3;

/// A ray and the open interval of distances in which it meets surfaces.
///
/// The interval is open on both sides: a surface exactly at `t_min` or at `t_max` is not hit. In particular a ray whose
/// origin lies exactly on a triangle does not hit it at distance 0. Rays with a component that is not finite, without a
/// direction, or with an empty interval miss everything.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Origin, world.
    pub origin: Vec3,
    /// Direction, unit length; distances are in multiples of its length.
    pub direction: Vec3,
    /// Hits have `t > t_min`; 0 or more.
    pub t_min: f32,
    /// Hits have `t < t_max`; may be infinite.
    pub t_max: f32,
}

impl Ray {
    /// A ray that hits nothing.
    pub(crate) const NONE: Self = Self { origin: Vec3::ZERO, direction: Vec3::ZERO, t_min: 0.0, t_max: 0.0 };
}

/// Where a ray hits a surface. Both sides of a triangle are hit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance along the ray.
    pub t: f32,
    /// Triangle id, as in [`Geometry::triangles`](curitiba_pipeline::scene::Geometry::triangles). A tracer with exact spheres also returns
    /// ids of spheres ([`Geometry::sphere`](curitiba_pipeline::scene::Geometry::sphere)).
    pub triangle: u32,
    /// Barycentric coordinate of corner 1.
    pub u: f32,
    /// Barycentric coordinate of corner 2.
    pub v: f32,
}

/// Many rays from one origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fan<'a> {
    /// Origin, world.
    pub origin: Vec3,
    /// If given, a unit vector such that `direction · above >= 0` for all directions, up to rounding. No ray then meets what lies wholly
    /// below the plane through the origin with this normal.
    pub above: Option<Vec3>,
    /// Hits have `t > t_min`; 0 or more.
    pub t_min: f32,
    /// Hits have `t < t_max`; may be infinite.
    pub t_max: f32,
    /// Unit directions.
    pub directions: &'a [Vec3],
}

impl Fan<'_> {
    /// The rays one by one.
    pub fn rays(&self) -> impl Iterator<Item = Ray> + '_ {
        let Self { origin, t_min, t_max, .. } = *self;
        self.directions.iter().map(move |&direction| Ray { origin, direction, t_min, t_max })
    }
}

/// Leaves that stopped recent rays: the rays that follow are often stopped by the same leaves. Any value is valid for any tracer.
#[derive(Debug, Clone)]
pub struct Recent {
    pub(crate) leaves: [u32; Self::LEAVES],
}

impl Recent {
    /// Number of leaves that are remembered.
    pub(crate) const LEAVES: usize = 4;
}

impl Default for Recent {
    fn default() -> Self {
        Self { leaves: [u32::MAX; Self::LEAVES] }
    }
}
