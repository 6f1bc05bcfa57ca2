//! The report's glass: each surface of glass is treated as a whole pane.

use super::job::Traced;
use super::optics::{interface_normal, mirrored, split};
use super::points::branch;
use super::programs::Sample;
use super::world::Surface;
use glam::DVec3;

/// Factor of the colour for each bounce between glass surfaces.
pub(super) const BOUNCE: f64 = 0.99;

impl Sample<'_, '_> {
    /// The mirror of `reflection`: a chain of mirror rays from glass to glass. It goes on at `depth` further surfaces of glass at most; the
    /// next one is black.
    pub(super) fn mirror(&self, pass: &Traced<'_>, seen: &Surface, direction: DVec3) -> DVec3 {
        let (world, look) = (self.world, &pass.look);
        let (mut surface, mut direction) = (*seen, direction);
        for _ in 0..=pass.params.depth {
            direction = mirrored(direction, interface_normal(&surface, direction));
            let origin = world.leaving(&surface, direction);
            let Some(hit) = world.closest(look.shades, origin, direction) else {
                return pass.beyond;
            };
            surface = world.surface(look.shades, &hit, (origin, direction));
            if !look.glass[surface.material] {
                return look.met_color(world, &surface);
            }
        }
        DVec3::ZERO
    }

    /// The colour of glass seen along `direction`, after `bounces` bounces: the reflected and the refracted colour, by their shares.
    pub(super) fn pane(
        &self,
        pass: &Traced<'_>,
        surface: &Surface,
        direction: DVec3,
        (bounces, weight, key): (u32, f64, u64),
    ) -> DVec3 {
        let index = f64::from(pass.params.index);
        let mut normal = interface_normal(surface, direction);
        let (mut share, mut refracted) = split(direction, normal, index);
        if refracted.is_some_and(|refracted| refracted.dot(surface.facing) >= 0.0) {
            // An interpolated or normal-mapped normal can refract the ray back to the viewer's side; then the triangle's normal is used.
            normal = surface.facing;
            (share, refracted) = split(direction, normal, index);
        }
        let reflected = (share > 0.0).then(|| (share, mirrored(direction, normal), 0));
        let refracted = refracted.filter(|_| share < 1.0).map(|refracted| (1.0 - share, refracted, 1));
        let ways = [reflected, refracted].into_iter().flatten();
        ways.map(|(share, way, number)| {
            share * self.beyond_pane(pass, surface, way, (bounces, weight * share, branch(key, number)))
        })
        .sum()
    }

    /// The colour of what a ray from glass hits; black if that is glass and `bounces` has reached the depth.
    fn beyond_pane(
        &self,
        pass: &Traced<'_>,
        from: &Surface,
        direction: DVec3,
        (bounces, weight, key): (u32, f64, u64),
    ) -> DVec3 {
        let (world, look) = (self.world, &pass.look);
        let origin = world.leaving(from, direction);
        let Some(hit) = world.closest(look.shades, origin, direction) else {
            return pass.beyond;
        };
        let glass = look.glass[world.material(hit.triangle)];
        if glass && bounces >= pass.params.depth {
            return DVec3::ZERO;
        }
        let surface = world.surface(look.shades, &hit, (origin, direction));
        if glass {
            return BOUNCE * self.pane(pass, &surface, direction, (bounces + 1, weight * BOUNCE, key));
        }
        let color = look.met_color(world, &surface);
        self.in_light(pass, color, &surface, (surface.facing, false), (weight, key))
    }
}
