//! What a surface of glass takes beside Fresnel's share.

use crate::effects::interpolate::texture_coordinates;
use crate::effects::{Coverage, Pass};
use crate::trace::{Hit, Tracer};
use curitiba_pipeline::glass::Dielectric;
use glam::Vec3;

impl<T: Tracer, C: Coverage> Pass<'_, T, C> {
    /// The share of the light that passes, by colour, of that which is not reflected.
    pub(in crate::effects) fn filter(&self, hit: &Hit, dielectric: &Dielectric) -> Vec3 {
        let scene = self.job.scene;
        let texel = dielectric.filter_texture.map_or(Vec3::ONE, |texture| {
            let texel = scene.textures[texture as usize].sample(texture_coordinates(&scene.geometry, hit), 0.0);
            texel.truncate().map(linear)
        });
        (1.0 - dielectric.veil) * dielectric.filter * texel
    }
}

/// The linear value of a display value (IEC 61966-2-1).
fn linear(displayed: f32) -> f32 {
    if displayed <= 0.040_45 { displayed / 12.92 } else { ((displayed + 0.055) / 1.055).powf(2.4) }
}
