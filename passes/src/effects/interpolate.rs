//! Vertex attributes at a hit.

use crate::trace::Hit;
use curitiba_pipeline::scene::Geometry;
use glam::{Vec2, Vec3};

/// A vertex attribute, interpolated at a hit by its barycentric coordinates.
pub fn interpolate<V>(geometry: &Geometry, values: &[V], hit: &Hit) -> V
where
    V: Copy + std::ops::Mul<f32, Output = V> + std::ops::Add<Output = V>,
{
    weighed(geometry.triangles[hit.triangle as usize].map(|vertex| values[vertex as usize]), hit)
}

/// Values at the corners of a triangle, weighed by the barycentric coordinates of a hit.
pub fn weighed<V>([a, b, c]: [V; 3], hit: &Hit) -> V
where
    V: std::ops::Mul<f32, Output = V> + std::ops::Add<Output = V>,
{
    a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v
}

/// The barycentric coordinates of a point in a triangle's plane, as a hit at distance 0.
pub fn locate(geometry: &Geometry, triangle: u32, point: Vec3) -> Hit {
    let [a, b, c] = geometry.corners(triangle).map(|corner| corner.as_dvec3());
    let (e1, e2, to) = (b - a, c - a, point.as_dvec3() - a);
    let normal = e1.cross(e2);
    let area = normal.length_squared();
    Hit { t: 0.0, triangle, u: (to.cross(e2).dot(normal) / area) as f32, v: (e1.cross(to).dot(normal) / area) as f32 }
}

/// The texture coordinates at a hit.
pub fn texture_coordinates(geometry: &Geometry, hit: &Hit) -> Vec2 {
    interpolate(geometry, &geometry.texcoords, hit)
}
