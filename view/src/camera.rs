//! Moving a camera.

use curitiba::pipeline::project::Pose;
use glam::{Quat, Vec3};

/// Least angle between the view and the up vector or its opposite, radians; below it, rounding errors dominate the picture's horizontal axis.
const LEAST_ANGLE: f32 = 0.02;

/// The bounding box of a scene, in world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Least coordinates.
    pub low: Vec3,
    /// Largest coordinates.
    pub high: Vec3,
}

impl Bounds {
    /// The bounding box of points; `None` if no point is finite.
    #[must_use]
    pub fn around<'a>(points: impl IntoIterator<Item = &'a Vec3>) -> Option<Self> {
        let finite = points.into_iter().filter(|point| point.is_finite());
        let all = finite.fold((Vec3::MAX, Vec3::MIN), |(low, high), point| (low.min(*point), high.max(*point)));
        (all.0.cmple(all.1).all()).then_some(Self { low: all.0, high: all.1 })
    }

    /// The centre of the box.
    #[must_use]
    pub fn center(&self) -> Vec3 {
        self.low.midpoint(self.high)
    }

    /// Half the diagonal of the box, at least 0.001.
    #[must_use]
    pub fn radius(&self) -> f32 {
        (0.5 * self.low.distance(self.high)).max(1e-3)
    }
}

/// The point ahead of a camera that it orbits: at the depth of the scene's centre, limited to 0.05 to 16 times the scene's radius.
#[must_use]
pub fn pivot(pose: &Pose, bounds: &Bounds) -> Vec3 {
    let direction = pose.direction.normalize();
    let ahead = (bounds.center() - pose.position).dot(direction);
    pose.position + direction * ahead.clamp(0.05 * bounds.radius(), 16.0 * bounds.radius())
}

/// The rotation of the view by angles in radians: to the right, and upwards, but not past the up vector.
fn turned(pose: &Pose, right: f32, up: f32) -> Quat {
    let (direction, axis) = (pose.direction.normalize(), pose.up.normalize());
    let now = direction.angle_between(axis);
    let least = LEAST_ANGLE.min(now).min(std::f32::consts::PI - now);
    let up = (now - up).clamp(least, std::f32::consts::PI - least) - now;
    let side = direction.cross(axis).normalize();
    Quat::from_axis_angle(axis, -right) * Quat::from_axis_angle(side, -up)
}

/// Rotates the view by radians to the right and upwards; the position stays.
#[must_use]
pub fn look(pose: &Pose, right: f32, up: f32) -> Pose {
    Pose { direction: (turned(pose, right, up) * pose.direction).normalize(), ..*pose }
}

/// Moves the camera around a point by radians to the right and upwards, and turns it by the same rotation.
#[must_use]
pub fn orbit(pose: &Pose, pivot: Vec3, right: f32, up: f32) -> Pose {
    let turn = turned(pose, right, up);
    let position = pivot + turn * (pose.position - pivot);
    Pose { position, direction: (turn * pose.direction).normalize(), ..*pose }
}

/// Moves by world units to the right, upwards and ahead.
#[must_use]
pub fn fly(pose: &Pose, by: Vec3) -> Pose {
    let direction = pose.direction.normalize();
    let side = direction.cross(pose.up).normalize_or_zero();
    let position = pose.position + side * by.x + pose.up.normalize() * by.y + direction * by.z;
    Pose { position, ..*pose }
}

/// Moves the camera, without turning it, so that it looks at the centre of the scene and sees all of it. `aspect` is the window's ratio of
/// width to height.
///
/// What lies beyond the far plane is not drawn. If the scene is too deep for the far plane, the camera stays nearer to the centre, so
/// that the far side of the scene is drawn; but not nearer than half the far distance.
#[must_use]
pub fn fit(pose: &Pose, bounds: &Bounds, aspect: f32, far: f32) -> Pose {
    let half = 0.5 * pose.fov_y;
    let narrow = if aspect < 1.0 { (half.tan() * aspect).atan() } else { half };
    let distance = bounds.radius() / narrow.sin().max(1e-3);
    let direction = pose.direction.normalize();
    let behind_center = 0.5 * (bounds.high - bounds.low).dot(direction.abs());
    let drawn = (far - behind_center).max(0.5 * far);
    Pose { position: bounds.center() - direction * distance.min(drawn), ..*pose }
}

#[cfg(test)]
mod tests {
    use super::*;

    const POSE: Pose = Pose { position: Vec3::new(0.0, 0.0, 10.0), direction: Vec3::NEG_Z, up: Vec3::Y, fov_y: 1.0 };
    const BOX: Bounds = Bounds { low: Vec3::NEG_ONE, high: Vec3::ONE };

    #[test]
    fn looking_to_the_right_and_up_turns_there_and_never_over_the_top() {
        let right = look(&POSE, std::f32::consts::FRAC_PI_2, 0.0);
        assert!((right.direction - Vec3::X).length() < 1e-6 && right.position == POSE.position);
        assert!((look(&POSE, 0.0, 0.3).direction.y - 0.3_f32.sin()).abs() < 1e-6);
        for up in [2.0, -2.0, 100.0] {
            let steep = look(&POSE, 0.0, up);
            assert!(steep.direction.cross(Vec3::Y).length() > 0.015 && steep.direction.y * up > 0.0, "{steep:?}");
        }
    }

    #[test]
    fn an_orbit_keeps_its_distance_and_its_centre_in_the_middle() {
        let middle = pivot(&POSE, &BOX);
        assert!(middle.length() < 1e-6);
        let moved = orbit(&POSE, middle, 0.7, -0.4);
        assert!((moved.position.length() - 10.0).abs() < 1e-4);
        assert!((moved.direction + moved.position.normalize()).length() < 1e-5, "it looks at the middle");
        assert!(moved.position.y > 3.0, "dragged down, it is seen from above");
    }

    #[test]
    fn flying_follows_the_view() {
        let moved = fly(&POSE, Vec3::new(1.0, 2.0, 3.0));
        assert!((moved.position - Vec3::new(1.0, 2.0, 7.0)).length() < 1e-6);
    }

    #[test]
    fn a_fitted_scene_is_inside_the_picture() {
        for aspect in [0.5, 1.0, 2.0] {
            let pose = fit(&POSE, &BOX, aspect, 100.0);
            let tangent = (0.5 * pose.fov_y).tan() * aspect.min(1.0);
            for corner in 0..8 {
                let sign = |bit: i32| if corner >> bit & 1 == 1 { 1.0 } else { -1.0 };
                let seen = Vec3::new(sign(0), sign(1), sign(2)) - pose.position;
                assert!(seen.x.abs().max(seen.y.abs()) <= -seen.z * tangent, "{aspect}: {seen}");
            }
        }
        // A far plane that just reaches the far side, and one that does not.
        assert_eq!(fit(&POSE, &BOX, 1.0, 4.0).position, Vec3::new(0.0, 0.0, 3.0));
        assert_eq!(fit(&POSE, &BOX, 1.0, 1.0).position, Vec3::new(0.0, 0.0, 0.5));
        assert_eq!(Bounds::around(&[Vec3::NAN]), None);
        assert_eq!(Bounds::around(&[Vec3::NEG_ONE, Vec3::INFINITY, Vec3::ONE]), Some(BOX));
    }
}
