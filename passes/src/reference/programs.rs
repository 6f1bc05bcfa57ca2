//! The value of a picture for one sample of a pixel.

use super::disc::{self, Discs};
use super::job::{Job, Traced, Value};
use super::light::SHADOWED;
use super::media::Bodies;
use super::points::{Points, Purpose, cosine_direction};
use super::world::{Surface, World};
use crate::trace::DoubleRay;
use curitiba_pipeline::image::PixelFormat;
use curitiba_pipeline::programs::RayProgram;
use glam::{DVec2, DVec3, DVec4};

/// Number of occlusion directions in each of the two batches, at a point whose weight in the pixel is at least one half.
const DIRECTIONS: u32 = 8;
/// As [`DIRECTIONS`], at points behind glass whose weight in the pixel is below one half.
const FEW_DIRECTIONS: u32 = 4;

/// A sample of a pixel, shared by all passes.
pub(super) struct Sample<'w, 's> {
    pub world: &'w World<'s>,
    /// The surface that the camera ray hits.
    seen: Option<Surface>,
    /// The camera ray.
    pub ray: DoubleRay,
    /// Key of the pixel and of the estimate.
    pub key: u64,
    /// Index in the sequence of samples.
    pub index: u32,
}

impl<'w, 's> Sample<'w, 's> {
    /// Follows the camera ray through a place of the picture, in fractions of its width and height.
    pub fn new(world: &'w World<'s>, job: &Job<'_>, place: DVec2, (key, index): (u64, u32)) -> Self {
        let (seen, ray) = (&job.seen, job.seen.camera.ray(place));
        let hit = world.first(&ray, |hit| {
            let culled = seen.culled.get(world.material(hit.triangle)).is_some_and(|culled| *culled);
            !(culled && world.is_from_behind(hit, (ray.origin, ray.direction))) && world.covers(seen.look.shades, hit)
        });
        let seen = hit.map(|hit| world.surface(seen.look.shades, &hit, (ray.origin, ray.direction)));
        Self { world, seen, ray, key, index }
    }

    /// The value of the sample.
    pub fn value(&self, job: &Job<'_>, value: &Value<'_>) -> DVec4 {
        match value {
            Value::Constant(value) => *value,
            Value::Drawn => match &self.seen {
                Some(surface) => job.seen.look.seen_color(self.world, surface),
                None => job.seen.clear_color,
            },
            Value::Traced(pass, color) => self.traced(job, pass, color),
            Value::Product(color, factor) if factor.is_colored() => self.value(job, color) * self.value(job, factor),
            Value::Product(color, factor) => self.value(job, color) * self.value(job, factor).x,
            Value::Held(format, value) => {
                let value = self.value(job, value);
                match format {
                    PixelFormat::Rgba32Float | PixelFormat::Rgba16Float => value,
                    PixelFormat::Rgba8Unorm => value.clamp(DVec4::ZERO, DVec4::ONE),
                    PixelFormat::R8Unorm => DVec4::new(value.x.clamp(0.0, 1.0), 0.0, 0.0, 1.0),
                    PixelFormat::R32Float => DVec4::new(value.x, 0.0, 0.0, 1.0),
                    PixelFormat::Rg32Float => DVec4::new(value.x, value.y, 0.0, 1.0),
                }
            }
        }
    }

    fn traced(&self, job: &Job<'_>, pass: &Traced<'_>, color: &Value<'_>) -> DVec4 {
        let own = || self.value(job, color);
        let gray = |share: f64| DVec3::splat(share).extend(1.0);
        let Some(surface) = self.seen.as_ref().filter(|surface| !self.world.is_sky(surface.triangle)) else {
            return match pass.program {
                RayProgram::DeferredShadows | RayProgram::Ssao => gray(1.0),
                _ => own(),
            };
        };
        let glass = pass.look.glass[surface.material];
        match pass.program {
            RayProgram::DeferredShadows => {
                if job.seen.look.seen_cosine(surface) <= 0.0 {
                    return gray(1.0);
                }
                // The side that the raster pass shades is the one that the vertex normals point to.
                let facing = if surface.flat.dot(surface.vertex) < 0.0 { -surface.flat } else { surface.flat };
                let discs = Discs::of(pass, self.key, self.index);
                if !pass.look.lights.is_empty() {
                    let cosine = |towards: DVec3| pass.look.cosine_seen(surface, towards);
                    let covers = |hit: &crate::trace::DoubleHit| self.world.covers(pass.look.shades, hit);
                    let place = (surface, facing, true);
                    let passes = |(origin, direction): (DVec3, DVec3), reach: f64| {
                        let blocked = self.world.is_blocked(origin, direction, reach, covers);
                        if blocked { DVec3::ZERO } else { DVec3::ONE }
                    };
                    let share = pass.look.share_of_lights((self.world, discs), place, cosine, covers, passes);
                    return share.extend(1.0);
                }
                gray(disc::over(discs, 0, pass.look.toward_light(), |towards| {
                    if pass.look.is_lit(self.world, surface, (facing, towards)) { 1.0 } else { SHADOWED }
                }))
            }
            RayProgram::Ssao => {
                let stops = |hit: &crate::trace::DoubleHit| self.world.covers(pass.look.shades, hit);
                gray(self.open_share(pass, surface, (1.0, self.key), stops))
            }
            RayProgram::Reflection if glass => self.mirror(pass, surface, self.ray.direction).extend(1.0),
            RayProgram::Refraction | RayProgram::Final if glass && !pass.look.dielectrics.is_empty() => {
                self.of_material(pass, surface).extend(1.0)
            }
            RayProgram::Refraction | RayProgram::Final if glass => {
                self.pane(pass, surface, self.ray.direction, (0, 1.0, self.key)).extend(1.0)
            }
            RayProgram::Final => {
                // The colour was lit by the shading normal, not flipped to the viewer's side, so shadows belong to the side that this
                // normal points to.
                let turned = surface.shading.dot(surface.facing) < 0.0;
                let facing = if turned { -surface.facing } else { surface.facing };
                let color = self.kept_on_sight(pass, surface) * own().truncate();
                self.in_light(pass, color, surface, (facing, true), (1.0, self.key)).extend(1.0)
            }
            RayProgram::Refraction => {
                let color = own();
                (self.kept_on_sight(pass, surface) * color.truncate()).extend(color.w)
            }
            _ => own(),
        }
    }

    /// The transmittance, by colour, from a surface that the camera sees to the camera. With `glass=auto`, the medium around the camera reaches
    /// up to that surface, since no border of a body comes before it.
    fn kept_on_sight(&self, pass: &Traced<'_>, surface: &Surface) -> DVec3 {
        let (look, origin) = (&pass.look, self.ray.origin);
        if !look.absorbs() {
            return DVec3::ONE;
        }
        look.kept_in(&Bodies::around(self.world, look, origin), surface.position.distance(origin))
    }

    /// In `final`, the colour times the light share on the side of normal `facing`, and times the open share left by ambient occlusion; in other
    /// programs the colour itself. `is_seen` is true for a surface that the camera itself sees, false for one that a ray meets.
    pub(super) fn in_light(
        &self,
        pass: &Traced<'_>,
        color: DVec3,
        surface: &Surface,
        (facing, is_seen): (DVec3, bool),
        path: (f64, u64),
    ) -> DVec3 {
        if pass.program != RayProgram::Final || color == DVec3::ZERO || self.world.is_sky(surface.triangle) {
            return color;
        }
        let (world, look) = (self.world, &pass.look);
        let discs = Discs::of(pass, path.1, self.index);
        let to_light = look.toward_light();
        let light = match (look.lights.is_empty(), pass.is_straight()) {
            (true, false) => DVec3::splat(disc::over(discs, 0, to_light, |towards| {
                look.light_share(world, surface, (facing, towards))
            })),
            (true, true) => {
                disc::over(discs, 0, to_light, |towards| look.straight_share(world, surface, (facing, towards)))
            }
            (false, is_straight) => {
                let passes = |ray: (DVec3, DVec3), reach: f64| match is_straight {
                    true => look.straight(world, ray, reach),
                    false => DVec3::splat(look.dimmed(world, ray, reach).unwrap_or(0.0)),
                };
                look.lights_in_final((world, discs), surface, (facing, is_seen), passes)
            }
        };
        color * light * self.open_share(pass, surface, path, |hit| pass.look.stops_light(self.world, hit))
    }

    /// The open share of the cosine-weighted hemisphere to the power of the intensity; 1 where occlusion is off.
    /// Directions below the triangle are mirrored at its plane. `weight` is the point's weight in the pixel, and `key`
    /// that of the path to it.
    ///
    /// The power of a mean of few samples is biased, because a power is not linear. With two independent means `a` and `b` of a share,
    /// `2 power((a + b) / 2) - (power(a) + power(b)) / 2` has no bias to the first order of their variance (the jackknife).
    fn open_share(
        &self,
        pass: &Traced<'_>,
        surface: &Surface,
        (weight, key): (f64, u64),
        stops: impl Fn(&crate::trace::DoubleHit) -> bool,
    ) -> f64 {
        if pass.params.samples == 0 {
            return 1.0;
        }
        let count = if weight < 0.5 { FEW_DIRECTIONS } else { DIRECTIONS };
        let (origin, radius) = (self.world.leaving(surface, surface.facing), f64::from(pass.params.radius));
        let mean = |purpose: Purpose| {
            let points = Points::new(key, purpose);
            let open = (0..count).filter(|number| {
                let direction = cosine_direction(points.at(self.index * DIRECTIONS + number), surface.normal);
                let below = direction.dot(surface.facing).min(0.0);
                !self.world.is_blocked(origin, direction - 2.0 * below * surface.facing, radius, &stops)
            });
            open.count() as f64 / f64::from(count)
        };
        let (a, b) = (mean(Purpose::OcclusionA), mean(Purpose::OcclusionB));
        let power = |share: f64| share.powf(pass.params.intensity.into());
        2.0 * power((a + b) / 2.0) - (power(a) + power(b)) / 2.0
    }
}
