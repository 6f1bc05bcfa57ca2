//! The scene with its trees: hits, alpha tests, and points on surfaces.

use super::spheres::{BYTES_PER_SPHERE, Spheres};
use super::texture::texel;
use crate::trace::{Double, DoubleHit, DoubleRay};
use curitiba_pipeline::backend::Shade;
use curitiba_pipeline::memory::{self, Refused};
use curitiba_pipeline::scene::{RenderScene, Sphere};
use glam::{DVec2, DVec3, DVec4};

/// Offset of ray origins from their surface, relative to the largest coordinate of the scene: some ten thousand
/// rounding errors of `f64`.
const OFFSET: f64 = 1.0e-11;

/// Squared length up to which an interpolated normal counts as cancelled, as in the rasteriser.
const LEAST_SQUARE: f64 = 1.0e-30;

/// Approximate memory of the tree for each triangle, including as much again during the build.
const BYTES_PER_TRIANGLE: u64 = 400;

/// A scene, and trees over its triangles and its exact spheres.
pub(super) struct World<'a> {
    pub scene: &'a RenderScene,
    tree: Double,
    spheres: Spheres,
    offset: f64,
}

/// A point of a triangle or a sphere, seen from one side.
#[derive(Debug, Clone, Copy)]
pub(super) struct Surface {
    /// Id of the triangle or sphere.
    pub triangle: u32,
    pub material: usize,
    pub position: DVec3,
    /// Barycentric weights of a triangle's corners.
    pub weights: [f64; 3],
    /// Unit normal of the counter-clockwise side. For a sphere, this and the next two normals point outwards.
    pub flat: DVec3,
    /// The interpolated vertex normal, neither flipped to the viewer's side nor of unit length; 0 where there is none.
    pub vertex: DVec3,
    /// The vertex normal, bent by the normal map if there is one, as a unit vector, not flipped to the viewer's side; 0 without a vertex
    /// normal, or where it has cancelled.
    pub shading: DVec3,
    /// Unit normal of the triangle, flipped to the viewer's side.
    pub facing: DVec3,
    /// Unit shading normal, flipped to the side of [`Self::facing`].
    pub normal: DVec3,
}

impl<'a> World<'a> {
    /// Builds the trees. `looked_at` marks the materials whose hits must be passed to `accept` or `stops`; hits on spheres always are.
    ///
    /// # Errors
    /// If there is not enough memory for them.
    pub fn new(scene: &'a RenderScene, looked_at: &[bool]) -> Result<Self, Refused> {
        let geometry = &scene.geometry;
        let [triangles, spheres] = [geometry.triangles.len(), geometry.spheres.len()].map(|count| count as u64);
        memory::probe(BYTES_PER_TRIANGLE * triangles + BYTES_PER_SPHERE * spheres)?;
        let finite = geometry.positions.iter().filter(|position| position.is_finite());
        let extent = finite.fold(0.0_f32, |extent, position| extent.max(position.abs().max_element()));
        let farthest = |sphere: &Sphere| sphere.center.abs().max_element() + sphere.radius;
        let extent = geometry.spheres.iter().map(farthest).fold(extent, f32::max);
        let (tree, spheres) = (Double::build(geometry, looked_at), Spheres::build(geometry));
        Ok(Self { scene, tree, spheres, offset: OFFSET * f64::from(extent) })
    }

    /// A vertex attribute, interpolated between the corners.
    fn between<V: Copy>(&self, values: &[V], triangle: u32, weights: [f64; 3], of: impl Fn(V) -> DVec4) -> DVec4 {
        let corners = self.scene.geometry.triangles[triangle as usize];
        corners.iter().zip(weights).map(|(corner, weight)| of(values[*corner as usize]) * weight).sum()
    }

    pub fn texcoord(&self, triangle: u32, weights: [f64; 3]) -> DVec2 {
        let values = &self.scene.geometry.texcoords;
        self.between(values, triangle, weights, |uv| uv.as_dvec2().extend(0.0).extend(0.0)).truncate().truncate()
    }

    /// Factor of the surface's colour, from the vertex colours, with its alpha.
    pub fn tint(&self, triangle: u32, weights: [f64; 3]) -> DVec4 {
        self.between(&self.scene.geometry.colors, triangle, weights, |color| color.as_dvec4())
    }

    pub fn texel(&self, texture: u32, uv: DVec2) -> DVec4 {
        texel(&self.scene.textures[texture as usize], uv)
    }

    /// The sphere of an id; `None` for triangles. Spheres have neither texture coordinates nor vertex colours.
    pub fn sphere(&self, id: u32) -> Option<&Sphere> {
        self.scene.geometry.sphere(id)
    }

    /// Whether a triangle belongs to a sky, whose colour no pass changes.
    pub fn is_sky(&self, triangle: u32) -> bool {
        self.scene.geometry.sky.contains(triangle)
    }

    pub fn material(&self, id: u32) -> usize {
        self.sphere(id).map_or_else(|| self.scene.geometry.material_of(id), |sphere| sphere.material) as usize
    }

    /// The alpha test: whether there is a surface at a hit. Nothing is cut out of a sphere.
    pub fn covers(&self, shades: &[Shade], hit: &DoubleHit) -> bool {
        if self.sphere(hit.triangle).is_some() {
            return true;
        }
        let shade = &shades[self.material(hit.triangle)];
        let Some(cutoff) = shade.alpha_cutoff.filter(|_| shade.is_cut()) else { return true };
        let weights = weights(hit);
        let texture = shade.texture.map_or(1.0, |texture| self.texel(texture, self.texcoord(hit.triangle, weights)).w);
        let vertices = if shade.vertex_colors { self.tint(hit.triangle, weights).w } else { 1.0 };
        texture * vertices >= f64::from(cutoff)
    }

    /// Whether a triangle is seen from behind, where its corners appear clockwise, or a sphere from inside.
    pub fn is_from_behind(&self, hit: &DoubleHit, (origin, direction): (DVec3, DVec3)) -> bool {
        if let Some(sphere) = self.sphere(hit.triangle) {
            return (origin + direction * hit.t - sphere.center.as_dvec3()).dot(direction) > 0.0;
        }
        let [a, b, c] = self.scene.geometry.corners(hit.triangle).map(|corner| corner.as_dvec3());
        (b - a).cross(c - a).dot(direction) > 0.0
    }

    /// The nearest hit. For spheres, and where the material needs it, `accept` decides whether a hit counts.
    pub fn first(&self, ray: &DoubleRay, mut accept: impl FnMut(&DoubleHit) -> bool) -> Option<DoubleHit> {
        let hit = self.tree.first(ray, &mut accept);
        let before = DoubleRay { t_max: hit.map_or(ray.t_max, |hit| hit.t), ..*ray };
        self.spheres.first(&before, accept).or(hit)
    }

    /// The nearest hit with a surface, from an origin that is off the surface that the ray leaves.
    pub fn closest(&self, shades: &[Shade], origin: DVec3, direction: DVec3) -> Option<DoubleHit> {
        let ray = DoubleRay { origin, direction, t_min: 0.0, t_max: f64::INFINITY };
        self.first(&ray, |hit| self.covers(shades, hit))
    }

    /// Whether a hit blocks the ray. For spheres, and where the material needs it, `stops` decides.
    pub fn is_blocked(
        &self,
        origin: DVec3,
        direction: DVec3,
        t_max: f64,
        mut stops: impl FnMut(&DoubleHit) -> bool,
    ) -> bool {
        let ray = DoubleRay { origin, direction, t_min: 0.0, t_max };
        self.tree.any(&ray, &mut stops) || self.spheres.any(&ray, stops)
    }

    /// The surface at a hit of a ray of this origin and direction, with the normal maps of `shades`.
    pub fn surface(&self, shades: &[Shade], hit: &DoubleHit, (origin, direction): (DVec3, DVec3)) -> Surface {
        if let Some(sphere) = self.sphere(hit.triangle) {
            return on_sphere(sphere, hit, origin, direction);
        }
        let geometry = &self.scene.geometry;
        let (triangle, weights) = (hit.triangle, weights(hit));
        let [a, b, c] = geometry.corners(triangle).map(|corner| corner.as_dvec3());
        let material = self.material(triangle);
        let flat = (b - a).cross(c - a).normalize_or_zero();
        let vertex = match geometry.normals.is_empty() {
            true => DVec3::ZERO,
            false => {
                let of = |normal: glam::Vec3| normal.as_dvec3().extend(0.0);
                self.between(&geometry.normals, triangle, weights, of).truncate()
            }
        };
        let mut shading = if vertex.length_squared() > LEAST_SQUARE { vertex.normalize() } else { DVec3::ZERO };
        if let Some(map) =
            shades[material].normal_map.filter(|_| shading != DVec3::ZERO && !geometry.tangents.is_empty())
        {
            let texel = self.texel(map.texture, self.texcoord(triangle, weights)).truncate();
            let tangent = self.between(&geometry.tangents, triangle, weights, |tangent| tangent.as_dvec4());
            shading = bent(texel, map.scale.into(), vertex, tangent, flat);
        }
        let facing = if flat.dot(direction) > 0.0 { -flat } else { flat };
        let turned = if shading.dot(facing) < 0.0 { -shading } else { shading };
        Surface {
            triangle,
            material,
            position: a * weights[0] + b * weights[1] + c * weights[2],
            weights,
            flat,
            vertex,
            shading,
            facing,
            normal: if turned == DVec3::ZERO { facing } else { turned },
        }
    }

    /// Origin of a ray that leaves a surface in this direction.
    pub fn leaving(&self, surface: &Surface, direction: DVec3) -> DVec3 {
        surface.position + surface.flat * self.offset.copysign(surface.flat.dot(direction))
    }
}

impl Surface {
    /// Whether the viewer is on the side that the triangle, or the sphere, faces.
    pub fn is_front(&self) -> bool {
        self.facing == self.flat
    }
}

/// The surface where a ray meets a sphere.
fn on_sphere(sphere: &Sphere, hit: &DoubleHit, origin: DVec3, direction: DVec3) -> Surface {
    let center = sphere.center.as_dvec3();
    let outward = (origin + direction * hit.t - center).normalize_or(-direction);
    let facing = if outward.dot(direction) > 0.0 { -outward } else { outward };
    Surface {
        triangle: hit.triangle,
        material: sphere.material as usize,
        position: center + outward * f64::from(sphere.radius),
        weights: [0.0; 3],
        flat: outward,
        vertex: outward,
        shading: outward,
        facing,
        normal: facing,
    }
}

/// Barycentric weights of the corners at a hit.
fn weights(hit: &DoubleHit) -> [f64; 3] {
    [1.0 - hit.u - hit.v, hit.u, hit.v]
}

/// The vertex normal bent by a texel of a normal map, as `curitiba_pipeline::scene::normal_map` defines it. The texel
/// is a vector in the frame of tangent, bitangent and normal, with a height of at least one step of 8 bits. The result
/// does not turn away from the triangle's side.
fn bent(texel: DVec3, scale: f64, vertex: DVec3, tangent: DVec4, flat: DVec3) -> DVec3 {
    const LEAST_HEIGHT: f64 = 1.0 / 255.0;
    const LEAST_COSINE: f64 = 0.01;
    let local = 2.0 * texel - 1.0;
    let along = tangent.truncate();
    let across = vertex.cross(along) * tangent.w;
    let sum = along * (local.x * scale) + across * (local.y * scale) + vertex * local.z.max(LEAST_HEIGHT);
    let bent = sum.normalize_or(vertex.normalize());
    let side = if flat.dot(vertex) < 0.0 { -flat } else { flat };
    let cosine = bent.dot(side);
    if cosine < LEAST_COSINE { (bent + side * (LEAST_COSINE - cosine)).normalize_or(side) } else { bent }
}
