//! The report's glass: one plane stands for a whole pane.

use super::job::Traced;
use super::points::branch;
use super::programs::Sample;
use super::world::Surface;
use glam::DVec3;

/// Factor of the colour for each bounce between glass surfaces.
const BOUNCE: f64 = 0.99;

/// The mirrored direction.
fn mirrored(direction: DVec3, normal: DVec3) -> DVec3 {
    direction - 2.0 * direction.dot(normal) * normal
}

/// The normal by which an interface mirrors and refracts. It is the shading normal, unless that looks away from the
/// viewer or would mirror into the surface; then the triangle's.
fn interface_normal(surface: &Surface, direction: DVec3) -> DVec3 {
    let usable = surface.normal.dot(direction) < 0.0 && mirrored(direction, surface.normal).dot(surface.facing) > 0.0;
    if usable { surface.normal } else { surface.facing }
}

/// Fresnel reflectance for unpolarised light, and the refracted direction; `None` at total reflection. `index` is the
/// refractive index of the far side over that of the near side.
fn split(direction: DVec3, normal: DVec3, index: f64) -> (f64, Option<DVec3>) {
    let near = (-direction.dot(normal)).clamp(0.0, 1.0);
    // Squared sine of the refracted angle, by Snell's law.
    let sine_squared = (1.0 - near * near) / (index * index);
    if sine_squared >= 1.0 {
        return (1.0, None);
    }
    let far = (1.0 - sine_squared).sqrt();
    let across = (near - index * far) / (near + index * far);
    let parallel = (index * near - far) / (index * near + far);
    let share = (across * across + parallel * parallel) / 2.0;
    let along = direction + normal * near;
    (share, (along / index - normal * far).try_normalize())
}

impl Sample<'_, '_> {
    /// The mirror of `reflection`: a chain of mirror rays from glass to glass, black after `depth` further glass hits.
    pub(super) fn mirror(&self, pass: &Traced<'_>, seen: &Surface, direction: DVec3) -> DVec3 {
        let (world, look) = (self.world, &pass.look);
        let (mut surface, mut direction) = (*seen, direction);
        for _ in 0..=pass.params.depth {
            direction = mirrored(direction, interface_normal(&surface, direction));
            let Some(hit) = world.closest(look.shades, world.leaving(&surface, direction), direction) else {
                return pass.beyond;
            };
            surface = world.surface(look.shades, &hit, direction);
            if !look.glass[surface.material] {
                return look.met_color(world, &surface);
            }
        }
        DVec3::ZERO
    }

    /// The colour of glass in a direction after so many bounces: reflected and refracted colours by their shares.
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
            // A bent normal can refract the ray back to the viewer's side; then the triangle's normal is used.
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

    /// The colour that a ray from glass hits.
    fn beyond_pane(
        &self,
        pass: &Traced<'_>,
        from: &Surface,
        direction: DVec3,
        (bounces, weight, key): (u32, f64, u64),
    ) -> DVec3 {
        let (world, look) = (self.world, &pass.look);
        let Some(hit) = world.closest(look.shades, world.leaving(from, direction), direction) else {
            return pass.beyond;
        };
        let glass = look.glass[world.material(hit.triangle)];
        if glass && bounces >= pass.params.depth {
            return DVec3::ZERO;
        }
        let surface = world.surface(look.shades, &hit, direction);
        if glass {
            return BOUNCE * self.pane(pass, &surface, direction, (bounces + 1, weight * BOUNCE, key));
        }
        let color = look.met_color(world, &surface);
        self.in_light(pass, color, &surface, (surface.facing, false), (weight, key))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shares_are_those_of_the_textbook() {
        for index in [1.1_f64, 1.5, 1.0 / 1.5] {
            let (straight, _) = split(-DVec3::Z, DVec3::Z, index);
            assert!((straight - ((index - 1.0) / (index + 1.0)).powi(2)).abs() < 1e-15);
            // At Brewster's angle only light polarised perpendicular to the plane of incidence is reflected.
            let brewster = index.atan();
            let (share, refracted) = split(DVec3::new(brewster.sin(), 0.0, -brewster.cos()), DVec3::Z, index);
            let expected = 0.5 * ((index * index - 1.0) / (index * index + 1.0)).powi(2);
            assert!((share - expected).abs() < 1e-15, "{share} {expected}");
            let refracted = refracted.expect("no total reflection");
            assert!((refracted.x * index - brewster.sin()).abs() < 1e-15 && refracted.z < 0.0);
        }
        let grazing = DVec3::new(0.99, 0.0, -(1.0 - 0.99_f64.powi(2)).sqrt());
        assert_eq!(split(grazing, DVec3::Z, 1.0 / 1.5), (1.0, None));
    }
}
