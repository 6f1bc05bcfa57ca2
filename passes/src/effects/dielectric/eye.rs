//! What the camera is in.

use super::media::{Crossing, Media};
use crate::effects::{Coverage, Pass};
use crate::trace::Tracer;
use curitiba_pipeline::glass::Shape;
use glam::Vec3;

/// Surfaces that are looked at, at most: a line through a scene of any size meets fewer.
const MOST: u32 = 4096;

/// Along no axis, no diagonal and no likely edge.
const DIRECTION: Vec3 = Vec3::new(0.352_071, 0.631_593, 0.690_733);

/// The bodies of glass that the camera is in: those that a line from it leaves without having entered them.
pub fn around_eye<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>) -> Media {
    let solid = |material: u32| pass.job.dielectrics[material as usize].shape == Shape::Solid;
    if !pass.job.dielectrics.iter().any(|dielectric| dielectric.shape == Shape::Solid) {
        return Media::NONE;
    }
    let (direction, mut origin) = (DIRECTION.normalize(), pass.job.eye);
    let mut crossings = Vec::new();
    for _ in 0..MOST {
        let (ray, Some(hit)) = pass.closest(origin, direction) else { break };
        let surface = pass.surface_hit(&ray, &hit);
        let material = pass.material_of(hit.triangle);
        if solid(material) {
            crossings.push(Crossing { material, enters: surface.is_front() });
        }
        origin = surface.origin(direction);
    }
    Media::at_start_of(crossings, pass.job.dielectrics)
}
