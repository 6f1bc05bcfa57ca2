//! Light that falls straight through glass: Fresnel's and the filter's share at each surface, and absorption between them.

use super::job::{Look, Traced};
use super::light::{ONE_SURFACE, SHADOWED, THROUGH_GLASS};
use super::media::Bodies;
use super::optics::{Interface, Wall, index, kept};
use super::world::{Surface, World};
use crate::trace::DoubleHit;
use curitiba_pipeline::color::ColorSpace;
use curitiba_pipeline::glass::{Dielectric, GlassShadow, Shape};
use glam::{DVec3, DVec4, Vec3};

impl Traced<'_> {
    /// Whether light falls straight through glass. `shadow=caustic` counts as straight, too; [`Self::unsupported`] refuses it where exact
    /// spheres focus light.
    pub(super) fn is_straight(&self) -> bool {
        matches!(self.params.shadow, GlassShadow::Straight | GlassShadow::Caustic) && !self.look.dielectrics.is_empty()
    }
}

impl Look<'_> {
    /// The share of a surface's colour that the shadow from a direction leaves on the side of normal `facing`, by colour; at least
    /// [`SHADOWED`].
    pub(super) fn straight_share(
        &self,
        world: &World<'_>,
        surface: &Surface,
        (facing, to_light): (DVec3, DVec3),
    ) -> DVec3 {
        let stops = |hit: &DoubleHit| self.stops_light(world, hit);
        let origin = self.start_to_light(world, surface, (facing, to_light), stops);
        let arriving = origin.map_or(DVec3::ZERO, |origin| self.straight(world, (origin, to_light), f64::INFINITY));
        SHADOWED + (1.0 - SHADOWED) * arriving
    }

    /// The share of the light from the distance `reach` that comes along a ray, by colour; 0 where something opaque blocks the ray.
    pub(super) fn straight(&self, world: &World<'_>, ray: (DVec3, DVec3), reach: f64) -> DVec3 {
        let Some(mut hits) = self.glass_on_way(world, ray, reach) else { return DVec3::ZERO };
        hits.sort_unstable_by(|a, b| a.t.total_cmp(&b.t).then(a.triangle.cmp(&b.triangle)));
        let mut surfaces: Vec<(f64, Surface)> = Vec::with_capacity(hits.len());
        for hit in hits {
            let surface = world.surface(self.shades, &hit, ray);
            // Two triangles may be hit at their common edge: the second hit is the same surface, and is left out.
            let again = |(t, known): &(f64, Surface)| {
                let is_alike = known.material == surface.material && known.is_front() == surface.is_front();
                is_alike && hit.t - t <= ONE_SURFACE * hit.t
            };
            if !surfaces.last().is_some_and(again) {
                surfaces.push((hit.t, surface));
            }
        }
        let is_solid = |surface: &Surface| self.dielectrics[surface.material].shape == Shape::Solid;
        let solid = surfaces.iter().filter(|(_, surface)| is_solid(surface));
        let mut bodies = Bodies::at_start(solid.map(|(_, surface)| (surface.material, surface.is_front())));
        let (mut light, mut from) = (DVec3::ONE, 0.0);
        for (t, surface) in &surfaces {
            light *= self.kept_in(&bodies, t - from);
            from = *t;
            let share = self.straight_at(world, surface, ray.1, &mut bodies);
            light *= share;
        }
        light * self.kept_in(&bodies, reach - from)
    }

    /// The share of straight light that a surface lets pass. On entry, `bodies` holds the bodies in front of the surface; on return, those
    /// behind it.
    fn straight_at(&self, world: &World<'_>, surface: &Surface, direction: DVec3, bodies: &mut Bodies) -> DVec3 {
        let dielectric = &self.dielectrics[surface.material];
        let cosine = surface.vertex.try_normalize().unwrap_or(surface.flat).dot(direction).abs();
        // The angle is the one on the side of the lower index, since straight light is not refracted.
        let face = |ratio: f64| Interface::of(dielectric, cosine, ratio.max(1.0 / ratio));
        match dielectric.shape {
            Shape::Solid => {
                let border = bodies.cross(self.dielectrics, surface.material, surface.is_front());
                let [before, behind] = border.sides.map(|side| self.index_in(side, None));
                *bodies = border.after;
                match border.is_seen {
                    true => (1.0 - face(behind / before).share) * self.filter(world, surface),
                    false => DVec3::ONE,
                }
            }
            Shape::Thin => {
                let around = self.index_in(bodies.fills(self.dielectrics), None);
                let face = face(index(dielectric, None) / around);
                Wall::new(dielectric, &face).transmitted * self.filter(world, surface)
            }
            Shape::Pane | Shape::Opaque => DVec3::splat(THROUGH_GLASS),
        }
    }

    /// The refractive index of the material that fills a place; 1 for air, which is `None`.
    pub(super) fn index_in(&self, material: Option<usize>, wavelength: Option<f64>) -> f64 {
        material.map_or(1.0, |material| index(&self.dielectrics[material], wavelength))
    }

    /// Whether a solid body absorbs light.
    #[must_use]
    pub fn absorbs(&self) -> bool {
        let absorbs = |dielectric: &Dielectric| dielectric.shape == Shape::Solid && dielectric.extinction != Vec3::ZERO;
        self.dielectrics.iter().any(absorbs)
    }

    /// The transmittance of a length in these bodies, by colour.
    pub(super) fn kept_in(&self, bodies: &Bodies, length: f64) -> DVec3 {
        bodies.fills(self.dielectrics).map_or(DVec3::ONE, |material| kept(&self.dielectrics[material], length))
    }

    /// The index of a texture and its value at a surface; `None` without a texture, and for spheres.
    fn texel_at(&self, world: &World<'_>, surface: &Surface, texture: Option<u32>) -> Option<(u32, DVec4)> {
        let texture = texture.filter(|_| world.sphere(surface.triangle).is_none())?;
        Some((texture, world.texel(texture, world.texcoord(surface.triangle, surface.weights))))
    }

    /// The share of the entering light that a surface scatters back.
    pub(super) fn veil(&self, world: &World<'_>, surface: &Surface) -> f64 {
        let dielectric = &self.dielectrics[surface.material];
        let clear = self.texel_at(world, surface, dielectric.transmission_texture).map_or(1.0, |(_, texel)| texel.x);
        1.0 - (1.0 - f64::from(dielectric.veil)) * clear
    }

    /// The transmittance of a surface, by colour, for the light that it does not reflect.
    pub(super) fn filter(&self, world: &World<'_>, surface: &Surface) -> DVec3 {
        let dielectric: &Dielectric = &self.dielectrics[surface.material];
        let geometry = &world.scene.geometry;
        let mut filter = (1.0 - self.veil(world, surface)) * dielectric.filter.as_dvec3();
        if let Some((texture, texel)) = self.texel_at(world, surface, dielectric.filter_texture) {
            filter *= linear(texel.truncate(), world.scene.textures[texture as usize].space);
        }
        let has_colors = dielectric.filter_vertex_colors && !geometry.colors.is_empty();
        if has_colors && world.sphere(surface.triangle).is_none() {
            filter *= linear(world.tint(surface.triangle, surface.weights).truncate(), geometry.color_space);
        }
        filter
    }

    /// The width alpha of the distribution of a surface's microfacets; 0 where it is smooth.
    pub(super) fn width(&self, world: &World<'_>, surface: &Surface) -> f64 {
        let dielectric = &self.dielectrics[surface.material];
        let roughness = self.texel_at(world, surface, dielectric.roughness_texture).map_or(1.0, |(_, texel)| texel.y);
        let width = f64::from(dielectric.alpha) * roughness * roughness;
        if width < f64::from(Dielectric::SMOOTH) { 0.0 } else { width }
    }
}

/// A colour as a share of light, which is linear whatever the colours of the picture are (IEC 61966-2-1).
fn linear(color: DVec3, space: ColorSpace) -> DVec3 {
    match space {
        ColorSpace::Linear => color,
        ColorSpace::Report => color.map(|c| if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }),
    }
}
