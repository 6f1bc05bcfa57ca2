//! What a surface of glass takes beside Fresnel's share.

use crate::effects::interpolate::texture_coordinates;
use crate::effects::{Coverage, Pass};
use crate::trace::{Hit, Tracer};
use curitiba_pipeline::color::{ColorSpace, decode};
use curitiba_pipeline::glass::Dielectric;
use glam::Vec3;

impl<T: Tracer, C: Coverage> Pass<'_, T, C> {
    /// The share of the light that passes, by colour, of that which is not reflected.
    pub(in crate::effects) fn filter(&self, hit: &Hit, dielectric: &Dielectric) -> Vec3 {
        let scene = self.job.scene;
        let texel = dielectric.filter_texture.map_or(Vec3::ONE, |texture| {
            let texture = &scene.textures[texture as usize];
            let texel = texture.sample(texture_coordinates(&scene.geometry, hit), 0.0).truncate();
            // A share of light is linear whatever the colours of the pass are.
            if texture.space == ColorSpace::Linear { texel } else { texel.map(decode) }
        });
        (1.0 - dielectric.veil) * dielectric.filter * texel
    }
}
