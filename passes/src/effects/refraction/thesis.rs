//! As the report's `refraction.cu`; `final` shares the glass.

use crate::effects::optics::reflect;
use crate::effects::optix::{self, face_forward};
use crate::effects::{Coverage, Pass, Pixel, Workspace, opaque};
use crate::trace::{Hit, Ray, Tracer};
use glam::Vec3;

/// The blended colour of a glass pixel (by its mask), else the colour as it is.
pub fn pixel<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, pixel: Pixel, work: &mut Workspace) -> [f32; 4] {
    let color = pass.job.color[pixel.index];
    if optix::is_glass_mask(color) { opaque(glass_pixel(pass, pixel, work, &shade)) } else { color }
}

/// `closest_hit`.
fn shade<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, ray: &Ray, hit: &Hit, _: &mut Workspace) -> Vec3 {
    let (geometric, shading) = pass.thesis_normals(hit);
    pass.lit_color(hit, face_forward(shading, -ray.direction, geometric))
}

/// The glass branch of `buffer_camera`; `shade` is `closest_hit`.
pub(in crate::effects) fn glass_pixel<'a, T: Tracer, C: Coverage>(
    pass: &Pass<'a, T, C>,
    pixel: Pixel,
    work: &mut Workspace,
    shade: &impl Fn(&Pass<'a, T, C>, &Ray, &Hit, &mut Workspace) -> Vec3,
) -> Vec3 {
    let (position, view) = optix::view(pass.position(pixel), pass.job.eye);
    let normal = pass.normal(pixel);
    let reflected = chain(pass, position, reflect(view, normal), optix::EPSILON, Kind::Reflected, work, shade);
    let index = pass.job.params.index;
    let Some(direction) = optix::refract(view, normal, index) else { return reflected };
    let refracted = chain(pass, position, direction, optix::REFRACTED_EPSILON, Kind::Refracted, work, shade);
    let weight = optix::coefficient(index, normal, view);
    weight * refracted + (1.0 - weight) * reflected
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Reflected,
    Refracted,
}

/// `rtTrace` of a radiance ray. `closest_hit_glass` keeps the reflected colour only, so the bounces are a chain: dimmed by
/// 0.99 where refraction is possible, and not where it is not, since only the refracting branch writes its result.
fn chain<'a, T: Tracer, C: Coverage>(
    pass: &Pass<'a, T, C>,
    mut origin: Vec3,
    mut direction: Vec3,
    mut t_min: f32,
    kind: Kind,
    work: &mut Workspace,
    shade: &impl Fn(&Pass<'a, T, C>, &Ray, &Hit, &mut Workspace) -> Vec3,
) -> Vec3 {
    let mut weight = 1.0;
    for bounce in 0..=pass.job.params.depth {
        if bounce == 0 && kind == Kind::Refracted {
            work.rays.refracted += 1;
        } else {
            work.rays.reflected += 1;
        }
        let (ray, Some(hit)) = pass.thesis_closest(origin, direction, t_min) else { break };
        if !pass.is_glass(hit.triangle) {
            return weight * shade(pass, &ray, &hit, work);
        }
        let (geometric, shading) = pass.thesis_normals(&hit);
        let normal = face_forward(shading, -ray.direction, geometric);
        if optix::refract(ray.direction, normal, pass.job.params.index).is_some() {
            weight *= optix::BOUNCE;
        }
        origin = optix::position(&ray, &hit);
        direction = reflect(ray.direction, normal);
        t_min = optix::EPSILON;
    }
    Vec3::ZERO
}
