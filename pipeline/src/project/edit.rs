//! Changing cameras and lights of a loaded project.

use super::values::unit;
use super::{Light, Project, find};
use crate::color::{BRIGHTEST, in_range};
use glam::Vec3;

/// Least sine of the angle between view and up vector; below it the picture's horizontal axis would be rounding noise.
const LEAST_SINE: f32 = 1e-4;

/// Position and orientation of a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Position in world space, rounded to `f32` if the camera's file has more digits.
    pub position: Vec3,
    /// Viewing direction, of any length other than 0.
    pub direction: Vec3,
    /// Up vector, of any length other than 0, not parallel to [`Self::direction`].
    pub up: Vec3,
    /// Vertical field of view, radians, in (0, π). Ignored by an orthographic camera.
    pub fov_y: f32,
}

impl Project {
    /// The pose of a camera by its name.
    ///
    /// # Errors
    /// If there is no such camera; the message gives the nearest name and the valid ones.
    pub fn pose(&self, camera: &str) -> Result<Pose, String> {
        let camera = &self.cameras[self.camera(camera)?];
        Ok(Pose {
            position: camera.position.as_vec3(),
            direction: camera.direction,
            up: camera.up,
            fov_y: camera.fov_y,
        })
    }

    /// Moves a camera, as if its file contained this pose.
    ///
    /// # Errors
    /// If there is no such camera, or the pose is degenerate; the project is then unchanged.
    pub fn set_pose(&mut self, camera: &str, pose: Pose) -> Result<(), String> {
        let index = self.camera(camera)?;
        let name = &self.cameras[index].name;
        let wrong = |what: &str, valid: &str| format!("camera `{name}`: {what}; valid: {valid}");
        if !pose.position.is_finite() {
            return Err(wrong("its position is not finite", "three finite numbers"));
        }
        let [Some(direction), Some(up)] = [pose.direction, pose.up].map(|v| unit(v).filter(|unit| unit.is_finite()))
        else {
            return Err(wrong("its view or its up vector has no direction", "finite vectors whose length is not 0"));
        };
        if direction.cross(up).length() < LEAST_SINE {
            return Err(wrong("its up vector is parallel to its view", "another up vector"));
        }
        if !(pose.fov_y > 0.0 && pose.fov_y < std::f32::consts::PI) {
            return Err(wrong(&format!("a field of view of {} radians", pose.fov_y), "above 0 and below π, vertical"));
        }
        let camera = &mut self.cameras[index];
        (camera.position, camera.direction, camera.up, camera.fov_y) =
            (pose.position.as_dvec3(), direction, up, pose.fov_y);
        Ok(())
    }

    /// Index of a light by its name; case is ignored.
    ///
    /// # Errors
    /// If there is no such light; the message gives the nearest name and the valid ones.
    pub fn light(&self, name: &str) -> Result<usize, String> {
        find("light", name, self.lights.iter().map(|light| light.name.as_str()))
    }

    /// Sets the direction in which a light travels (of any length other than 0) and its linear colour, as if its file contained
    /// them. Of a spot light, `direction` is the axis of its cone. A point light has no direction, and keeps none.
    ///
    /// # Errors
    /// If there is no such light, the direction is 0 or not finite, or a component of the colour exceeds [`BRIGHTEST`] in absolute
    /// value; the project is then unchanged.
    pub fn set_light(&mut self, light: &str, direction: Vec3, color: Vec3) -> Result<(), String> {
        let index = self.light(light)?;
        let Light { name, .. } = &self.lights[index];
        let Some(direction) = unit(direction).filter(|unit| unit.is_finite()) else {
            return Err(format!(
                "light `{name}`: {direction} is no direction; valid: a finite vector whose length is not 0"
            ));
        };
        if !in_range(color) {
            return Err(format!(
                "light `{name}`: {color} is no colour; valid: three numbers, -{BRIGHTEST:e} to {BRIGHTEST:e}"
            ));
        }
        let light = &mut self.lights[index];
        light.color = color;
        match (&mut light.direction, &mut light.falloff.spot) {
            (Some(own), _) => *own = direction,
            (None, Some(spot)) => spot.axis = direction,
            (None, None) => {}
        }
        Ok(())
    }
}
