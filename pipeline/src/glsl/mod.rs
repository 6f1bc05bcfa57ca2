//! Projects' own shaders: GLSL in the form of the engine's files, compiled to WGSL, and the values that the project maps to their uniforms.
//!
//! A stage goes through four steps, in builds with the feature `glsl`. [`Source::compile`] runs them.
//!
//! 1. `tokens`: comments are removed, `#if` and macros are resolved; every token keeps its place in the file.
//! 2. `rewrite`: constructs that OpenGL allows and the compiler does not are rewritten token by token. Uniforms outside blocks are gathered
//!    into one block, samplers are split, and interface blocks are taken apart. A generated `main` reads attributes, calls the file's `main`,
//!    and writes results.
//! 3. `link`: variables that one stage writes and the other reads get locations.
//! 4. `translate`: the front end of `naga` reads the result, which is validated and written as WGSL.
//!
//! The generated `main` converts clip space from OpenGL's to the rasteriser's: depth from -1 (near) to 1 (far) becomes 1 to 0. Rows count
//! upwards for the shader, in `gl_FragCoord` and in textures, whose rows are handed over from the bottom.
//!
//! Storage blocks keep the layout that the file declares, and get bindings in group 2. The operations of atomic counters are inserted after
//! the compiler's front end, which does not support them (`translate`). Images that shaders load and store are storage buffers with a vec4
//! for each texel, the top row first, since not every device can store to textures that it also loads. Compute shaders have one stage, and
//! go through the same steps ([`ComputeSource`]).
//!
//! Files are bounded ([`MAX_FILE`]), and so are tokens, nesting and macros; macros with parameters are refused.

#[cfg(feature = "glsl")]
mod compile;
#[cfg(feature = "glsl")]
mod link;
#[cfg(feature = "glsl")]
mod rewrite;
#[cfg(all(test, feature = "glsl"))]
mod tests;
#[cfg(feature = "glsl")]
mod tokens;
#[cfg(feature = "glsl")]
mod translate;
mod value;

pub use value::{Blend, BlendFactor, CameraValue, ColorValue, Drawn, LightValue, Matrix, Side, Value};

use std::fmt;

/// Largest shader file, bytes.
pub const MAX_FILE: u64 = 1 << 20;

/// Whether this build compiles shaders.
pub const AVAILABLE: bool = cfg!(feature = "glsl");

/// The help text of faults in builds that compile no shaders, where [`AVAILABLE`] is `false`.
pub const MISSING: &str =
    "it is GLSL of the project's own, which builds with the feature `glsl` draw with wgpu: cargo build --features glsl";

/// Number of colour channels (images, not components) of a target that a shader can write, from location 0: as many as a G-buffer has.
pub const MAX_OUTPUTS: usize = 3;

/// A stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Stage {
    /// For each vertex.
    Vertex,
    /// For each pixel.
    Fragment,
    /// For each invocation of a compute pass.
    Compute,
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Vertex => "vertex shader",
            Self::Fragment => "fragment shader",
            Self::Compute => "compute shader",
        })
    }
}

/// The two files of a shader.
#[derive(Debug, Clone, Copy)]
pub struct Source<'a> {
    /// GLSL of the vertex shader.
    pub vertex: &'a str,
    /// GLSL of the fragment shader.
    pub fragment: &'a str,
    /// Location at which the depth of pixels is written too: 0 at the near plane, 1 at the far plane. It follows the locations of the
    /// target's colours and is below [`MAX_OUTPUTS`]. Results at this location or beyond are dropped, as in OpenGL where a target has no such
    /// channel. With `None` the depth is not written as a colour, and no result is dropped.
    pub depth: Option<usize>,
}

/// The file of a compute shader.
#[derive(Debug, Clone, Copy)]
pub struct ComputeSource<'a> {
    /// GLSL of the shader.
    pub text: &'a str,
}

#[cfg(not(feature = "glsl"))]
impl Source<'_> {
    /// Compiles the two stages: not in this build.
    ///
    /// # Errors
    /// [`MISSING`].
    pub fn compile(&self) -> Result<Program, Vec<Fault>> {
        Err(not_compiled(Stage::Vertex))
    }
}

#[cfg(not(feature = "glsl"))]
impl ComputeSource<'_> {
    /// Compiles the shader: not in this build.
    ///
    /// # Errors
    /// [`MISSING`].
    pub fn compile(&self) -> Result<Program, Vec<Fault>> {
        Err(not_compiled(Stage::Compute))
    }
}

#[cfg(not(feature = "glsl"))]
fn not_compiled(stage: Stage) -> Vec<Fault> {
    let (message, help) = ("this shader was not compiled".to_owned(), Some(MISSING.to_owned()));
    vec![Fault { stage, start: 0, end: 0, message, help }]
}

/// What is wrong with a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// The stage whose file is faulty.
    pub stage: Stage,
    /// First byte of the faulty part of the file. For faults without a place in the file it is 0, as is [`Self::end`].
    pub start: usize,
    /// One past the last byte of the faulty part.
    pub end: usize,
    /// What is wrong.
    pub message: String,
    /// What would be valid.
    pub help: Option<String>,
}

/// A vertex attribute, by the name that the engine gives it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Attribute {
    /// Position in the world; `w` is 1.
    Position,
    /// Unit normal in the world; `w` is 0.
    Normal,
    /// Texture coordinates of unit 0, `v = 0` at the bottom row; `z` is 0, `w` is 1.
    TexCoord,
    /// Unit tangent in the world, the direction in which `u` grows, by MikkTSpace as for normal maps; `w` is 0. All 0 where there is none.
    Tangent,
}

impl Attribute {
    /// All attributes, in the order of their locations in [`Program::vertex`].
    pub const ALL: [Self; 4] = [Self::Position, Self::Normal, Self::TexCoord, Self::Tangent];

    /// Name in the shaders.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Position => "position",
            Self::Normal => "normal",
            Self::TexCoord => "texCoord0",
            Self::Tangent => "tangent",
        }
    }

    /// The attribute's number in `@location`.
    #[must_use]
    pub fn location(self) -> u32 {
        self as u32
    }
}

/// Type of the components of a uniform.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scalar {
    /// 32 bits.
    Float,
    /// 32 bits.
    Int,
    /// 32 bits.
    Uint,
}

/// Layout of a uniform in its block. Columns start 16 bytes apart; a single column takes only the bytes of its components.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// Type of the components.
    pub scalar: Scalar,
    /// Columns: 1 for scalars and vectors.
    pub columns: u32,
    /// Components of a column.
    pub rows: u32,
}

/// A uniform.
#[derive(Debug, Clone, PartialEq)]
pub struct Member {
    /// Name in the shaders.
    pub name: String,
    /// Bytes from the start of its block.
    pub offset: u32,
    /// Its layout; `None` for arrays and structures.
    pub shape: Option<Shape>,
    /// Initial value that the shader declares, as the components of a vector; it applies where the project maps nothing to the uniform.
    /// `None` if the shader declares none.
    pub default: Option<[f32; 4]>,
    /// Where its declaration is in the file, bytes.
    pub at: [usize; 2],
}

/// A uniform buffer: the uniforms outside blocks of a stage, or a block that the shader declares.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// Name of the block; `None` for the uniforms outside blocks.
    pub name: Option<String>,
    /// The stage that reads it.
    pub stage: Stage,
    /// Size, bytes.
    pub size: u32,
    /// Its members. Of the uniforms outside blocks, those that the shader uses.
    pub members: Vec<Member>,
}

/// The name of the uniform that places the viewport: `x` is the viewport's left column. `y` is the number of rows from the viewport's top
/// edge to the target's bottom edge; `gl_FragCoord.y` is `y` less the rows from the top edge. Users cannot declare a uniform of this name.
pub const FRAME: &str = "curitiba_frame";

/// What a sampler does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SamplerKind {
    /// `sampler2D`.
    Color,
    /// `sampler2DShadow`: it compares a depth with four texels, which are read unfiltered, and filters the four results.
    Compared,
    /// `samplerCube`: a direction selects a texel of six images.
    Cube,
}

/// A sampler that a shader declares, through which it reads a texture of the project.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sampler {
    /// Name in the shaders; `name[1]` for an element of an array.
    pub name: String,
    /// The kind of lookup.
    pub kind: SamplerKind,
    /// The first stage that reads it.
    pub stage: Stage,
    /// Where its declaration is in the file, bytes.
    pub at: [usize; 2],
}

/// A uniform array with initial values. The project cannot map a value to it, so it is compiled as a constant.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fixed {
    /// Name in the shaders.
    pub name: String,
    /// The stage that reads it.
    pub stage: Stage,
    /// Where its declaration is in the file, bytes.
    pub at: [usize; 2],
}

/// What a storage buffer holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Held {
    /// The members of a block, as the shader declares them.
    Block,
    /// Atomic counters.
    Counters,
    /// The texels of an `image2D`: four floats each, whatever the image's format; the top row first.
    Image,
}

/// A buffer that a fragment or compute shader reads and stores to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StorageBuffer {
    /// Name in the shader: of the block, the first counter, or the image; `name[1]` for an element of an array of images.
    pub name: String,
    /// The binding point at which the project binds it. For an image this is its unit, unless the project maps another unit to its name.
    pub point: u32,
    /// What it holds.
    pub held: Held,
    /// Whether it is declared `readonly`.
    pub readonly: bool,
    /// Whether the shader reads it.
    pub read: bool,
    /// Whether the shader stores to it.
    pub written: bool,
    /// Where its declaration is in the file of the fragment or compute shader, bytes.
    pub at: [usize; 2],
}

/// The name of the uniform that holds the columns (`x`) and rows (`y`) of the image at index `storage` of [`Program::storage`]. Users cannot
/// declare a uniform of this name.
#[must_use]
pub fn image_size(storage: usize) -> String {
    format!("curitiba_size{storage}")
}

/// The index in [`Program::storage`] of the image whose size the uniform of this name holds; `None` for other names.
#[must_use]
pub fn is_image_size(name: &str) -> Option<usize> {
    name.strip_prefix("curitiba_size")?.parse().ok()
}

/// The compute stage of a program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Compute {
    /// WGSL.
    pub text: String,
    /// Invocations of a work group, in each direction.
    pub group: [u32; 3],
}

/// A compiled shader.
///
/// The entry point of all stages is `main`. Uniform buffers are in group 0, by their places in [`Self::blocks`]; textures in group 1: the
/// texture of [`Self::samplers`] `i` is binding `2 i`, its sampler `2 i + 1`; storage buffers in group 2, by their places in
/// [`Self::storage`].
#[derive(Debug, Clone, PartialEq)]
pub struct Program {
    /// WGSL; empty in a compute shader.
    pub vertex: String,
    /// WGSL; empty in a compute shader.
    pub fragment: String,
    /// The stage of a compute shader; `None` for a shader with the two stages above.
    pub compute: Option<Compute>,
    /// Vertex attributes that it reads.
    pub attributes: Vec<Attribute>,
    /// Uniform buffers that it reads for each draw.
    pub blocks: Vec<Block>,
    /// Textures that it samples.
    pub samplers: Vec<Sampler>,
    /// Which channels of a target it writes, by location.
    pub outputs: [bool; MAX_OUTPUTS],
    /// Whether some variable between the stages is not interpolated. OpenGL then takes its value from a triangle's last corner.
    pub flat: bool,
    /// Buffers that the fragment or compute shader reads and stores to.
    pub storage: Vec<StorageBuffer>,
    /// Place of `early_fragment_tests` in the fragment shader's file, in bytes; `None` if it is not declared. If it is declared, hidden
    /// pixels store nothing.
    pub early: Option<[usize; 2]>,
    /// Uniform arrays that keep their initial values.
    pub fixed: Vec<Fixed>,
}

impl Program {
    /// The images that it loads and stores.
    pub fn images(&self) -> impl Iterator<Item = &StorageBuffer> {
        self.storage.iter().filter(|buffer| buffer.held == Held::Image)
    }
}
