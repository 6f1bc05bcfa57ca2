// Shared by the program that computes the planes of triangles, and by those that draw and shade triangles.

// Uniforms of all draws of a pass.
struct Frame {
    // For positions relative to `eye`. Depth is reversed: 1 at the near plane, 0 at the far plane.
    clip_from_eye: mat4x4<f32>,
    // xyz: the eye, or zero for cameras near the origin. w: side of the square over which textures are filtered, in
    // pixels.
    eye: vec4<f32>,
    // Unit vector towards the light in xyz; zero without a light.
    to_light: vec4<f32>,
    // Colour of the light; alpha is 1.
    light_color: vec4<f32>,
    // MIRRORED: the plane of the mirror. Its dot product with a position relative to `eye`, and 1, is below 0 behind the mirror.
    clip_plane: vec4<f32>,
    // The lines of sight of the pixels, as `LinesOfSight`.
    origin: vec4<f32>,
    corner: vec4<f32>,
    right: vec4<f32>,
    down: vec4<f32>,
    towards: vec4<f32>,
    // PER_PIXEL: the part of the picture that is shaded, in pixels: its upper left corner, its width and its height.
    part: vec4<u32>,
    // PER_PIXEL: the colour of pixels without a surface.
    background: vec4<f32>,
}
//#if PLANE_DEPTH

// The plane of a triangle for one camera.
struct Plane {
    // The dot product of `plane` with a homogeneous point, taken relative to `frame.origin`, is 0 if the point lies in the plane.
    plane: vec4<f32>,
    // Change of depth for one pixel to the right, and for one down.
    slope: vec2<f32>,
    // 1 / the dot product of `plane` with `frame.towards`.
    scale: f32,
}

// The dot product. It is written as fused operations so that every variant rounds alike: of equal triangles, the first one drawn must stay.
fn product(a: vec4<f32>, b: vec4<f32>) -> f32 {
    return fma(a.x, b.x, fma(a.y, b.y, fma(a.z, b.z, a.w * b.w)));
}
//#endif
