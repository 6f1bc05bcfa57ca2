//! Several lights, and lights with a position: the light that arrives from them, and the share that their shadows leave.

use super::disc::{self, Discs};
use super::job::Look;
use super::light::{AMBIENT, texture};
use super::world::{Surface, World};
use crate::trace::DoubleHit;
use curitiba_pipeline::backend::Light;
use glam::DVec3;

/// Share of the distance to a light by which its shadow rays end before the light, as in the renderer.
const BEFORE_LIGHT: f64 = 1.0 / 1024.0;

/// Unit direction from a point to a light, and the light that arrives there by colour, for a cosine of 1.
fn arriving(light: &Light, point: DVec3) -> (DVec3, DVec3) {
    let color = light.color.as_dvec3();
    let Some(place) = light.place else { return (-light.direction.as_dvec3().normalize(), color) };
    let way = place.as_dvec3() - point;
    let distance = way.length();
    if distance == 0.0 {
        return (DVec3::ZERO, DVec3::ZERO);
    }
    let towards = way / distance;
    let [constant, linear, quadratic] = light.attenuation.map(f64::from);
    let mut factor = 1.0 / (constant + linear * distance + quadratic * distance * distance);
    factor *= (1.0 - (distance / f64::from(light.range)).powi(4)).max(0.0);
    if let Some(cone) = light.cone {
        let cosine = -towards.dot(light.direction.as_dvec3().normalize());
        let [inner, outer] = [cone.inner, cone.outer].map(f64::from);
        factor *= match cosine {
            _ if cosine >= inner => 1.0,
            _ if cosine <= outer => 0.0,
            _ => ((cosine - outer) / (inner - outer)).powi(2),
        };
        factor *= cosine.max(0.0).powf(f64::from(cone.exponent));
    }
    (towards, color * factor)
}

impl Look<'_> {
    /// The sum of the lights at a point, each times its cosine.
    pub(super) fn sum_of_lights(&self, point: DVec3, cosine: impl Fn(DVec3) -> f64) -> DVec3 {
        let each = |light: &Light| {
            let (towards, light) = arriving(light, point);
            light * cosine(towards)
        };
        self.lights.iter().map(each).sum()
    }

    /// The greatest cosine of a light that arrives at a surface that the camera sees.
    pub(super) fn greatest_cosine(&self, surface: &Surface) -> f64 {
        let each = |light: &Light| match arriving(light, surface.position) {
            (towards, light) if light != DVec3::ZERO => self.cosine_seen(surface, towards),
            _ => 0.0,
        };
        self.lights.iter().map(each).fold(0.0, f64::max)
    }

    /// The share of a surface's colour, on the side of normal `facing`, that shadows leave: ambient light and arriving light, divided by
    /// ambient light and the light without shadows. `is_seen` says whether the camera itself sees the surface. `passes` returns the share
    /// of a light that arrives along a ray (origin and direction) from a distance. Hits for which `stops` is true block the path from a
    /// triangle to the round surface that it approximates. A light with a disc counts by the part of its disc that is visible.
    pub(super) fn share_of_lights(
        &self,
        (world, discs): (&World<'_>, Option<Discs>),
        (surface, facing, is_seen): (&Surface, DVec3, bool),
        cosine: impl Fn(DVec3) -> f64,
        stops: impl Fn(&DoubleHit) -> bool,
        passes: impl Fn((DVec3, DVec3), f64) -> DVec3,
    ) -> DVec3 {
        let (mut whole, mut left) = (DVec3::ZERO, DVec3::ZERO);
        // The unblocked share of a light from a direction.
        let part = |light: &Light, towards: DVec3| {
            let Some(origin) = self.start_to_light(world, surface, (facing, towards), &stops) else {
                return DVec3::ZERO;
            };
            let (direction, reach) = match light.place {
                None => (towards, f64::INFINITY),
                Some(place) => {
                    let way = place.as_dvec3() - origin;
                    (way.normalize(), way.length() * (1.0 - BEFORE_LIGHT))
                }
            };
            passes((origin, direction), reach)
        };
        for (number, light) in self.lights.iter().enumerate() {
            let (towards, color) = arriving(light, surface.position);
            let color = color * cosine(towards);
            if color == DVec3::ZERO {
                continue;
            }
            whole += color;
            let discs = discs.filter(|_| light.place.is_none());
            left += color * disc::over(discs, number, towards, |towards| part(light, towards));
        }
        let shade = &self.shades[surface.material];
        let diffuse = shade.diffuse.as_dvec4().truncate();
        let ambient = match texture(world, shade, surface) {
            None => diffuse * AMBIENT,
            Some(_) if is_seen => shade.emission.as_dvec4().truncate() + AMBIENT,
            Some(_) => DVec3::splat(AMBIENT),
        };
        let share = |axis: usize| {
            let [part, all] = [left, whole].map(|light| ambient[axis] + diffuse[axis] * light[axis]);
            if all > 0.0 { part / all } else { 1.0 }
        };
        DVec3::from([0, 1, 2].map(share))
    }

    /// [`Self::share_of_lights`] in `final`, where `passes` returns the share of light that glass leaves.
    pub(super) fn lights_in_final(
        &self,
        (world, discs): (&World<'_>, Option<Discs>),
        surface: &Surface,
        (facing, is_seen): (DVec3, bool),
        passes: impl Fn((DVec3, DVec3), f64) -> DVec3,
    ) -> DVec3 {
        let cosine = |towards: DVec3| match is_seen {
            true => self.cosine_seen(surface, towards),
            false => self.cosine_met(surface, towards),
        };
        let stops = |hit: &DoubleHit| self.stops_light(world, hit);
        self.share_of_lights((world, discs), (surface, facing, is_seen), cosine, stops, passes)
    }
}
