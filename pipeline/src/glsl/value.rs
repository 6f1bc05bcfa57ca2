//! Sources of a uniform's value, as `<valueof>` declares them.

/// Source of a uniform's value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Value {
    /// `RENDERER`: a matrix of the pass's camera.
    Matrix(Matrix),
    /// `RENDERER NORMAL`: the inverse transpose of [`Matrix::ViewModel`], 3 x 3.
    NormalMatrix,
    /// `RENDERER TEXTURE_COUNT`: number of bound textures.
    TextureCount,
    /// `CAMERA`: a value of the camera with the given index; with `None`, of the pass's camera.
    Camera(Option<usize>, CameraValue),
    /// `LIGHT`: a value of the light with the given index.
    Light(usize, LightValue),
    /// `COLOR`: a value of the material.
    Color(ColorValue),
    /// Numbers that the project declares.
    Constant([f32; 4]),
    /// `TEXTURE_BINDING UNIT`: the texture unit with the given number.
    Unit(u32),
}

/// Matrices, with OpenGL's clip space: depth from -1 to 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Matrix {
    /// View to clip.
    Projection,
    /// Vertex positions to world: a translation by the origin of a scene far from 0, to which positions are relative; otherwise the identity.
    Model,
    /// World to view.
    View,
    /// Vertex positions to view.
    ViewModel,
    /// Vertex positions to clip.
    ProjectionViewModel,
    /// World to clip.
    ProjectionView,
}

/// A value of a camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CameraValue {
    /// World; `w` is 1.
    Position,
    /// Unit direction of view, in the world; `w` is 0.
    View,
    /// Its up vector, of length 1; `w` is 0.
    Up,
    /// World to view.
    ViewMatrix,
    /// View to clip.
    ProjectionMatrix,
    /// World to clip.
    ProjectionViewMatrix,
    /// World to the coordinates of a texture that the camera fills: u and v from 0 to 1, and depth from 0 at the near plane to 1 at the far
    /// plane.
    TextureMatrix,
    /// Degrees, vertical.
    Fov,
    /// Distance of the near plane.
    Near,
    /// Distance of the far plane.
    Far,
}

/// A value of a light. Values that cannot change while a project is open are [`Value::Constant`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightValue {
    /// World; `w` is 1.
    Position,
    /// Direction in which the light shines, with the length that the project gives the direction; `w` is 0.
    Direction {
        /// Its length.
        length: f32,
    },
    /// Colour; `w` is 1.
    Color,
}

/// A value of a material, after the pass has replaced colours.
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
    /// The shader's result, by channel.
    SrcColor,
    /// 1 less [`Self::SrcColor`].
    OneMinusSrcColor,
    /// The target's colour, by channel.
    DstColor,
    /// 1 less [`Self::DstColor`].
    OneMinusDstColor,
    /// The alpha of the shader's result.
    SrcAlpha,
    /// 1 less [`Self::SrcAlpha`].
    OneMinusSrcAlpha,
    /// The target's alpha.
    DstAlpha,
    /// 1 less [`Self::DstAlpha`].
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

    /// The factor with a name of the engine, in any letter case.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::NAMED.iter().find(|(known, _)| known.eq_ignore_ascii_case(name)).map(|(_, factor)| *factor)
    }
}

/// How a shader's result and the target's contents are added; alpha is treated like the colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Blend {
    /// Factor of the shader's result.
    pub source: BlendFactor,
    /// Factor of the target's contents.
    pub destination: BlendFactor,
}

/// How triangles are drawn, as the states of a shader say.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Drawn {
    /// Side of triangles that is culled, if any.
    pub culled: Option<Side>,
    /// How results are blended; `None` where they replace the target's contents.
    pub blend: Option<Blend>,
    /// Whether triangles are tested against the depth of the target. Without the test they write no depth either, as in OpenGL.
    pub tests_depth: bool,
    /// Whether triangles write their depth, so that they hide what is farther.
    pub writes_depth: bool,
}

impl Default for Drawn {
    fn default() -> Self {
        Self { culled: None, blend: None, tests_depth: true, writes_depth: true }
    }
}
