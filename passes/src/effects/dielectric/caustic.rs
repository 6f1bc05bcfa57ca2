//! Light that exact spheres of glass focus on surfaces.

use super::ball::{Bundle, Turned};
use super::lenses::Lens;
use crate::effects::material::AMBIENT;
use crate::effects::optics::interface_of;
use crate::effects::surface::Surface;
use crate::effects::{Coverage, Pass, Workspace};
use crate::trace::{Ray, Tracer};
use glam::{DVec2, DVec3, Vec3};

/// Radius of the disc over which the light of a point source is averaged, as a share of the sphere's radius. If the light is a disc whose blur is
/// larger, the blur is taken instead.
pub const WIDTH: f64 = 1e-3;

/// How a surface reflects light, and how much of the light its colour contains.
#[derive(Debug, Clone, Copy)]
pub(in crate::effects) struct Lit {
    /// Unit normal by which it was lit.
    pub(in crate::effects) normal: Vec3,
    /// Cosine of the light that its colour contains.
    pub(in crate::effects) cosine: f32,
    /// Factor of the light that its colour contains, by colour, without [`AMBIENT`].
    pub(in crate::effects) tint: Vec3,
}

impl Lit {
    /// The colour that a light of colour `light` from a unit direction would give the surface, as a share of the surface's own colour.
    pub(super) fn share(&self, light: Vec3, towards: Vec3) -> Vec3 {
        let taken = |cosine: f32| self.tint * light * cosine + AMBIENT;
        taken(self.normal.dot(towards).max(0.0)) / taken(self.cosine)
    }
}

/// The plane through a point, a sphere's centre and the direction of the light.
struct Plane {
    /// Away from the axis, towards the point.
    side: DVec3,
    /// The direction in which the light travels.
    axis: DVec3,
}

impl Plane {
    /// A vector of the plane; its first coordinate is on the side of a bundle.
    fn vector(&self, bundle: &Bundle, vector: DVec2) -> DVec3 {
        self.side * (bundle.side * vector.x) + self.axis * vector.y
    }
}

impl<T: Tracer, C: Coverage> Pass<'_, T, C> {
    /// The light that spheres focus on a surface, as a share of the surface's colour. Each bundle of rays on the side with the unit normal
    /// `facing` counts as a light of the bundle's direction and strength.
    #[inline(never)]
    pub(in crate::effects) fn focused_light(
        &self,
        surface: &Surface,
        facing: Vec3,
        lit: &Lit,
        work: &mut Workspace,
    ) -> Vec3 {
        let (axis, blur) = (axis(self.to_light), blur(self.job.params.sun));
        let mut light = Vec3::ZERO;
        for (lens, ball) in self.focused.lenses.iter() {
            let from = (surface.position().as_dvec3() - lens.center) / lens.radius;
            // A point in the sphere gets no focused light.
            if from.length_squared() <= 1.0 {
                continue;
            }
            let along = from.dot(axis);
            let across = from - along * axis;
            let at = DVec2::new(across.length(), along);
            let side = across.try_normalize().unwrap_or_else(|| axis.any_orthonormal_vector());
            let plane = Plane { side, axis };
            // For another point of the light's disc the rays are rotated about the sphere's centre, so the blur grows with the distance from the
            // centre.
            let width = WIDTH.max(from.length() * blur);
            ball.bundles(at, width, self.kept(lens), |bundle| {
                if facing.dot(plane.vector(&bundle, bundle.ray.direction).as_vec3()) < 0.0 {
                    light += self.bundle_light(surface, lit, (lens, &plane, &bundle), work);
                }
            });
        }
        light
    }

    /// The share of light that a ray keeps in a sphere.
    fn kept(&self, lens: &Lens) -> impl Fn(&Turned) -> DVec3 {
        let dielectric = self.job.dielectrics[lens.material as usize];
        let weights = self.job.params.fresnel;
        let face = (1.0 - dielectric.veil) * dielectric.filter;
        let faces = (face * face).as_dvec3();
        let diameter = 2.0 * lens.radius;
        move |ray| {
            let reflectance =
                f64::from(interface_of(&dielectric, weights, ray.cos as f32, dielectric.index).reflectance);
            let inside = dielectric.transmittance((diameter * ray.inner) as f32);
            (1.0 - reflectance) * (1.0 - reflectance) * faces * inside.as_dvec3()
        }
    }

    /// The light of one bundle, reduced along the three segments of its path: from the surface to the sphere, inside the sphere, and on to the
    /// light.
    fn bundle_light(
        &self,
        surface: &Surface,
        lit: &Lit,
        (lens, plane, bundle): (&Lens, &Plane, &Bundle),
        work: &mut Workspace,
    ) -> Vec3 {
        let to_sphere = -plane.vector(bundle, bundle.ray.direction).as_vec3();
        let share = lit.share(self.light_color, to_sphere);
        let place = |at: DVec2| (lens.center + lens.radius * plane.vector(bundle, at)).as_vec3();
        let [exit, entry] = [bundle.ray.exit(), bundle.ray.entry()].map(place);
        let ways = [segment(surface.origin(to_sphere), exit), segment(exit, entry), self.light_ray(entry)];
        let mut light = share * bundle.strength.as_vec3();
        for way in ways {
            if light == Vec3::ZERO {
                break;
            }
            light *= self.straight_along(&way, light.max_element(), Some(lens.id), work);
        }
        light
    }

    /// Whether light through this triangle or sphere does not go straight on to `to`: a lens focuses the light, or photons carry it.
    pub(super) fn focuses(&self, id: u32, to: Vec3) -> bool {
        if self.targets.at(id).is_some() {
            return true;
        }
        let outside =
            || self.sphere(id).is_some_and(|sphere| sphere.center.distance_squared(to) > sphere.radius.powi(2));
        T::SPHERES && self.focused.lenses.contains(id) && outside()
    }
}

/// The unit direction in which light from the direction `to_light` travels; 0 if `to_light` is 0.
pub fn axis(to_light: Vec3) -> DVec3 {
    -to_light.as_dvec3().normalize_or_zero()
}

/// Radius, at the distance 1, of a light's disc of this angular diameter in degrees.
pub fn blur(sun: f32) -> f64 {
    (0.5 * f64::from(sun)).to_radians().tan()
}

/// The ray from one place to another.
fn segment(origin: Vec3, end: Vec3) -> Ray {
    let way = end - origin;
    Ray { origin, direction: way.normalize_or(Vec3::Z), t_min: 0.0, t_max: way.length() }
}
