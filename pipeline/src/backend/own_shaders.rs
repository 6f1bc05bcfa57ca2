//! Jobs of own shaders: materials of raster passes, quads, compute passes.

use crate::glsl::{Drawn, Program};
use crate::scene::texture::Texture;
use std::sync::Arc;

/// Inputs of a material whose triangles are drawn by an own shader of the project.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnMaterial {
    /// Index into [`OwnShaders::programs`].
    pub program: usize,
    /// Bytes of each uniform block of the program.
    pub uniforms: Vec<Vec<u8>>,
    /// Texture of each sampler of the program.
    pub textures: Vec<OwnTexture>,
    /// For each storage buffer of the program, the index of the buffer or image bound to it, into the buffers of
    /// [`Rasteriser::draw_with`](super::Rasteriser::draw_with); `None` for an image that holds nothing.
    pub storage: Vec<Option<usize>>,
    /// How the material's triangles are drawn.
    pub drawn: Drawn,
}

/// The texture of a sampler of an own shader, in a raster pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OwnTexture {
    /// No texture: reads opaque black.
    Nothing,
    /// Index into [`RenderScene::textures`](crate::scene::RenderScene::textures).
    Scene(u32),
    /// Indices into [`RenderScene::textures`](crate::scene::RenderScene::textures) of a cube map's images, square and of one
    /// size: +x, -x, +y, -y, +z, -z.
    Cube([u32; 6]),
    /// Index into [`OwnShaders::channels`].
    Channel(usize),
}

/// The own shaders of a raster pass.
#[derive(Debug, Clone, Copy)]
pub struct OwnShaders<'a> {
    /// The compiled programs.
    pub programs: &'a [Arc<Program>],
    /// Own shader of each material, by material index; `None` for materials that the job's own program draws.
    pub materials: &'a [Option<OwnMaterial>],
    /// Channels that earlier passes wrote.
    pub channels: &'a [QuadTexture<'a>],
    /// Index of the attachment (0 colour, 1 position, 2 normal) that receives depth. It is cleared to 1, the far plane. `None`:
    /// depth is not stored.
    pub depth: Option<usize>,
    /// Depth clamp: geometry beyond the near or far plane is drawn at that plane's depth instead of being clipped.
    pub clamped: bool,
    /// How often each triangle is drawn: `gl_InstanceID` counts from 0.
    pub instances: u32,
}

impl OwnShaders<'_> {
    /// No own shaders.
    pub const NONE: Self =
        Self { programs: &[], materials: &[], channels: &[], depth: None, clamped: false, instances: 1 };
}

/// A mip level of a channel.
#[derive(Debug, Clone, Copy)]
pub struct MipLevel<'a> {
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height` texels, top row first.
    pub texels: &'a [[f32; 4]],
}

/// The texture of a sampler of a quad's own shader.
#[derive(Debug, Clone)]
pub enum QuadTexture<'a> {
    /// No texture: reads opaque black.
    Nothing,
    /// An image file.
    Image(&'a Texture),
    /// The images of a cube map, square and of one size: +x, -x, +y, -y, +z, -z.
    Cube([&'a Texture; 6]),
    /// A channel that an earlier pass wrote.
    Channel {
        /// Pixels a row.
        width: u32,
        /// Rows.
        height: u32,
        /// `width * height` texels, top row first.
        texels: &'a [[f32; 4]],
    },
    /// A channel with its mip levels, the whole picture first. Each side is half of the side before, rounded down, and at least 1.
    Levels(Vec<MipLevel<'a>>),
}

/// A full-screen quad that an own shader of the project fills.
#[derive(Debug, Clone, Copy)]
pub struct QuadJob<'a> {
    /// The compiled program. Its `position` is in clip space, -1 to 1, and its `texCoord0` runs from 0 to 1.
    pub program: &'a Arc<Program>,
    /// Bytes of each uniform block of the program.
    pub uniforms: &'a [Vec<u8>],
    /// Texture of each sampler of the program.
    pub textures: &'a [QuadTexture<'a>],
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

/// A compute shader of the project that runs for many work groups.
#[derive(Debug, Clone, Copy)]
pub struct ComputeJob<'a> {
    /// The compiled program; it has a [`Program::compute`].
    pub program: &'a Arc<Program>,
    /// Bytes of each uniform block of the program.
    pub uniforms: &'a [Vec<u8>],
    /// Texture of each sampler of the program.
    pub textures: &'a [QuadTexture<'a>],
    /// Work groups in each direction.
    pub groups: [u32; 3],
}
