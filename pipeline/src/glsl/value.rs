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
