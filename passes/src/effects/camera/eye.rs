//! Rays from the camera.

use crate::sampling::hemisphere::concentric_disk;
use curitiba_pipeline::backend::View;
use glam::{DMat3, DVec3, Vec2, Vec3};

/// Origins and directions of the rays of a perspective camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Eye {
    origin: Vec3,
    /// Vector from the eye to the top left corner of the picture, in the plane at distance 1.
    corner: DVec3,
    /// Step from a pixel to the one on its right, in that plane.
    right: DVec3,
    /// Step from a pixel to the one below.
    down: DVec3,
    /// Radius of the lens.
    aperture: f32,
    /// Distance of the plane in focus.
    focus: f32,
}

impl Eye {
    /// The rays of a view, for a picture of `width` columns and `height` rows. The lens has radius `aperture` and its plane
    /// in focus is at distance `focus`.
    ///
    /// A ray through a point of the picture contains every point of the scene that a rasteriser projects there by the same
    /// matrix: the first, second and fourth row of the matrix map the ray's direction to a multiple of (x, y, 1) in
    /// normalised device coordinates.
    #[must_use]
    pub fn new(view: &View, [width, height]: [u32; 2], aperture: f32, focus: f32) -> Self {
        let matrix = view.clip_from_eye.unwrap_or(view.clip_from_world).as_dmat4();
        let rows = [0, 1, 3].map(|row| matrix.row(row).truncate());
        let to_world = DMat3::from_cols(rows[0], rows[1], rows[2]).transpose().inverse();
        let (right, up, forward) = (to_world.x_axis, to_world.y_axis, to_world.z_axis);
        Self {
            origin: view.eye,
            corner: forward - right + up,
            right: right * (2.0 / f64::from(width.max(1))),
            down: up * (-2.0 / f64::from(height.max(1))),
            aperture,
            focus,
        }
    }

    /// Origin and unit direction of the ray through a point of the picture, in pixels from the top left corner. `lens`
    /// gives a point of the unit square; it is only called for an aperture above 0.
    pub(super) fn ray(&self, at: Vec2, lens: impl FnOnce() -> Vec2) -> (Vec3, Vec3) {
        let at = at.as_dvec2();
        let through = self.corner + self.right * at.x + self.down * at.y;
        if self.aperture == 0.0 {
            return (self.origin, through.normalize().as_vec3());
        }
        let on_lens = concentric_disk(lens()).as_dvec2() * f64::from(self.aperture);
        let aside = self.right.normalize() * on_lens.x - self.down.normalize() * on_lens.y;
        let direction = (through * f64::from(self.focus) - aside).normalize();
        ((self.origin.as_dvec3() + aside).as_vec3(), direction.as_vec3())
    }
}
