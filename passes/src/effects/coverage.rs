//! Where surfaces are cut out.

use super::interpolate::{interpolate, texture_coordinates};
use crate::trace::Hit;
use curitiba_pipeline::backend::Shade;
use curitiba_pipeline::scene::RenderScene;

/// Says where the surface of a triangle really is.
pub trait Coverage: Sync {
    /// Whether there is a surface at this point of the triangle.
    fn covers(&self, hit: &Hit) -> bool;
}

/// Every triangle is whole.
#[derive(Debug, Clone, Copy)]
pub struct Opaque;

impl Coverage for Opaque {
    fn covers(&self, _: &Hit) -> bool {
        true
    }
}

/// Triangles are cut out where the alpha of texture (level 0) and vertices is below the material's cutoff.
#[derive(Debug, Clone, Copy)]
pub struct AlphaTested<'a> {
    scene: &'a RenderScene,
    shades: &'a [Shade],
    /// Whether any material is cut out.
    cuts: bool,
}

impl<'a> AlphaTested<'a> {
    /// By the materials of `scene`, whose triangles are hit, as `shades` has them.
    #[must_use]
    pub fn new(scene: &'a RenderScene, shades: &'a [Shade]) -> Self {
        Self { scene, shades, cuts: shades.iter().any(|shade| shade.alpha_cutoff.is_some()) }
    }

    /// Every triangle is whole, whatever the materials say: the same type as [`Self::new`] gives, so that programs are compiled once for
    /// scenes with cut-outs and without.
    #[must_use]
    pub fn whole(scene: &'a RenderScene, shades: &'a [Shade]) -> Self {
        Self { scene, shades, cuts: false }
    }

    /// Apart, so that programs stay small: it is asked for cut-outs alone.
    #[inline(never)]
    fn covers_cut(&self, hit: &Hit) -> bool {
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

impl Coverage for AlphaTested<'_> {
    #[inline(always)]
    fn covers(&self, hit: &Hit) -> bool {
        !self.cuts || self.covers_cut(hit)
    }
}
