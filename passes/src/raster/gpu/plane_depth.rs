//! Depth on the planes of triangles: the camera's data that the G-buffer shader reads.

use curitiba_pipeline::backend::View;
use glam::{DVec3, DVec4, Vec4};

/// The lines of sight of a picture's pixels in homogeneous coordinates relative to [`Self::origin`], laid out as in `Frame` of the shader.
/// The point of depth z on the line through (x, y), in pixels from the picture's upper left corner, is
/// `towards * z - (corner + right * x + down * y)`.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct LinesOfSight {
    /// The eye, or for a camera without perspective the middle of what it sees. The fourth component is 0.
    pub origin: Vec4,
    /// Minus the point of depth 0 at the picture's upper left corner.
    pub corner: Vec4,
    /// Change of [`Self::corner`] for a pixel to the right.
    pub right: Vec4,
    /// Change of [`Self::corner`] for a pixel down.
    pub down: Vec4,
    /// Change of the point for a change of depth by 1.
    pub towards: Vec4,
}

impl LinesOfSight {
    /// The lines of sight of a picture of `width` x `height` pixels. A matrix that cannot be inverted gives no finite numbers; the shader
    /// then keeps the device's depth.
    pub fn new(view: &View, [width, height]: [u32; 2]) -> Self {
        let (matrix, offset) = view.projection();
        let (inverse, offset) = (matrix.as_dmat4().inverse(), offset.as_dvec3());
        // With perspective all lines meet in the eye, where the fourth clip coordinate is 0.
        let is_parallel = matrix.row(3).truncate() == glam::Vec3::ZERO;
        let middle = if is_parallel { inverse.w_axis + inverse.z_axis * 0.5 } else { inverse.z_axis };
        let origin = (offset + middle.truncate() / middle.w).as_vec3();
        let moved = origin.as_dvec3() - offset;
        let relative = |point: DVec4| relative_to(moved, point).as_vec4();
        Self {
            origin: origin.extend(0.0),
            corner: relative(inverse.x_axis - inverse.y_axis - inverse.w_axis),
            right: relative(inverse.x_axis * (-2.0 / f64::from(width.max(1)))),
            down: relative(inverse.y_axis * (2.0 / f64::from(height.max(1)))),
            towards: relative(inverse.z_axis),
        }
    }
}

/// A homogeneous point relative to another origin.
fn relative_to(origin: DVec3, point: DVec4) -> DVec4 {
    (point.truncate() - origin * point.w).extend(point.w)
}
