//! Cube maps: the cameras of the six faces, and the lookup of a direction.
//!
//! Faces, their order and orientation are those of OpenGL, Vulkan, Direct3D and WebGPU (Vulkan 1.3, section 16.5.4): +x, -x,
//! +y, -y, +z, -z, each seen from the cube's centre with the row order of images.

use curitiba_pipeline::backend::View;
use glam::{DMat4, DVec3, DVec4, Vec2, Vec3};

/// Number of faces of a cube.
pub const FACES: usize = 6;

/// For each face: the directions to its centre, to its right, and down.
pub(crate) const AXES: [[Vec3; 3]; FACES] = [
    [Vec3::X, Vec3::NEG_Z, Vec3::NEG_Y],
    [Vec3::NEG_X, Vec3::Z, Vec3::NEG_Y],
    [Vec3::Y, Vec3::X, Vec3::Z],
    [Vec3::NEG_Y, Vec3::X, Vec3::NEG_Z],
    [Vec3::Z, Vec3::X, Vec3::NEG_Y],
    [Vec3::NEG_Z, Vec3::NEG_X, Vec3::NEG_Y],
];

/// The camera of a face: 90 degrees field of view, reversed depth, between `near` and `far` (`0 < near < far`).
///
/// Cube maps are seen from inside, so this camera mirrors: its clip space is left-handed, and front faces appear with
/// the winding of back faces. Maps are drawn without culling, so both windings are drawn.
///
/// # Panics
/// If `face` is not below [`FACES`].
#[must_use]
pub fn view(face: usize, center: Vec3, near: f32, far: f32) -> View {
    let [forward, right, down] = AXES[face].map(Vec3::as_dvec3);
    let (eye, near, far) = (center.as_dvec3(), f64::from(near), f64::from(far));
    let row = |axis: DVec3, scale: f64, offset: f64| (axis * scale).extend(offset - axis.dot(eye) * scale);
    let (scale, offset) = (-near / (far - near), near * far / (far - near));
    let rows = [row(right, 1.0, 0.0), row(-down, 1.0, 0.0), row(forward, scale, offset), row(forward, 1.0, 0.0)];
    let [x, y, z, w]: [DVec4; 4] = rows;
    View::new(DMat4::from_cols(x, y, z, w).transpose().as_mat4(), center)
}

/// The face that a direction hits, and where on the face: 0..=1 from its top left corner. Face 0 for the direction 0.
#[must_use]
#[inline]
pub fn locate(direction: Vec3) -> (usize, Vec2) {
    let size = direction.abs();
    let face = if size.x >= size.y && size.x >= size.z {
        usize::from(direction.x < 0.0)
    } else if size.y >= size.z {
        2 + usize::from(direction.y < 0.0)
    } else {
        4 + usize::from(direction.z < 0.0)
    };
    let [forward, right, down] = AXES[face];
    let scale = 0.5 / direction.dot(forward).max(f32::MIN_POSITIVE);
    (face, Vec2::new(direction.dot(right), direction.dot(down)) * scale + Vec2::splat(0.5))
}

/// Bilinear filtering of a face of `size` x `size` texels at `at` (from [`locate`]). Places are clamped to the
/// centres of the face's outer texels. So at a seam, each of the two faces is read at most half a texel away from the seam.
///
/// # Panics
/// If the face has less than `size * size` texels.
#[must_use]
#[inline]
pub fn sample(texels: &[[f32; 4]], size: u32, at: Vec2) -> Vec3 {
    let last = (size - 1) as f32;
    let place = (at * size as f32 - 0.5).clamp(Vec2::ZERO, Vec2::splat(last));
    let (left, top) = (place.x as usize, place.y as usize);
    let (right, bottom) = ((left + 1).min(size as usize - 1), (top + 1).min(size as usize - 1));
    let (across, down) = (place.x - left as f32, place.y - top as f32);
    let texel = |x: usize, y: usize| {
        let [r, g, b, _] = texels[y * size as usize + x];
        Vec3::new(r, g, b)
    };
    let upper = texel(left, top).lerp(texel(right, top), across);
    let lower = texel(left, bottom).lerp(texel(right, bottom), across);
    upper.lerp(lower, down)
}
