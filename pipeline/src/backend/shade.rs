//! Materials as rasterisers and rays see them.

use glam::{Vec3, Vec4};

/// Colours of a material as a pass sees them, after the project's colour maps (`injectionMaps`, `materialMaps`) are applied.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shade {
    /// Diffuse colour.
    pub diffuse: Vec4,
    /// Emitted colour.
    pub emission: Vec4,
    /// Index into [`RenderScene::textures`](crate::scene::RenderScene::textures), where the material has a texture and the pass
    /// reads it.
    pub texture: Option<u32>,
    /// Normal map. `None` in thesis fidelity.
    pub normal_map: Option<NormalMap>,
    /// Whether the reflected colour and the alpha are multiplied by the vertex colours
    /// ([`Geometry::colors`](crate::scene::Geometry::colors)).
    pub vertex_colors: bool,
    /// Alpha test: where texture alpha times vertex alpha is below this, the surface has a hole. The value is already divided by the
    /// diffuse opacity, so it is infinite for an opacity of 0. `None` in thesis fidelity and for opaque materials. It has no effect on a
    /// material that has neither a texture nor vertex colours.
    pub alpha_cutoff: Option<f32>,
    /// Light that the surface emits in addition to what it reflects. `None` in thesis fidelity and for surfaces that emit none.
    pub glow: Option<Glow>,
}

impl Default for Shade {
    fn default() -> Self {
        Self::WHITE
    }
}

impl Shade {
    /// Opaque white, without textures, vertex colours, alpha test and emission.
    pub const WHITE: Self = Self {
        diffuse: Vec4::ONE,
        emission: Vec4::ZERO,
        texture: None,
        normal_map: None,
        vertex_colors: false,
        alpha_cutoff: None,
        glow: None,
    };

    /// Whether an alpha test can cut holes into the surface.
    #[must_use]
    pub fn is_cut(&self) -> bool {
        self.alpha_cutoff.is_some() && (self.texture.is_some() || self.vertex_colors)
    }
}

/// A normal map; [`crate::scene::normal_map`] says how it bends the shading normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NormalMap {
    /// Index into [`RenderScene::textures`](crate::scene::RenderScene::textures), sampled at the same coordinates as
    /// [`Shade::texture`].
    pub texture: u32,
    /// Factor of the x and y components of the map's vectors: finite, at most 1e6.
    pub scale: f32,
}

/// Emission of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Glow {
    /// Emitted colour, added to the reflected one.
    pub color: Vec3,
    /// Texture that multiplies the emitted colour: index into [`RenderScene::textures`](crate::scene::RenderScene::textures),
    /// sampled at the coordinates of [`Shade::texture`].
    pub texture: Option<u32>,
}
