//! The program as the report's `refraction.cu` has it; `final` shares this glass.

use crate::effects::optics::reflect;
use crate::effects::thesis::{self, face_forward};
use crate::effects::{Coverage, LevelZero, Pass, Pixel, Workspace, opaque};
use crate::trace::{Announcement, Hit, Purpose, Ray, Tracer};
use glam::Vec3;

/// The blended colour of a glass pixel (by its mask); other pixels keep their colour.
pub fn pixel<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, pixel: Pixel, work: &mut Workspace) -> [f32; 4] {
    let color = pass.job.color[pixel.index];
    if thesis::is_glass_mask(color) { opaque(glass_pixel(pass, pixel, work, &shade)) } else { color }
}

/// The report's `closest_hit`.
fn shade<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, ray: &Ray, hit: &Hit, _: &mut Workspace) -> Vec3 {
    let (geometric, shading) = pass.thesis_normals(hit);
    pass.lit_color(hit, LevelZero, face_forward(shading, -ray.direction, geometric))
}

/// The glass branch of `buffer_camera`; `shade` is `closest_hit`.
pub(in crate::effects) fn glass_pixel<'a, T: Tracer, C: Coverage>(
    pass: &Pass<'a, T, C>,
    pixel: Pixel,
    work: &mut Workspace,
    shade: &impl Fn(&Pass<'a, T, C>, &Ray, &Hit, &mut Workspace) -> Vec3,
) -> Vec3 {
    let (position, view) = thesis::view(pass.position(pixel), pass.job.eye);
    let normal = pass.normal(pixel);
    let index = pass.job.params.index;
    let mirrored = reflect(view, normal);
    let Some(direction) = thesis::refract(view, normal, index) else {
        return chain(pass, (position, mirrored, thesis::EPSILON), (Purpose::Reflected, 1.0), work, shade);
    };
    let weight = thesis::coefficient(index, normal, view);
    let reflected = chain(pass, (position, mirrored, thesis::EPSILON), (Purpose::Reflected, 1.0 - weight), work, shade);
    let through = (position, direction, thesis::REFRACTED_EPSILON);
    let refracted = chain(pass, through, (Purpose::Refracted, weight), work, shade);
    weight * refracted + (1.0 - weight) * reflected
}

/// The report's `rtTrace` of a radiance ray. Its `closest_hit_glass` keeps the reflected colour only, so bounces form a
/// chain. A bounce is dimmed by 0.99 where refraction is possible, and not at total reflection, because only the
/// refracting branch writes its result.
///
/// `start` is origin, direction and least distance of the first ray; `first` is that ray's purpose and weight.
fn chain<'a, T: Tracer, C: Coverage>(
    pass: &Pass<'a, T, C>,
    start: (Vec3, Vec3, f32),
    first: (Purpose, f32),
    work: &mut Workspace,
    shade: &impl Fn(&Pass<'a, T, C>, &Ray, &Hit, &mut Workspace) -> Vec3,
) -> Vec3 {
    let (mut origin, mut direction, mut t_min) = start;
    let (mut purpose, mut share) = first;
    let mut weight = 1.0;
    for bounce in 0..=pass.job.params.depth {
        if purpose == Purpose::Refracted {
            work.rays.refracted += 1;
        } else {
            work.rays.reflected += 1;
        }
        pass.tracer.announce(Announcement { purpose, bounce, weight: share });
        let (ray, Some(hit)) = pass.thesis_closest(origin, direction, t_min) else { break };
        if !pass.is_glass(hit.triangle) {
            return weight * shade(pass, &ray, &hit, work);
        }
        let (geometric, shading) = pass.thesis_normals(&hit);
        let normal = face_forward(shading, -ray.direction, geometric);
        let dims = thesis::refract(ray.direction, normal, pass.job.params.index).is_some();
        (purpose, share) = (Purpose::Reflected, if dims { thesis::BOUNCE } else { 1.0 });
        weight *= share;
        origin = thesis::position(&ray, &hit);
        direction = reflect(ray.direction, normal);
        t_min = thesis::EPSILON;
    }
    Vec3::ZERO
}
