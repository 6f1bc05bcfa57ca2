//! What materials look like at a hit.

use super::interpolate::{interpolate, texture_coordinates};
use super::pass::Pass;
use crate::trace::Hit;
use glam::Vec3;

/// The report's ambient light.
pub const AMBIENT: f32 = 0.3;

impl<T, C> Pass<'_, T, C> {
    /// The report's `closest_hit`: diffuse light, ambient light and texture (level 0), with this unit normal, times the vertex colour; and
    /// the light that the surface sends out.
    pub(super) fn lit_color(&self, hit: &Hit, normal: Vec3) -> Vec3 {
        let scene = self.job.scene;
        let shade = &self.job.shades[scene.geometry.material_of(hit.triangle) as usize];
        let diffuse = shade.diffuse.truncate();
        let lit = diffuse * (self.light_color * self.to_light.dot(normal).max(0.0));
        let reflected = match shade.texture {
            None => lit + AMBIENT * diffuse,
            Some(texture) => {
                let texel = scene.textures[texture as usize].sample(texture_coordinates(&scene.geometry, hit), 0.0);
                (lit + AMBIENT) * texel.truncate()
            }
        };
        let reflected = if shade.vertex_colors {
            reflected * interpolate(&scene.geometry, &scene.geometry.colors, hit).truncate()
        } else {
            reflected
        };
        let Some(glow) = shade.glow else { return reflected };
        let shining = glow.texture.map_or(Vec3::ONE, |texture| {
            scene.textures[texture as usize].sample(texture_coordinates(&scene.geometry, hit), 0.0).truncate()
        });
        reflected + glow.color * shining
    }
}
