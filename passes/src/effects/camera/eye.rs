//! Rays from the camera.

use crate::sampling::hemisphere::concentric_disk;
use curitiba_pipeline::backend::View;
use glam::{DMat3, DVec3, Vec2, Vec3};

/// Where the rays of a camera with perspective start, and where to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Eye {
    origin: Vec3,
    /// From the eye to the top left corner of the picture, in the plane at distance 1.
    corner: DVec3,
    /// From a pixel to the one on its right, in that plane.
    right: DVec3,
    /// From a pixel to the one below.
    down: DVec3,
    /// Radius of the lens.
    aperture: f32,
    /// Distance of the plane that is sharp.
    focus: f32,
}

impl Eye {
    /// That of a view of so many pixels a row and rows, with a lens of radius `aperture` that shows the plane at distance `focus` sharp.
    ///
    /// What a rasteriser projects with the same matrix onto a point of the picture lies on the ray through that point: directions are those
    /// that the first, second and fourth row of the matrix turn into a multiple of (x, y, 1) of normalised device coordinates.
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

    /// The origin and the unit direction of a ray through a point of the picture, in pixels from its top left corner; `lens` is a point of the
    /// unit square, for a lens that is no pinhole.
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
