//! The program with exact ray origins, glass by material, and normals flipped to face the viewer.

use crate::effects::optics::reflect;
use crate::effects::{Cone, Coverage, Pass, Pixel, Workspace, opaque};
use crate::trace::{Announcement, Purpose, Tracer};
use glam::Vec3;

/// The reflected colour of a glass pixel; other pixels keep their colour.
pub fn pixel<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, pixel: Pixel, work: &mut Workspace) -> [f32; 4] {
    let Some(triangle) = pass.triangle(pixel).filter(|triangle| pass.is_glass(*triangle)) else {
        return pass.job.color[pixel.index];
    };
    let (mut surface, mut view) = pass.surface_at(pixel, triangle, pass.normal(pixel));
    let (mut cone, mut triangle) = (pass.cone_at(&surface), triangle);
    for bounce in 0..=pass.job.params.depth {
        let normal = surface.interface_normal(view);
        let direction = reflect(view, normal);
        cone = cone.mirrored(|| pass.curvature(triangle, &surface), -normal.dot(view));
        work.rays.reflected += 1;
        pass.tracer.announce(Announcement { purpose: Purpose::Reflected, bounce, weight: 1.0 });
        let (ray, Some(hit)) = pass.closest(surface.origin(direction), direction) else {
            return opaque(pass.job.beyond);
        };
        cone = cone.along(hit.t);
        let footprint = pass.footprint(cone, &hit, direction);
        surface = pass.surface_hit(&ray, &hit, footprint);
        if !pass.is_glass(hit.triangle) {
            return opaque(pass.met_color(&hit, footprint, &surface));
        }
        (view, triangle) = (direction, hit.triangle);
    }
    opaque(Vec3::ZERO)
}
