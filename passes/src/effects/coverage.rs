//! How textures are read at hits: where surfaces are cut out, and at which level their colours are read.

use super::interpolate::{interpolate, texture_coordinates};
use super::ray_cone::{Cone, LevelZero, RayCone};
use crate::trace::Hit;
use curitiba_pipeline::backend::Shade;
use curitiba_pipeline::scene::RenderScene;

/// Decides where a triangle has a surface. Its type also decides at which mip level other textures are read, so that programs are compiled
/// for each case.
pub trait Coverage: Sync {
    /// The cone that paths carry to find the mip level; see [`ByCones`].
    type Cone: Cone;

    /// Whether there is a surface at this point of the triangle.
    fn covers(&self, hit: &Hit) -> bool;
}

/// Every triangle is whole.
#[derive(Debug, Clone, Copy)]
pub struct Opaque;

impl Coverage for Opaque {
    type Cone = LevelZero;

    fn covers(&self, _: &Hit) -> bool {
        true
    }
}

/// `None` leaves every triangle whole.
impl<C: Coverage> Coverage for Option<C> {
    type Cone = C::Cone;

    fn covers(&self, hit: &Hit) -> bool {
        self.as_ref().is_none_or(|coverage| coverage.covers(hit))
    }
}

/// A triangle is cut out where texture alpha (level 0) times vertex alpha is below the material's cutoff.
#[derive(Debug, Clone, Copy)]
pub struct AlphaTested<'a> {
    /// The scene whose triangles are hit.
    pub scene: &'a RenderScene,
    /// One for each material.
    pub shades: &'a [Shade],
}

impl Coverage for AlphaTested<'_> {
    type Cone = LevelZero;

    fn covers(&self, hit: &Hit) -> bool {
        let shade = &self.shades[self.scene.geometry.material_of(hit.triangle) as usize];
        let Some(cutoff) = shade.alpha_cutoff.filter(|_| shade.is_cut()) else { return true };
        let geometry = &self.scene.geometry;
        let alpha = shade.texture.map_or(1.0, |texture| {
            self.scene.textures[texture as usize].sample(texture_coordinates(geometry, hit), 0.0).w
        });
        let vertices = if shade.vertex_colors { interpolate(geometry, &geometry.colors, hit).w } else { 1.0 };
        alpha * vertices >= cutoff
    }
}

/// Triangles have a surface where the inner coverage says so; colours and normals are read at the level of a ray cone.
#[derive(Debug, Clone, Copy)]
pub struct ByCones<C>(pub C);

impl<C: Coverage> Coverage for ByCones<C> {
    type Cone = RayCone;

    fn covers(&self, hit: &Hit) -> bool {
        self.0.covers(hit)
    }
}
