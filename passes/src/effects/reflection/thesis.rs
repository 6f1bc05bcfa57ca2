//! The program as the report's `reflection.cu` has it.

use crate::effects::optics::reflect;
use crate::effects::thesis::{self, face_forward};
use crate::effects::{Coverage, LevelZero, Pass, Pixel, Workspace, opaque};
use crate::trace::{Announcement, Purpose, Tracer};
use glam::Vec3;

/// The reflected colour of a glass pixel (by its mask); other pixels keep their colour.
pub fn pixel<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, pixel: Pixel, work: &mut Workspace) -> [f32; 4] {
    let color = pass.job.color[pixel.index];
    if !thesis::is_glass_mask(color) {
        return color;
    }
    let (position, view) = thesis::view(pass.position(pixel), pass.job.eye);
    opaque(chain(pass, position, reflect(view, pass.normal(pixel)), work))
}

fn chain<T: Tracer, C: Coverage>(
    pass: &Pass<'_, T, C>,
    mut origin: Vec3,
    mut direction: Vec3,
    work: &mut Workspace,
) -> Vec3 {
    for bounce in 0..=pass.job.params.depth {
        work.rays.reflected += 1;
        pass.tracer.announce(Announcement { purpose: Purpose::Reflected, bounce, weight: 1.0 });
        let (ray, Some(hit)) = pass.thesis_closest(origin, direction, thesis::EPSILON) else { return Vec3::ZERO };
        let (geometric, shading) = pass.thesis_normals(&hit);
        let normal = face_forward(shading, -ray.direction, geometric);
        if !pass.is_glass(hit.triangle) {
            return pass.lit_color(&hit, LevelZero, normal);
        }
        origin = thesis::position(&ray, &hit);
        direction = reflect(ray.direction, normal);
    }
    Vec3::ZERO
}
