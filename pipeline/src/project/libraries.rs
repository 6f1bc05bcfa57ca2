//! The material libraries of a project, and the inputs of shaders, while the project is read.

use super::dom::{Element, Value};
use super::report::{Found, Names, Span};
use super::{ChannelRef, RenderTarget};
use crate::glsl::Drawn;
use crate::scene::texture::Magnification;
use glam::Vec4;
use std::collections::HashMap;
use std::path::PathBuf;
use std::rc::Rc;

/// Names of a library's root element.
pub(super) const ROOT: &[&str] = &["materialLib", "mlib"];

/// Names of the built-in library.
pub(super) const BUILT_IN: [&str; 2] = ["curitiba_material_lib", "__nau_material_lib"];

/// Materials of the built-in library, with diffuse colour and emission.
const BUILT_IN_MATERIALS: &[(&str, [f32; 3], [f32; 3])] = &[
    ("__Black", [0.0; 3], [0.0; 3]),
    ("__White", [1.0; 3], [0.0; 3]),
    ("__Grey", [0.5; 3], [0.0; 3]),
    ("__Red", [1.0, 0.0, 0.0], [0.0; 3]),
    ("__Green", [0.0, 1.0, 0.0], [0.0; 3]),
    ("__Blue", [0.0, 0.0, 1.0], [0.0; 3]),
    ("__Emission White", [0.0; 3], [1.0; 3]),
    ("__Emission Red", [0.0; 3], [1.0, 0.0, 0.0]),
    ("__Emission Green", [0.0; 3], [0.0, 1.0, 0.0]),
    ("__Emission Blue", [0.0; 3], [0.0, 0.0, 1.0]),
    ("__Emission Yellow", [0.0; 3], [1.0, 1.0, 0.0]),
];

/// Properties of a light that only own shaders read.
#[derive(Debug, Clone)]
pub(super) struct LightExtra {
    /// Length of the direction as the file gives it; 1 without a direction.
    pub length: f32,
    /// Values of further properties, by the engine's names.
    pub values: Vec<(&'static str, [f32; 4])>,
}

/// The meaning of a texture's name in a library.
#[derive(Debug, Clone)]
pub(super) enum Texture {
    /// A colour channel or a kept depth channel of a render target, or an image; `None` if the target could not be read.
    Channel(Option<ChannelRef>),
    /// A depth or stencil of a render target that passes cannot read.
    Depth,
    /// An image file: its path as written, relative to the folder of the library's file.
    File(Value),
    /// A cube map: its `<cubeMap>`, which names six image files.
    Cube(Rc<Element>),
    /// A texture of a kind that is not supported.
    Other,
}

/// A `<valueof>`: the value that a uniform of a shader gets.
#[derive(Debug, Clone)]
pub(super) struct ValueOf {
    pub uniform: Value,
    /// Name of the uniform's block; `None` for a uniform outside of blocks.
    pub block: Option<Value>,
    pub kind: Option<Value>,
    pub context: Option<Value>,
    pub component: Option<Value>,
    pub id: Option<Value>,
    pub span: Span,
}

impl ValueOf {
    /// Parses the element; `None` if it names no uniform.
    pub fn new(element: &Element) -> Option<Self> {
        let of = |name: &str| element.attribute(name).cloned();
        Some(Self {
            uniform: of("uniform")?,
            block: of("block"),
            kind: of("type"),
            context: of("context"),
            component: of("component"),
            id: of("id"),
            span: element.span,
        })
    }
}

/// Whether a value for the uniform `given` applies to the sampler or image `name`. A value for `tex[0]` or `tex` applies to all
/// elements of `tex`.
pub(super) fn names(given: &str, name: &str) -> bool {
    let array = |name: &str| name.split('[').next().unwrap_or_default().to_owned();
    given == name
        || name.contains('[') && array(given) == array(name) && (given.ends_with("[0]") || !given.contains('['))
}

/// The render state in a `<state>`.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct State {
    /// The part of the state that is supported.
    pub drawn: Drawn,
    /// An unsupported part of the state, for messages.
    pub other: Option<&'static str>,
}

/// A texture bound to a texture unit.
#[derive(Debug, Clone)]
pub(super) struct Binding {
    pub unit: u32,
    /// Index of the texture's library; `None` for the material's own library.
    pub library: Option<usize>,
    pub name: Value,
    /// The element `COMPARE_FUNC`, if present.
    pub compare: Option<Value>,
    /// The element `MAG_FILTER`; it applies only to materials without an own shader.
    pub magnification: Magnification,
}

/// A buffer that is bound to a binding point.
#[derive(Debug, Clone)]
pub(super) struct BufferBinding {
    pub point: u32,
    /// Whether it holds atomic counters.
    pub counters: bool,
    /// Name of the buffer's library; `None` for the material's own library.
    pub library: Option<Value>,
    pub name: Value,
}

/// A texture that is bound to an image unit, for shaders that load and store it.
#[derive(Debug, Clone)]
pub(super) struct ImageBinding {
    pub unit: u32,
    pub name: Value,
    /// Whether it is filled with zeros before each pass that binds it.
    pub cleared: bool,
    /// The mip level, where it is not the first.
    pub level: Option<Value>,
}

/// A material of a library.
#[derive(Debug, Clone)]
pub(super) struct LibraryMaterial {
    pub name: String,
    pub diffuse: Vec4,
    pub emission: Vec4,
    pub ambient: Vec4,
    pub specular: Vec4,
    pub shininess: f32,
    /// Index into [`Library::shaders`].
    pub shader: Option<usize>,
    /// The values of the shader's uniforms.
    pub values: Vec<ValueOf>,
    /// The bound textures.
    pub textures: Vec<Binding>,
    /// Buffers that are bound.
    pub buffers: Vec<BufferBinding>,
    /// Images that are bound.
    pub images: Vec<ImageBinding>,
    /// First units of the bound arrays of textures, and of the bound arrays of images, each in the order of the file.
    pub arrays: [Vec<u32>; 2],
    /// The render state with which it is drawn.
    pub state: State,
}

impl LibraryMaterial {
    /// A material with the default colours. It has no shader and binds nothing.
    pub fn plain(name: &str) -> Self {
        let defaults = crate::scene::Material::default();
        Self {
            name: name.to_owned(),
            diffuse: defaults.diffuse,
            emission: defaults.emission,
            ambient: defaults.ambient,
            specular: defaults.specular,
            shininess: defaults.shininess,
            shader: None,
            values: Vec::new(),
            textures: Vec::new(),
            buffers: Vec::new(),
            images: Vec::new(),
            arrays: Default::default(),
            state: State::default(),
        }
    }
}

/// A shader of a library.
#[derive(Debug, Clone)]
pub(super) struct Shader {
    pub name: String,
    /// Stem of its pixel-shader file.
    pub stem: String,
    /// File of its vertex shader.
    pub vertex: Option<Value>,
    /// File of its pixel shader.
    pub pixel: Option<Value>,
    /// File of its compute shader.
    pub compute: Option<Value>,
    /// Descriptions of its unsupported stages, each with the place that names the stage.
    pub others: Vec<(&'static str, Span)>,
}

/// A library.
#[derive(Debug)]
pub(super) struct Library {
    pub name: String,
    /// Path of the file.
    pub path: PathBuf,
    /// Names of render targets, with their indices into [`Libraries::targets`].
    pub target_names: Names,
    pub target_indices: Vec<Option<usize>>,
    pub texture_names: Names,
    pub textures: Vec<Texture>,
    /// Number of textures in each array of textures, by the array's name. Its textures are `name_0`, `name_1` and so on.
    pub arrays: HashMap<String, u32>,
    /// Names of storage buffers, with their indices into [`Libraries::targets`]; `None` for a buffer whose size could not be read.
    pub buffer_names: Names,
    pub buffer_indices: Vec<Option<usize>>,
    pub shader_names: Names,
    pub shaders: Vec<Shader>,
    /// Render states by name.
    pub states: HashMap<String, State>,
    pub material_names: Names,
    pub materials: Vec<Option<Rc<LibraryMaterial>>>,
}

impl Library {
    pub fn new(name: &str, path: PathBuf) -> Self {
        Self {
            name: name.to_owned(),
            path,
            target_names: Names::new("render target"),
            target_indices: Vec::new(),
            texture_names: Names::new("texture"),
            textures: Vec::new(),
            arrays: HashMap::new(),
            buffer_names: Names::new("buffer"),
            buffer_indices: Vec::new(),
            shader_names: Names::new("shader"),
            shaders: Vec::new(),
            states: HashMap::new(),
            material_names: Names::new("material"),
            materials: Vec::new(),
        }
    }

    fn built_in(name: &str) -> Self {
        let mut library = Self::new(name, PathBuf::new());
        for (name, diffuse, emission) in BUILT_IN_MATERIALS {
            let opaque = |[r, g, b]: [f32; 3]| Vec4::new(r, g, b, 1.0);
            library.material_names.declare_built_in(name);
            library.materials.push(Some(Rc::new(LibraryMaterial {
                diffuse: opaque(*diffuse),
                emission: opaque(*emission),
                ..LibraryMaterial::plain(name)
            })));
        }
        library
    }
}

/// All libraries of a project.
pub(super) struct Libraries {
    pub names: Names,
    pub list: Vec<Library>,
    pub files: Vec<PathBuf>,
    /// Whether some library could not be read; unknown names may be declared in it.
    pub incomplete: bool,
    /// Render targets of all libraries.
    pub targets: Vec<RenderTarget>,
    /// The highest mip level of channels that have several.
    pub levels: HashMap<ChannelRef, u32>,
    /// The targets that hold mip levels to which shaders store, by channel and level from 1 on.
    pub level_targets: HashMap<(ChannelRef, u32), usize>,
}

impl Libraries {
    pub fn new() -> Self {
        let mut names = Names::new("material library");
        BUILT_IN.iter().for_each(|name| names.declare_built_in(name));
        let list = BUILT_IN.iter().map(|name| Library::built_in(name)).collect();
        Self {
            names,
            list,
            files: Vec::new(),
            incomplete: false,
            targets: Vec::new(),
            levels: HashMap::new(),
            level_targets: HashMap::new(),
        }
    }

    /// A library by its index.
    pub fn get(&self, library: usize) -> &Library {
        &self.list[library]
    }

    /// Whether the project has a library of this name.
    pub fn declares(&self, name: &str) -> bool {
        matches!(self.names.find(name), Found::Exact(_))
    }

    /// Index into [`Self::targets`] of the storage buffer that `text`, written as `Library::name`, names; `None` if there is none.
    pub fn buffer_named(&self, text: &str) -> Option<usize> {
        let (library, name) = text.split_once("::")?;
        let library = self.list.iter().find(|known| known.name == library.trim())?;
        let (Found::Exact(index) | Found::OtherCase(index)) = library.buffer_names.find(name.trim()) else {
            return None;
        };
        library.buffer_indices[index]
    }

    /// `Library::channel`, as files write it.
    pub fn channel_name(&self, channel: ChannelRef) -> String {
        let target = &self.targets[channel.target];
        format!("{}::{}", target.library, target.channels[channel.channel].name)
    }
}

/// What an injection binds in addition to a shader.
#[derive(Debug, Default)]
pub(super) struct Injected {
    pub textures: Vec<Binding>,
    pub buffers: Vec<BufferBinding>,
    pub images: Vec<ImageBinding>,
}

impl Injected {
    /// No bindings.
    pub const NONE: Self = Self { textures: Vec::new(), buffers: Vec::new(), images: Vec::new() };
}
