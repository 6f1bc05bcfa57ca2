//! The program as the report's `final.cu` has it.

use crate::effects::light::SHADOWED;
use crate::effects::refraction::thesis::glass_pixel;
use crate::effects::thesis::{self, face_forward};
use crate::effects::{Coverage, LevelZero, Pass, Pixel, Workspace, opaque};
use crate::trace::{Hit, Ray, Tracer};
use glam::{Vec3, Vec4};

/// The colour of glass (by its mask) or else the shadowed colour, times the ambient occlusion; alpha 1.
pub fn pixel<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, pixel: Pixel, work: &mut Workspace) -> [f32; 4] {
    let color = pass.job.color[pixel.index];
    let position = pass.position(pixel).truncate();
    let open = pass.thesis_occlusion(position, pass.normal(pixel), work, |hit| !pass.passes_light(hit));
    let color = if thesis::is_glass_mask(color) {
        glass_pixel(pass, pixel, work, &shade)
    } else {
        Vec4::from_array(color).truncate() * light_share(pass, position, work)
    };
    opaque(color * open)
}

/// A shadow ray: `any_hit_shadow_glass` dims the payload, but `miss_shadow` sets it to 1, so glass takes nothing away.
fn light_share<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, position: Vec3, work: &mut Workspace) -> f32 {
    work.rays.shadow += 1;
    if pass.thesis_sees_light(position, |hit| !pass.passes_light(hit)) { 1.0 } else { SHADOWED }
}

/// The report's `closest_hit`. It passes the ray's direction to `faceforward` where the other programs pass the opposite direction. So the normal
/// faces away from the viewer, both for the light and for the occlusion hemisphere.
fn shade<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, ray: &Ray, hit: &Hit, work: &mut Workspace) -> Vec3 {
    let (geometric, shading) = pass.thesis_normals(hit);
    let normal = face_forward(shading, ray.direction, geometric);
    let position = thesis::position(ray, hit);
    let color = pass.lit_color(hit, LevelZero, normal) * light_share(pass, position, work);
    color * pass.thesis_occlusion(position, normal, work, |hit| !pass.passes_light(hit))
}
