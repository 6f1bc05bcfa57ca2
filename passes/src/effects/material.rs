//! The colours and normals of materials at a hit.

use super::coverage::Coverage;
use super::interpolate::{interpolate, texture_coordinates};
use super::pass::Pass;
use super::ray_cone::Footprint;
use crate::trace::{Hit, Tracer};
use curitiba_pipeline::backend::Shade;
use curitiba_pipeline::scene::normal_map;
use glam::{Vec3, Vec4};

/// Normals whose squared length is at most this have cancelled out, as in the rasteriser.
pub const LEAST_SQUARE: f32 = 1e-30;

/// The report's ambient light.
pub const AMBIENT: f32 = 0.3;

impl<T: Tracer, C: Coverage> Pass<'_, T, C> {
    /// The colour that the report's shader `closest_hit` computes, for this unit normal: diffuse and ambient light times texture, times
    /// vertex colour, plus the light that the surface emits. Textures are read at the mip level of the footprint. Spheres have
    /// neither texture coordinates nor vertex colours.
    pub(super) fn lit_color(&self, hit: &Hit, footprint: impl Footprint, normal: Vec3) -> Vec3 {
        let shade = &self.job.shades[self.material_of(hit.triangle) as usize];
        let lit = shade.diffuse.truncate() * (self.light_color * self.light_cosine(hit, normal));
        self.reflected_color(hit, footprint, (shade, lit))
    }

    /// The colour at a hit on a material with this shade. `lit` is the diffuse light without the ambient light.
    #[inline(always)]
    pub(super) fn reflected_color(&self, hit: &Hit, footprint: impl Footprint, (shade, lit): (&Shade, Vec3)) -> Vec3 {
        let scene = self.job.scene;
        let diffuse = shade.diffuse.truncate();
        let flat = self.sphere(hit.triangle).is_none();
        let reflected = match shade.texture.filter(|_| flat) {
            None => lit + AMBIENT * diffuse,
            Some(texture) => {
                let texel = self.texel(texture, hit, footprint);
                (lit + AMBIENT) * texel.truncate()
            }
        };
        let reflected = if shade.vertex_colors && flat {
            reflected * interpolate(&scene.geometry, &scene.geometry.colors, hit).truncate()
        } else {
            reflected
        };
        if shade.glow.is_some() { reflected + self.glow(hit, footprint) } else { reflected }
    }

    /// The cosine of the light on a surface with this unit normal; 0 where the surface faces away.
    pub(super) fn light_cosine(&self, hit: &Hit, normal: Vec3) -> f32 {
        self.cosine_to(hit, normal, self.to_light)
    }

    /// [`Self::light_cosine`] of a light in this direction.
    #[inline(always)]
    pub(super) fn cosine_to(&self, hit: &Hit, normal: Vec3, to_light: Vec3) -> f32 {
        let shade = &self.job.shades[self.material_of(hit.triangle) as usize];
        let bent = shade.normal_map.is_some() && self.sphere(hit.triangle).is_none();
        if bent && !self.vertices_face(hit, normal, to_light) { 0.0 } else { to_light.dot(normal).max(0.0) }
    }

    /// The light that a triangle or sphere reflects of a light of intensity 1 at a cosine of 1, without [`AMBIENT`]. The unit is the colour
    /// of the texture, or the diffuse colour where there is no texture.
    pub(super) fn tint(&self, id: u32) -> Vec3 {
        let shade = &self.job.shades[self.material_of(id) as usize];
        let textured = shade.texture.is_some() && self.sphere(id).is_none();
        if textured { shade.diffuse.truncate() } else { Vec3::ONE }
    }

    /// The value of a texture at a hit, at the mip level of the footprint.
    pub(super) fn texel(&self, texture: u32, hit: &Hit, footprint: impl Footprint) -> Vec4 {
        let texture = &self.job.scene.textures[texture as usize];
        texture.sample(texture_coordinates(&self.job.scene.geometry, hit), footprint.level(texture))
    }

    /// The light that a surface emits at a hit.
    pub(super) fn glow(&self, hit: &Hit, footprint: impl Footprint) -> Vec3 {
        let flat = self.sphere(hit.triangle).is_none();
        let Some(glow) = self.job.shades[self.material_of(hit.triangle) as usize].glow else { return Vec3::ZERO };
        let shining =
            glow.texture.filter(|_| flat).map_or(Vec3::ONE, |texture| self.texel(texture, hit, footprint).truncate());
        glow.color * shining
    }

    /// The diffuse reflectance at a hit: diffuse colour times texture times vertex colour.
    pub(super) fn base_color(&self, hit: &Hit, footprint: impl Footprint) -> Vec3 {
        let scene = self.job.scene;
        let shade = &self.job.shades[self.material_of(hit.triangle) as usize];
        let mut color = shade.diffuse.truncate();
        if self.sphere(hit.triangle).is_some() {
            return color;
        }
        if let Some(texture) = shade.texture {
            color *= self.texel(texture, hit, footprint).truncate();
        }
        if shade.vertex_colors {
            color *= interpolate(&scene.geometry, &scene.geometry.colors, hit).truncate();
        }
        color
    }

    /// The normal at a hit, bent by the normal map; `None` where the material has none. `vertex` is the
    /// interpolated vertex normal, and `flat` the triangle's normal.
    pub(super) fn bent_normal(&self, hit: &Hit, footprint: impl Footprint, [vertex, flat]: [Vec3; 2]) -> Option<Vec3> {
        let geometry = &self.job.scene.geometry;
        if geometry.tangents.is_empty() || vertex.length_squared() <= LEAST_SQUARE {
            return None;
        }
        let map = self.job.shades[geometry.material_of(hit.triangle) as usize].normal_map?;
        let texel = self.texel(map.texture, hit, footprint);
        let tangent = interpolate(geometry, &geometry.tangents, hit);
        Some(normal_map::bent(texel.truncate(), map.scale, vertex, tangent, flat))
    }

    /// Whether the vertex normal faces a light, after it is flipped to the side of the triangle that `bent` is on.
    fn vertices_face(&self, hit: &Hit, bent: Vec3, to_light: Vec3) -> bool {
        let geometry = &self.job.scene.geometry;
        let [a, b, c] = geometry.corners(hit.triangle);
        let flat = (b - a).cross(c - a);
        let vertex = interpolate(geometry, &geometry.normals, hit);
        let turned = (flat.dot(vertex) < 0.0) != (flat.dot(bent) < 0.0);
        let cosine = vertex.dot(to_light);
        (if turned { -cosine } else { cosine }) > 0.0
    }
}
