//! Light at surfaces: the colours it gives, and its shadows.

use super::job::Look;
use super::world::{Surface, World};
use crate::trace::DoubleHit;
use curitiba_pipeline::backend::Shade;
use glam::{DVec3, DVec4};

/// The report's ambient light.
pub(super) const AMBIENT: f64 = 0.3;
/// Share of a colour that is left where an opaque surface blocks the light.
pub(super) const SHADOWED: f64 = 0.5;
/// Factor of the light for each glass surface that it crosses.
pub(super) const THROUGH_GLASS: f64 = 0.9;
/// Least cosine between a triangle's normal and those of its corners for which it counts as a piece of a round surface.
const ROUND: f64 = 0.85;
/// Hit distances with a smaller relative difference are one glass surface: positions are `f32`.
pub(super) const ONE_SURFACE: f64 = 8.0 * f32::EPSILON as f64;

impl Look<'_> {
    /// Unit direction to the light; 0 without a light.
    pub(super) fn toward_light(&self) -> DVec3 {
        self.sun.map_or(DVec3::ZERO, |sun| -sun.direction.as_dvec3().normalize())
    }

    /// Cosine of the light at a surface that the camera sees, by the shading normal, not flipped to the viewer's side; of several lights,
    /// the greatest. With a normal map it is 0 where the vertex normal faces away.
    pub(super) fn seen_cosine(&self, surface: &Surface) -> f64 {
        if !self.lights.is_empty() {
            return self.greatest_cosine(surface);
        }
        self.cosine_seen(surface, self.toward_light())
    }

    /// [`Self::seen_cosine`] of a light in this direction.
    pub(super) fn cosine_seen(&self, surface: &Surface, to_light: DVec3) -> f64 {
        let faces = self.shades[surface.material].normal_map.is_none() || surface.vertex.dot(to_light) > 0.0;
        if faces { surface.shading.dot(to_light).clamp(0.0, 1.0) } else { 0.0 }
    }

    /// The colour of a surface that the camera sees: diffuse and ambient light, texture, vertex colours, and emitted
    /// light.
    pub(super) fn seen_color(&self, world: &World<'_>, surface: &Surface) -> DVec4 {
        let shade = &self.shades[surface.material];
        let sun = self.sun.map_or(DVec4::ZERO, |sun| sun.color.as_dvec3().extend(1.0));
        let arriving = match self.lights.is_empty() {
            true => sun * self.seen_cosine(surface),
            false => self
                .sum_of_lights(surface.position, |towards| self.cosine_seen(surface, towards))
                .extend(self.seen_cosine(surface)),
        };
        let lit = shade.diffuse.as_dvec4() * arriving;
        let reflected = match texture(world, shade, surface) {
            None => lit + shade.diffuse.as_dvec4() * AMBIENT,
            Some(texture) => {
                (lit + shade.emission.as_dvec4() + AMBIENT)
                    * world.texel(texture, world.texcoord(surface.triangle, surface.weights))
            }
        };
        self.tinted(world, surface, reflected) + self.glow(world, surface).extend(0.0)
    }

    /// The colour of a surface that a ray hits, with the normal on the ray's side. As [`Self::seen_color`], but without the emission of a
    /// textured material.
    pub(super) fn met_color(&self, world: &World<'_>, surface: &Surface) -> DVec3 {
        let shade = &self.shades[surface.material];
        let arriving = match self.lights.is_empty() {
            true => {
                let sun = self.sun.map_or(DVec3::ZERO, |sun| sun.color.as_dvec3());
                sun * self.cosine_met(surface, self.toward_light())
            }
            false => self.sum_of_lights(surface.position, |towards| self.cosine_met(surface, towards)),
        };
        let diffuse = shade.diffuse.as_dvec4();
        let lit = diffuse * arriving.extend(1.0);
        let reflected = match texture(world, shade, surface) {
            None => lit + diffuse * AMBIENT,
            Some(texture) => (lit + AMBIENT) * world.texel(texture, world.texcoord(surface.triangle, surface.weights)),
        };
        self.tinted(world, surface, reflected).truncate() + self.glow(world, surface)
    }

    /// The cosine of a light in this direction at a surface that a ray hits.
    pub(super) fn cosine_met(&self, surface: &Surface, to_light: DVec3) -> f64 {
        let shade = &self.shades[surface.material];
        let mut cosine = to_light.dot(surface.normal).max(0.0);
        if shade.normal_map.is_some() {
            let same_side = (surface.flat.dot(surface.vertex) < 0.0) == (surface.flat.dot(surface.normal) < 0.0);
            let of_vertices = surface.vertex.dot(to_light);
            if (if same_side { of_vertices } else { -of_vertices }) <= 0.0 {
                cosine = 0.0;
            }
        }
        cosine
    }

    fn tinted(&self, world: &World<'_>, surface: &Surface, color: DVec4) -> DVec4 {
        match self.shades[surface.material].vertex_colors && world.sphere(surface.triangle).is_none() {
            true => color * world.tint(surface.triangle, surface.weights),
            false => color,
        }
    }

    fn glow(&self, world: &World<'_>, surface: &Surface) -> DVec3 {
        let Some(glow) = self.shades[surface.material].glow else { return DVec3::ZERO };
        let uv = || world.texcoord(surface.triangle, surface.weights);
        let texture = glow.texture.filter(|_| world.sphere(surface.triangle).is_none());
        let texel = texture.map_or(DVec3::ONE, |texture| world.texel(texture, uv()).truncate());
        glow.color.as_dvec3() * texel
    }

    /// Whether light from a direction reaches the side of normal `facing`, with glass as an obstacle: the light of
    /// `deferredShadows`.
    pub(super) fn is_lit(&self, world: &World<'_>, surface: &Surface, (facing, to_light): (DVec3, DVec3)) -> bool {
        let stops = |hit: &DoubleHit| world.covers(self.shades, hit);
        self.start_to_light(world, surface, (facing, to_light), stops)
            .is_some_and(|origin| !world.is_blocked(origin, to_light, f64::INFINITY, stops))
    }

    /// The share of the light from a direction that reaches the side of normal `facing` in `final`: each glass surface on the ray dims it,
    /// and an opaque one leaves [`SHADOWED`].
    pub(super) fn light_share(&self, world: &World<'_>, surface: &Surface, (facing, to_light): (DVec3, DVec3)) -> f64 {
        let stops = |hit: &DoubleHit| self.stops_light(world, hit);
        let origin = self.start_to_light(world, surface, (facing, to_light), stops);
        origin.and_then(|origin| self.dimmed(world, (origin, to_light), f64::INFINITY)).unwrap_or(SHADOWED)
    }

    /// What glass leaves of the light along a ray, by the report's rule; `None` where something stops it before the distance `reach`.
    pub(super) fn dimmed(&self, world: &World<'_>, (origin, direction): (DVec3, DVec3), reach: f64) -> Option<f64> {
        let mut crossings = self.glass_on_way(world, (origin, direction), reach)?;
        crossings.sort_unstable_by(|a, b| a.t.total_cmp(&b.t));
        let again = crossings.windows(2).filter(|pair| pair[1].t - pair[0].t <= ONE_SURFACE * pair[1].t).count();
        Some(THROUGH_GLASS.powi((crossings.len() - again) as i32))
    }

    /// The surfaces of glass on a light's ray, in any order; `None` where something else stops it before the distance `reach`.
    pub(super) fn glass_on_way(
        &self,
        world: &World<'_>,
        (origin, direction): (DVec3, DVec3),
        reach: f64,
    ) -> Option<Vec<DoubleHit>> {
        let mut crossings = Vec::new();
        let blocked = world.is_blocked(origin, direction, reach, |hit| {
            let covers = world.covers(self.shades, hit);
            let glass = self.shadow_glass[world.material(hit.triangle)];
            if covers && glass {
                crossings.push(*hit);
            }
            covers && !glass
        });
        (!blocked).then_some(crossings)
    }

    /// Whether a hit stops light and occludes in `final`.
    pub(super) fn stops_light(&self, world: &World<'_>, hit: &DoubleHit) -> bool {
        !self.shadow_glass[world.material(hit.triangle)] && world.covers(self.shades, hit)
    }

    /// Origin of the ray from a side of a surface to the light; `None` where that side is dark without a ray.
    ///
    /// A side is dark if the round surface that the triangle approximates faces away from the light, or if the triangle faces away and
    /// approximates no round surface. If only the triangle faces away, the ray starts on the round surface (Hanika, "Hacking the Shadow
    /// Terminator", Ray Tracing Gems II, 2021); the side is dark if something that stops light lies between the triangle and that start.
    pub(super) fn start_to_light(
        &self,
        world: &World<'_>,
        surface: &Surface,
        (facing, to_light): (DVec3, DVec3),
        stops: impl FnMut(&DoubleHit) -> bool,
    ) -> Option<DVec3> {
        let round = round_normals(world, surface, facing);
        if round.is_some_and(|(side, _)| surface.vertex.dot(to_light) * side <= 0.0) {
            return None;
        }
        if facing.dot(to_light) > 0.0 {
            return Some(world.leaving(surface, to_light));
        }
        let way = way_onto_round(world, surface, round?)?;
        let (from, length) = (world.leaving(surface, facing), way.length());
        (!world.is_blocked(from, way / length, length, stops)).then_some(from + way)
    }
}

/// The texture of a surface; spheres have none.
pub(super) fn texture(world: &World<'_>, shade: &Shade, surface: &Surface) -> Option<u32> {
    shade.texture.filter(|_| world.sphere(surface.triangle).is_none())
}

/// The normals at the corners of a triangle that approximates a round surface, and 1 if they point to the side of normal `facing`, else -1.
/// `None` for spheres, without vertex normals, and where the normals are equal or one of them is far from the triangle's.
fn round_normals(world: &World<'_>, surface: &Surface, facing: DVec3) -> Option<(f64, [DVec3; 3])> {
    let geometry = &world.scene.geometry;
    if geometry.normals.is_empty() || world.sphere(surface.triangle).is_some() {
        return None;
    }
    let corners = geometry.triangles[surface.triangle as usize];
    let normals = corners.map(|corner| geometry.normals[corner as usize].as_dvec3());
    let side = 1.0_f64.copysign(surface.vertex.dot(facing));
    let is_flat = normals[0] == normals[1] && normals[1] == normals[2];
    let is_round = !is_flat && normals.iter().all(|normal| normal.dot(facing) * side >= ROUND);
    is_round.then_some((side, normals))
}

/// Vector from a point of a triangle to the round surface that the normals at the corners describe. The point is projected onto the tangent
/// planes at those corners that it lies below, and the projections are weighted by its barycentric coordinates. `None` where the point is
/// on the round surface.
fn way_onto_round(world: &World<'_>, surface: &Surface, (side, normals): (f64, [DVec3; 3])) -> Option<DVec3> {
    let geometry = &world.scene.geometry;
    let corners = geometry.triangles[surface.triangle as usize];
    let lift = |index: usize| {
        let normal = normals[index] * side;
        let corner = geometry.positions[corners[index] as usize].as_dvec3();
        normal * (corner - surface.position).dot(normal).max(0.0) * surface.weights[index]
    };
    let way = lift(0) + lift(1) + lift(2);
    (way.is_finite() && way != DVec3::ZERO).then_some(way)
}
