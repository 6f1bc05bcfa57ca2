//! The directions in which mirrors, panes and glass send a ray on.

use super::{MIRRORED, Walk};
use crate::effects::coverage::Coverage;
use crate::effects::optics::{Interface, interface, reflect};
use crate::effects::surface::Surface;
use crate::sampling::hemisphere::{Basis, concentric_disk, mirrored};
use crate::trace::Tracer;
use glam::{Vec2, Vec3};

/// How a glass surface splits a ray.
pub(super) struct Split {
    pub interface: Interface,
    /// The normal that is used for the split, and the refractive index of the far side over that of the near side.
    pub bends: (Vec3, f32),
    pub reflected: Vec3,
    pub refracted: Option<Vec3>,
}

/// A direction sampled from the lobe `cos^exponent` around a unit vector, by a uniform point of the unit square.
///
/// The cumulative distribution of the cosine is `cos^(exponent + 1)`, and the squared radius of a uniform point of the
/// unit disk is uniform.
pub(super) fn in_lobe(around: Vec3, exponent: f32, point: Vec2) -> Vec3 {
    let disk = concentric_disk(point);
    let square = disk.length_squared().min(1.0);
    let cosine = (1.0 - square).max(0.0).powf(1.0 / (exponent + 1.0));
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    let aside = disk.normalize_or_zero() * sine;
    Basis::around(around).to_world(aside.extend(cosine))
}

impl<T: Tracer, C: Coverage> Walk<'_, '_, T, C> {
    /// The direction in which a mirror sends a ray, and the factor of its light. `at` gives a point of the unit square; it
    /// is only called for a rough mirror.
    pub(super) fn mirror(&self, surface: &Surface, view: Vec3, at: impl FnOnce() -> Vec2) -> (Vec3, f32) {
        let smooth = reflect(view, surface.interface_normal(view));
        let exponent = self.params.camera.gloss;
        if exponent == 0.0 {
            return (smooth, MIRRORED);
        }
        // A direction into the surface is mirrored at the surface.
        (mirrored(in_lobe(smooth, exponent, at()), surface.facing), MIRRORED)
    }

    /// How glass splits a ray; the front side, by winding, is outside.
    pub(super) fn split(&self, surface: &Surface, view: Vec3) -> Split {
        let index = if surface.is_front() { self.params.index } else { self.params.index.recip() };
        let by = |normal: Vec3| {
            let interface = interface(self.params.fresnel, -normal.dot(view), index);
            (normal, interface, interface.refract(view, normal, index))
        };
        let bent = by(surface.interface_normal(view));
        // A bent normal can refract the ray back to the viewer's side; then the geometric normal is used.
        let returns = bent.2.is_some_and(|direction| direction.dot(surface.facing) >= 0.0);
        let (normal, interface, refracted) = if returns { by(surface.facing) } else { bent };
        Split { interface, bends: (normal, index), reflected: reflect(view, normal), refracted }
    }
}
