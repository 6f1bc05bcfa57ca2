//! Properties of a glass surface at a hit: the colour filter of transmitted light, the share that is scattered back (the veil), and the roughness.

use crate::effects::interpolate::interpolate;
use crate::effects::{Coverage, Footprint, Pass};
use crate::trace::{Hit, Tracer};
use curitiba_pipeline::color::{ColorSpace, decode};
use curitiba_pipeline::glass::Dielectric;
use glam::Vec3;

impl<T: Tracer, C: Coverage> Pass<'_, T, C> {
    /// The share of the unreflected light that passes the surface, by colour.
    pub(in crate::effects) fn filter(&self, hit: &Hit, footprint: impl Footprint, dielectric: &Dielectric) -> Vec3 {
        let scene = self.job.scene;
        let flat = self.sphere(hit.triangle).is_none();
        let texel = dielectric.filter_texture.filter(|_| flat).map_or(Vec3::ONE, |texture| {
            let texel = self.texel(texture, hit, footprint).truncate();
            // A share of light is linear, whatever the colour space of the pass is.
            if scene.textures[texture as usize].space == ColorSpace::Linear { texel } else { texel.map(decode) }
        });
        let vertices = if flat && dielectric.filter_vertex_colors && !scene.geometry.colors.is_empty() {
            let color = interpolate(&scene.geometry, &scene.geometry.colors, hit).truncate();
            if scene.geometry.color_space == ColorSpace::Linear { color } else { color.map(decode) }
        } else {
            Vec3::ONE
        };
        (1.0 - self.veil_at(hit, footprint, dielectric)) * dielectric.filter * texel * vertices
    }

    /// The share that is scattered back of the light that enters the surface at a hit.
    pub(in crate::effects) fn veil_at(&self, hit: &Hit, footprint: impl Footprint, dielectric: &Dielectric) -> f32 {
        let texture = dielectric.transmission_texture.filter(|_| self.sphere(hit.triangle).is_none());
        texture.map_or(dielectric.veil, |texture| {
            let clear = self.texel(texture, hit, footprint).x;
            1.0 - (1.0 - dielectric.veil) * clear
        })
    }

    /// The width of the distribution of microfacets at a hit; 0 where the surface is smooth.
    pub(in crate::effects) fn alpha(&self, hit: &Hit, footprint: impl Footprint, dielectric: &Dielectric) -> f32 {
        let Some(texture) = dielectric.roughness_texture.filter(|_| self.sphere(hit.triangle).is_none()) else {
            return dielectric.alpha;
        };
        let roughness = self.texel(texture, hit, footprint).y;
        let alpha = dielectric.alpha * roughness * roughness;
        if alpha < Dielectric::SMOOTH { 0.0 } else { alpha }
    }
}
