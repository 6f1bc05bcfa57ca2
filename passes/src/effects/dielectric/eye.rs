//! The bodies of glass that the camera, or another point, is in.

use super::lenses::Lenses;
use super::media::{Crossing, Media};
use crate::effects::{Coverage, LevelZero, Pass, Pixel};
use crate::trace::Tracer;
use curitiba_pipeline::backend::RayJob;
use curitiba_pipeline::glass::{GlassShadow, Shape};
use glam::Vec3;

/// Greatest number of surfaces that are looked at along a line; later ones are ignored.
const MOST: u32 = 4096;

/// Direction of the line from a point, not normalised: along no axis, no diagonal and no likely edge.
const DIRECTION: Vec3 = Vec3::new(0.352_071, 0.631_593, 0.690_733);

/// The bodies of glass that the camera is in.
pub fn around_eye<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>) -> Media {
    around(pass, pass.job.eye)
}

/// The bodies of glass that a point is in: those that a line from it leaves without having entered them.
pub(super) fn around<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, point: Vec3) -> Media {
    let solid = |material: u32| pass.job.dielectrics[material as usize].shape == Shape::Solid;
    if !pass.job.dielectrics.iter().any(|dielectric| dielectric.shape == Shape::Solid) {
        return Media::NONE;
    }
    let (direction, mut origin) = (DIRECTION.normalize(), point);
    let mut crossings = Vec::new();
    for _ in 0..MOST {
        let (ray, Some(hit)) = pass.closest(origin, direction) else { break };
        let surface = pass.surface_hit(&ray, &hit, LevelZero);
        let material = pass.material_of(hit.triangle);
        if solid(material) {
            crossings.push(Crossing { material, enters: surface.is_front() });
        }
        origin = surface.origin(direction);
    }
    Media::at_start_of(crossings, pass.job.dielectrics)
}

impl<T: Tracer, C: Coverage> Pass<'_, T, C> {
    /// Transmittance, by colour, between the camera and the surface that a pixel shows. If the camera is in a body, that body fills the whole
    /// distance, since no other surface is in between. Exactly 1 if the camera is in no body.
    ///
    /// Where the near plane cuts away the surface of that body, what is seen through the cut counts as seen from inside the body.
    pub(in crate::effects) fn kept_to_eye(&self, pixel: Pixel) -> Vec3 {
        let Some(body) = self.around_eye.top() else { return Vec3::ONE };
        let length = self.position(pixel).truncate().distance(self.job.eye);
        self.job.dielectrics[body as usize].transmittance(length)
    }
}

/// The spheres that focus light, if the job's rule of shadows needs them; else none.
///
/// # Errors
/// As [`Lenses::of`].
pub fn lenses<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>) -> Result<Lenses, String> {
    if !(T::SPHERES && asks_for_focus(pass.job)) {
        return Ok(Lenses::default());
    }
    Lenses::of(&pass.job.scene.geometry, pass.job.dielectrics, |center| around(pass, center).count() > 1)
}

/// Whether glass may focus the light of a job: its rule of shadows is `caustic`, and it has glass and a light.
pub fn asks_for_focus(job: &RayJob<'_>) -> bool {
    let asked = job.params.shadow == GlassShadow::Caustic && job.program.info().reads("shadow");
    asked && job.sun.is_some_and(|sun| sun.direction != Vec3::ZERO) && !job.dielectrics.is_empty()
}
