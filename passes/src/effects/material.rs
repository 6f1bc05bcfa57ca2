//! What materials look like at a hit, and where they are cut out.

use super::Pass;
use crate::trace::Hit;
use curitiba_pipeline::backend::Shade;
use curitiba_pipeline::scene::{Geometry, RenderScene};
use glam::{Vec2, Vec3};

/// The report's ambient light.
pub const AMBIENT: f32 = 0.3;

/// Says where the surface of a triangle really is.
pub trait Coverage: Sync {
    /// Whether there is a surface at this point of the triangle.
    fn covers(&self, hit: &Hit) -> bool;
}

/// Every triangle is whole.
#[derive(Debug, Clone, Copy)]
pub struct Opaque;

impl Coverage for Opaque {
    fn covers(&self, _: &Hit) -> bool {
        true
    }
}

/// Triangles are cut out where the texture's alpha (level 0) is below the material's cutoff.
#[derive(Debug, Clone, Copy)]
pub struct AlphaTested<'a> {
    /// Whose triangles are hit.
    pub scene: &'a RenderScene,
    /// By material.
    pub shades: &'a [Shade],
}

impl Coverage for AlphaTested<'_> {
    fn covers(&self, hit: &Hit) -> bool {
        let shade = &self.shades[self.scene.geometry.material_of(hit.triangle) as usize];
        let (Some(texture), Some(cutoff)) = (shade.texture, shade.alpha_cutoff) else { return true };
        let uv = texture_coordinates(&self.scene.geometry, hit);
        self.scene.textures[texture as usize].sample(uv, 0.0).w >= cutoff
    }
}

/// A vertex attribute at a hit.
pub fn interpolate<V>(geometry: &Geometry, values: &[V], hit: &Hit) -> V
where
    V: Copy + std::ops::Mul<f32, Output = V> + std::ops::Add<Output = V>,
{
    let [a, b, c] = geometry.triangles[hit.triangle as usize].map(|vertex| values[vertex as usize]);
    a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v
}

/// The barycentric coordinates of a point in the plane of a triangle, as a hit at distance 0.
pub fn locate(geometry: &Geometry, triangle: u32, point: Vec3) -> Hit {
    let [a, b, c] = geometry.corners(triangle).map(|corner| corner.as_dvec3());
    let (e1, e2, to) = (b - a, c - a, point.as_dvec3() - a);
    let normal = e1.cross(e2);
    let area = normal.length_squared();
    Hit { t: 0.0, triangle, u: (to.cross(e2).dot(normal) / area) as f32, v: (e1.cross(to).dot(normal) / area) as f32 }
}

fn texture_coordinates(geometry: &Geometry, hit: &Hit) -> Vec2 {
    interpolate(geometry, &geometry.texcoords, hit)
}

impl<T, C> Pass<'_, T, C> {
    /// The report's `closest_hit`: diffuse light, ambient light and texture (level 0), with this unit normal.
    pub(super) fn lit_color(&self, hit: &Hit, normal: Vec3) -> Vec3 {
        let scene = self.job.scene;
        let shade = &self.job.shades[scene.geometry.material_of(hit.triangle) as usize];
        let diffuse = shade.diffuse.truncate();
        let lit = diffuse * (self.light_color * self.to_light.dot(normal).max(0.0));
        match shade.texture {
            None => lit + AMBIENT * diffuse,
            Some(texture) => {
                let texel = scene.textures[texture as usize].sample(texture_coordinates(&scene.geometry, hit), 0.0);
                (lit + AMBIENT) * texel.truncate()
            }
        }
    }
}
