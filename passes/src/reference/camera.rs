//! Camera rays.

use crate::trace::DoubleRay;
use curitiba_pipeline::project;
use glam::{DVec2, DVec3};

/// A camera in `f64`, in the scene's coordinates.
#[derive(Debug, Clone, Copy)]
pub struct Camera {
    position: DVec3,
    /// Unit vectors.
    forward: DVec3,
    right: DVec3,
    up: DVec3,
    /// Distances of the near and far planes.
    near: f64,
    far: f64,
    sight: Sight,
}

#[derive(Debug, Clone, Copy)]
enum Sight {
    /// Half the extent of the view at distance 1, along right and up.
    Perspective(DVec2),
    /// Left and bottom of the view; right and top.
    Parallel(DVec2, DVec2),
}

impl Camera {
    /// The camera of a project, for a picture whose width is `aspect` times its height. `origin` is the world position
    /// of the scene's origin.
    #[must_use]
    pub fn new(camera: &project::Camera, origin: DVec3, aspect: f64) -> Self {
        let forward = camera.direction.as_dvec3().normalize();
        let right = forward.cross(camera.up.as_dvec3()).normalize();
        let sight = match camera.orthographic {
            None => {
                let half = (f64::from(camera.fov_y) / 2.0).tan();
                Sight::Perspective(DVec2::new(half * aspect, half))
            }
            Some(seen) => {
                let [left, right, bottom, top] = [seen.left, seen.right, seen.bottom, seen.top].map(f64::from);
                Sight::Parallel(DVec2::new(left, bottom), DVec2::new(right, top))
            }
        };
        Self {
            position: camera.position - origin,
            forward,
            right,
            up: right.cross(forward),
            near: camera.near.into(),
            far: camera.far.into(),
            sight,
        }
    }

    /// The ray through a place of the picture, in fractions of its width and height from the top left corner.
    pub(super) fn ray(&self, place: DVec2) -> DoubleRay {
        let Self { position, forward, right, up, near, far, .. } = *self;
        match self.sight {
            Sight::Perspective(half) => {
                let seen = DVec2::new(2.0 * place.x - 1.0, 1.0 - 2.0 * place.y) * half;
                let way = forward + right * seen.x + up * seen.y;
                // Length along the ray for a depth of 1.
                let length = way.length();
                DoubleRay { origin: position, direction: way / length, t_min: near * length, t_max: far * length }
            }
            Sight::Parallel(low, high) => {
                let seen = low + (high - low) * DVec2::new(place.x, 1.0 - place.y);
                let origin = position + right * seen.x + up * seen.y + forward * near;
                DoubleRay { origin, direction: forward, t_min: 0.0, t_max: far - near }
            }
        }
    }
}
