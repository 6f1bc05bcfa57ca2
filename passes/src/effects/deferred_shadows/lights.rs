//! The program for several lights, and for positional lights.

use super::light::{is_lit, side};
use crate::effects::interpolate::{interpolate, locate};
use crate::effects::lights::{Asked, Shading, Way};
use crate::effects::{Coverage, LevelZero, Pass, Pixel, Workspace, opaque};
use crate::trace::{Hit, Purpose, SurfacePoint, Tracer};
use glam::Vec3;

/// The share of the colour that shadows leave, for each channel (`Pass::share_of_lights`); alpha 1. It is 1 where no light arrives.
pub fn pixel<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, pixel: Pixel, work: &mut Workspace) -> [f32; 4] {
    let Some(id) = pass.triangle(pixel).filter(|_| is_lit(pass, pixel)) else { return [1.0; 4] };
    let point = pass.point_at(pixel, id);
    let facing = point.normal * side(pass, id, &point);
    let shading = Shading { normal: normal(pass, id, &point), hit: None };
    let share = pass.share_of_lights(
        &Asked { point: &point, facing, id, shading, key: pass.key(pixel) },
        work,
        |hit| pass.covers(hit),
        |way, work| match way {
            Way::Ray(ray) => {
                work.rays.shadow += 1;
                pass.announce_visibility(Purpose::Shadow, 1.0);
                Vec3::splat(if pass.tracer.occluded(ray, |hit| pass.covers(hit)) { 0.0 } else { 1.0 })
            }
            Way::Disc(disc) => {
                let buffers = (&mut work.disc, &mut work.rays.shadow);
                let covers = |hit: &Hit| pass.covers(hit);
                Vec3::splat(pass.disc_share((disc, 0.0), buffers, covers, |_, hit, _| pass.covers(hit)))
            }
        },
    );
    opaque(share)
}

/// The shading normal of a point that the camera sees, computed because the program does not read the stored one. Normal maps are read at level 0.
fn normal<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, id: u32, point: &SurfacePoint) -> Vec3 {
    let geometry = &pass.job.scene.geometry;
    if pass.sphere(id).is_some() || geometry.normals.is_empty() {
        return point.normal;
    }
    let hit: Hit = locate(geometry, id, point.position);
    let vertex = interpolate(geometry, &geometry.normals, &hit);
    let bent = pass.bent_normal(&hit, LevelZero, [vertex, point.normal]);
    bent.unwrap_or_else(|| vertex.normalize_or_zero())
}
