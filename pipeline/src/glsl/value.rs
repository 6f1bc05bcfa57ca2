//! Where the value of a uniform comes from: what `<valueof>` says.

/// What a uniform is given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Value {
    /// `RENDERER`: a matrix of the pass's camera.
    Matrix(Matrix),
    /// `RENDERER NORMAL`: the inverse transpose of [`Matrix::ViewModel`], 3 x 3.
    NormalMatrix,
    /// `RENDERER TEXTURE_COUNT`: textures that are bound.
    TextureCount,
    /// `CAMERA`: of the camera with that index, or of the pass.
    Camera(Option<usize>, CameraValue),
    /// `LIGHT`: of the light with that index.
    Light(usize, LightValue),
    /// `COLOR`: of the material.
    Color(ColorValue),
    /// Numbers that the project declares.
    Constant([f32; 4]),
    /// `TEXTURE_BINDING UNIT`: the texture of that unit.
    Unit(u32),
}

/// Matrices, with OpenGL's clip space: depth from -1 to 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Matrix {
    /// View to clip.
    Projection,
    /// Positions of vertices to the world. They are the world's already, but for the origin of a scene far from 0.
    Model,
    /// World to view.
    View,
    /// Positions of vertices to view.
    ViewModel,
    /// Positions of vertices to clip.
    ProjectionViewModel,
    /// World to clip.
    ProjectionView,
}

/// Of a camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CameraValue {
    /// World; `w` is 1.
    Position,
    /// Unit direction; `w` is 0.
    View,
    /// Its up vector, of length 1; `w` is 0.
    Up,
    /// World to view.
    ViewMatrix,
    /// View to clip.
    ProjectionMatrix,
    /// World to clip.
    ProjectionViewMatrix,
    /// World to a texture that the camera fills: from 0 to 1 in each direction and in depth.
    TextureMatrix,
    /// Degrees, vertical.
    Fov,
    /// Distance of the near plane.
    Near,
    /// Distance of the far plane.
    Far,
}

/// Of a light. What cannot be changed while a project is open is a [`Value::Constant`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightValue {
    /// World; `w` is 1.
    Position,
    /// In which it shines, as long as the project has it; `w` is 0.
    Direction {
        /// Its length.
        length: f32,
    },
    /// `w` is 1.
    Color,
}

/// Of a material, after the pass's maps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColorValue {
    /// Diffuse colour.
    Diffuse,
    /// Ambient colour.
    Ambient,
    /// Specular colour.
    Specular,
    /// Emitted colour.
    Emission,
    /// Phong exponent.
    Shininess,
}

/// A side of triangles; the front is where their corners go counter-clockwise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Side {
    /// `CULL_TYPE` `FRONT`.
    Front,
    /// `CULL_TYPE` `BACK`.
    Back,
}

/// What a colour is multiplied by before it is added to another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum BlendFactor {
    /// 0.
    Zero,
    /// 1.
    One,
    /// What the shader writes, by channel.
    SrcColor,
    /// 1 less that.
    OneMinusSrcColor,
    /// What is there, by channel.
    DstColor,
    /// 1 less that.
    OneMinusDstColor,
    /// The alpha that the shader writes.
    SrcAlpha,
    /// 1 less that.
    OneMinusSrcAlpha,
    /// The alpha that is there.
    DstAlpha,
    /// 1 less that.
    OneMinusDstAlpha,
}

impl BlendFactor {
    /// All, by the engine's names.
    pub const NAMED: [(&str, Self); 10] = [
        ("ZERO", Self::Zero),
        ("ONE", Self::One),
        ("SRC_COLOR", Self::SrcColor),
        ("ONE_MINUS_SRC_COLOR", Self::OneMinusSrcColor),
        ("DST_COLOR", Self::DstColor),
        ("ONE_MINUS_DST_COLOR", Self::OneMinusDstColor),
        ("SRC_ALPHA", Self::SrcAlpha),
        ("ONE_MINUS_SRC_ALPHA", Self::OneMinusSrcAlpha),
        ("DST_ALPHA", Self::DstAlpha),
        ("ONE_MINUS_DST_ALPHA", Self::OneMinusDstAlpha),
    ];

    /// The one of a name of the engine, in any letters' case.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::NAMED.iter().find(|(known, _)| known.eq_ignore_ascii_case(name)).map(|(_, factor)| *factor)
    }
}

/// How what a shader writes and what is there are added up, alpha like the colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Blend {
    /// What the shader's result is multiplied by.
    pub source: BlendFactor,
    /// What is multiplied that is there.
    pub destination: BlendFactor,
}

/// How a shader's states say that triangles are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Drawn {
    /// Which side of triangles is left out, where the states say so.
    pub culled: Option<Side>,
    /// What is added up; `None` where the result takes the place of what is there.
    pub blend: Option<Blend>,
    /// Whether triangles are hidden by what is nearer. Those that are not hide nothing either, as in OpenGL.
    pub tests_depth: bool,
    /// Whether they hide what is farther.
    pub writes_depth: bool,
}

impl Default for Drawn {
    fn default() -> Self {
        Self { culled: None, blend: None, tests_depth: true, writes_depth: true }
    }
}
