//! The program with exact ray origins, glass by material, and normals turned to the viewer.

use crate::effects::optics::reflect;
use crate::effects::{Coverage, Pass, Pixel, Workspace, opaque};
use crate::trace::{Announcement, Purpose, Tracer};
use glam::Vec3;

/// The reflected colour of a glass pixel; other pixels keep their colour.
pub fn pixel<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, pixel: Pixel, work: &mut Workspace) -> [f32; 4] {
    let Some(triangle) = pass.triangle(pixel).filter(|triangle| pass.is_glass(*triangle)) else {
        return pass.job.color[pixel.index];
    };
    let (mut surface, mut view) = pass.surface_at(pixel, triangle, pass.normal(pixel));
    for bounce in 0..=pass.job.params.depth {
        let direction = reflect(view, surface.interface_normal(view));
        work.rays.reflected += 1;
        pass.tracer.announce(Announcement { purpose: Purpose::Reflected, bounce, weight: 1.0 });
        let (ray, Some(hit)) = pass.closest(surface.origin(direction), direction) else {
            return opaque(pass.job.beyond);
        };
        surface = pass.surface_hit(&ray, &hit);
        if !pass.is_glass(hit.triangle) {
            return opaque(pass.lit_color(&hit, surface.normal));
        }
        view = direction;
    }
    opaque(Vec3::ZERO)
}
