//! Projects' own shaders: GLSL as the engine's files hold it, compiled to WGSL, and what the project says of their uniforms.
//!
//! A stage goes through four steps, in builds with the feature `glsl`. [`Source::compile`] runs them.
//!
//! 1. `tokens`: comments go, `#if` and macros are resolved; every token keeps its place in the file.
//! 2. `rewrite`: what OpenGL allows and the compiler does not is written otherwise, token by token: uniforms outside blocks are gathered into
//!    one, samplers are split, interface blocks taken apart, and `main` is called by one of ours, which reads attributes and writes results.
//! 3. `link`: what one stage writes and the other reads gets locations.
//! 4. `translate`: the front end of `naga` reads the result, which is validated and written as WGSL.
//!
//! Our `main` turns clip space from OpenGL's into that of the rasteriser: depth from -1 (near) to 1 (far) becomes 1 to 0. Rows count upwards for
//! the shader, in `gl_FragCoord` as in textures, whose rows are handed over from the bottom.
//!
//! Storage buffers are bound as they are; what atomic counters do is put behind the compiler, which has no word for it (`translate`).
//! Images that shaders load and store are storage buffers of a vec4 for each texel, the top row first, since not every device stores to
//! textures that it also loads. Compute shaders have one stage, and go through the same steps ([`ComputeSource`]).
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

/// What a build without [`AVAILABLE`] says.
pub const MISSING: &str =
    "it is GLSL of the project's own, which builds with the feature `glsl` draw with wgpu: cargo build --features glsl";

/// How many channels of a target a shader's results go to, from location 0: what a G-buffer holds of colours.
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
    /// What runs for each vertex.
    pub vertex: &'a str,
    /// What runs for each pixel.
    pub fragment: &'a str,
    /// Where the depth of pixels is written as well, 0 at the near plane and 1 at the far plane, below [`MAX_OUTPUTS`]: the location behind
    /// those of the target's colours. Results from there on go nowhere, as OpenGL has it where a target has no such channel.
    pub depth: Option<usize>,
}

/// The file of a compute shader.
#[derive(Debug, Clone, Copy)]
pub struct ComputeSource<'a> {
    /// Its text.
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
    /// Which file.
    pub stage: Stage,
    /// First byte.
    pub start: usize,
    /// One past the last byte.
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
    /// Unit tangent in the world, along which `u` grows, as normal maps are made with (MikkTSpace); `w` is 0. 0 where there is none.
    Tangent,
}

impl Attribute {
    /// All of them; their places are the locations in [`Program::vertex`].
    pub const ALL: [Self; 4] = [Self::Position, Self::Normal, Self::TexCoord, Self::Tangent];

    /// As shaders declare it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Position => "position",
            Self::Normal => "normal",
            Self::TexCoord => "texCoord0",
            Self::Tangent => "tangent",
        }
    }

    /// Its number in `@location`.
    #[must_use]
    pub fn location(self) -> u32 {
        self as u32
    }
}

/// Of what kind the components of a uniform are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scalar {
    /// 32 bits.
    Float,
    /// 32 bits.
    Int,
    /// 32 bits.
    Uint,
}

/// How a uniform lies in its block: columns of 16 bytes, or one of as many components as it has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// Of its components.
    pub scalar: Scalar,
    /// Columns: 1 for scalars and vectors.
    pub columns: u32,
    /// Components of a column.
    pub rows: u32,
}

/// A uniform.
#[derive(Debug, Clone, PartialEq)]
pub struct Member {
    /// As shaders declare it.
    pub name: String,
    /// Bytes from the start of its block.
    pub offset: u32,
    /// How it lies there; `None` for arrays and structures.
    pub shape: Option<Shape>,
    /// What it has where the project maps nothing to it: components of a vector.
    pub default: Option<[f32; 4]>,
    /// Where its declaration is in the file, bytes.
    pub at: [usize; 2],
}

/// A uniform buffer: the uniforms outside blocks of a stage, or a block that the shader declares.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// `None` for what was declared outside blocks.
    pub name: Option<String>,
    /// Who reads it.
    pub stage: Stage,
    /// Bytes.
    pub size: u32,
    /// Those that the shader reads.
    pub members: Vec<Member>,
}

/// The name of the uniform that says where the viewport lies: `x` is its left column, `y` is from how many rows above it `gl_FragCoord` counts
/// down. Users cannot declare one of this name.
pub const FRAME: &str = "curitiba_frame";

/// What a sampler does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SamplerKind {
    /// `sampler2D`.
    Color,
    /// `sampler2DShadow`: it compares a depth with those of the texture, which is read unfiltered.
    Compared,
    /// `samplerCube`: a direction is looked up in six images.
    Cube,
}

/// A texture of the project, sampled.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sampler {
    /// As shaders declare it; of an element of an array `name[1]`.
    pub name: String,
    /// What it does.
    pub kind: SamplerKind,
    /// Who reads it first.
    pub stage: Stage,
    /// Where its declaration is in the file, bytes.
    pub at: [usize; 2],
}

/// A uniform array with the values that it begins with, to which nothing can be mapped: a constant.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fixed {
    /// As shaders declare it.
    pub name: String,
    /// Who reads it.
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
    /// As the shader declares it: the block, the first counter, or the image; of an element of an array of images `name[1]`.
    pub name: String,
    /// The binding point at which the project binds it. Of an image the unit, unless the project maps another to its name.
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

/// The name of the uniform that says how many columns (`x`) and rows (`y`) the image at that place of [`Program::storage`] has. Users
/// cannot declare one of this name.
#[must_use]
pub fn image_size(storage: usize) -> String {
    format!("curitiba_size{storage}")
}

/// The place in [`Program::storage`] of the image whose size a uniform of this name is.
#[must_use]
pub fn is_image_size(name: &str) -> Option<usize> {
    name.strip_prefix("curitiba_size")?.parse().ok()
}

/// A compute shader's own.
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
    /// What a compute shader has instead of the two.
    pub compute: Option<Compute>,
    /// What it reads of a vertex.
    pub attributes: Vec<Attribute>,
    /// What it reads for each draw.
    pub blocks: Vec<Block>,
    /// What it samples.
    pub samplers: Vec<Sampler>,
    /// Which channels of a target it writes, by location.
    pub outputs: [bool; MAX_OUTPUTS],
    /// Whether something is not interpolated: OpenGL then takes it from a triangle's last corner.
    pub flat: bool,
    /// Buffers that the fragment or compute shader reads and stores to.
    pub storage: Vec<StorageBuffer>,
    /// Where the fragment shader says that hidden pixels store nothing (`early_fragment_tests`), bytes of its file.
    pub early: Option<[usize; 2]>,
    /// Uniforms that keep the values that they begin with.
    pub fixed: Vec<Fixed>,
}

impl Program {
    /// The images that it loads and stores.
    pub fn images(&self) -> impl Iterator<Item = &StorageBuffer> {
        self.storage.iter().filter(|buffer| buffer.held == Held::Image)
    }
}
