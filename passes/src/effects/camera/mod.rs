//! Programs whose rays start at the camera: they read no G-buffer, and shade the surface that each ray hits.
//!
//! One integrator serves all of them. A pixel is the mean of its rays. Each ray samples one point of the pixel, one of
//! the lens and one of the light, and one direction at each surface that has several. Each of these choices has its own
//! sequence (`sampling::paths`). The programs differ in how they shade the surface that a ray hits. They exist in
//! corrected fidelity only.
//!
//! Modules, lower layers first: `eye`, ray origins; `light`, the light at a point; `bounce`, directions after a bounce; `whitted` and `paths`.

mod bounce;
mod eye;
mod light;
mod paths;
mod whitted;

pub use eye::Eye;

use super::coverage::Coverage;
use super::pass::{Pass, Pixel, opaque};
use super::ray_cone::{Cone, Footprint};
use super::surface::FootprintOf;
use super::workspace::Workspace;
use crate::sampling::hemisphere::{Basis, cosine, mirrored};
use crate::sampling::paths::{Place, Points};
use crate::trace::{Announcement, Hit, Purpose, Ray, Tracer};
use curitiba_pipeline::backend::{FromCamera, PixelCone};
use curitiba_pipeline::camera_programs::{SurfaceKind, with_gamma};
use curitiba_pipeline::programs::{RayParams, RayProgram};
use glam::{DVec3, Vec2, Vec3};

/// Factor of the light that a mirror reflects.
const MIRRORED: f32 = 0.8;
/// Factor of a clear pane, for what is seen through it and for shadow rays.
const CLEAR: f32 = 0.8;
/// Factor of a shadow ray at each glass surface.
const SHADOW_GLASS: f32 = 0.95;

/// A pass, with the further inputs of camera programs.
struct Walk<'p, 'a, T, C> {
    pass: &'p Pass<'a, T, C>,
    camera: FromCamera<'a>,
    params: &'p RayParams,
    /// Whether shadow rays end at glass, because the light behind it is found by paths that glass refracts.
    glass_stops: bool,
    /// The cone of one ray, which covers a part of the pixel.
    cone: PixelCone,
}

/// The mean of a pixel's rays, alpha 1.
///
/// # Panics
/// If the job has no camera.
pub fn pixel<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, pixel: Pixel, work: &mut Workspace) -> [f32; 4] {
    let (Some(camera), Some(eye)) = (pass.job.from_camera, &pass.eye) else { unreachable!("the job was checked") };
    let params = &pass.job.params;
    let glass_stops = pass.job.program == RayProgram::PathTracing && camera.surfaces.contains(&SurfaceKind::Light);
    let (key, rays) = (pass.key(pixel), params.samples.max(1));
    // Each of several rays covers only its share of the pixel's area.
    let side = (rays as f32).sqrt().recip();
    let cone = PixelCone { width: pass.job.cone.width * side, spread: pass.job.cone.spread * side };
    let walk = Walk { pass, camera, params, glass_stops, cone };
    let mut sum = DVec3::ZERO;
    for ray in 0..rays {
        let points = Points::new(key, params.first.wrapping_add(ray));
        let at = if params.samples == 0 { Vec2::splat(0.5) } else { points.at(Place::Film) };
        let [x, y] = [0, 1].map(|axis| pass.job.origin[axis] as f32 + [pixel.x, pixel.y][axis] as f32);
        let (origin, direction) = eye.ray(Vec2::new(x, y) + at, || points.at(Place::Lens));
        sum += walk.shown(origin, direction, &points, work).as_dvec3();
    }
    let mean = (sum / f64::from(rays)).as_vec3();
    opaque(with_gamma(mean, params.camera.gamma))
}

impl<T: Tracer, C: Coverage> Walk<'_, '_, T, C> {
    /// The colour that a ray from the camera shows.
    fn shown(&self, origin: Vec3, direction: Vec3, points: &Points, work: &mut Workspace) -> Vec3 {
        work.rays.camera += 1;
        self.pass.tracer.announce(Announcement { purpose: Purpose::Camera, bounce: 0, weight: 1.0 });
        if self.pass.job.program == RayProgram::PathTracing {
            return self.path(origin, direction, points, work);
        }
        let (ray, Some(hit)) = self.pass.closest(origin, direction) else { return self.pass.job.beyond };
        let cone = self.at_eye().along(hit.t);
        let footprint = self.pass.footprint(cone, &hit, direction);
        match self.pass.job.program {
            RayProgram::Albedo => self.pass.base_color(&hit, footprint),
            RayProgram::Lambert => self.lit(&ray, &hit, footprint),
            RayProgram::CameraOcclusion => self.open((&ray, &hit), footprint, points, work),
            _ => self.whitted((ray, hit), cone, 0, points, work),
        }
    }

    /// The cone of a ray at the eye.
    fn at_eye(&self) -> C::Cone {
        C::Cone::of_pixel(self.cone, 0.0)
    }

    fn kind(&self, hit: &Hit) -> SurfaceKind {
        self.camera.surfaces[self.pass.material_of(hit.triangle) as usize]
    }

    /// The Lambert colour: the light without shadows, plus ambient light.
    fn lit(&self, ray: &Ray, hit: &Hit, footprint: FootprintOf<C>) -> Vec3 {
        let surface = self.pass.surface_hit(ray, hit, footprint);
        let (to_light, color) = self.towards(surface.position());
        let cosine = surface.normal.dot(to_light).max(0.0);
        let share = (color * cosine + self.params.camera.ambient).min(Vec3::ONE);
        self.pass.base_color(hit, footprint) * share + self.pass.glow(hit, footprint)
    }

    /// 1 if one sampled direction of the hemisphere is open up to the radius, else 0.
    fn open(&self, (ray, hit): (&Ray, &Hit), footprint: impl Footprint, points: &Points, work: &mut Workspace) -> Vec3 {
        let surface = self.pass.surface_hit(ray, hit, footprint);
        let way = Basis::around(surface.normal).to_world(cosine(points.at(Place::Bounce(0))));
        let direction = mirrored(way, surface.facing);
        work.rays.occlusion += 1;
        self.pass.announce_visibility(Purpose::Occlusion, 1.0);
        let ray = Ray { origin: surface.origin(direction), direction, t_min: 0.0, t_max: self.params.radius };
        let open = !self.pass.tracer.occluded(&ray, |hit| self.pass.covers(hit));
        Vec3::splat(f32::from(u8::from(open)))
    }
}
