//! A circle around a point.

use super::MOST_FRAMES;
use crate::pipeline::project::Pose;
use glam::{DVec3, Vec3};
use std::f64::consts::TAU;

/// A camera that circles a point once, at an even pace, and looks at it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Orbit {
    /// The point, world.
    pub center: DVec3,
    /// Distance of the camera from the point, world units, above 0.
    pub radius: f64,
    /// Number of frames of the whole turn: 1 to [`MOST_FRAMES`].
    pub frames: u32,
    /// Elevation of the camera above the centre, degrees, between -90 and 90.
    pub elevation: f64,
}

impl Orbit {
    /// Parses `CX,CY,CZ,R,N` or `CX,CY,CZ,R,N,ELEVATION`: centre, radius, number of frames, elevation in degrees.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let wrong = |what: &str| {
            format!(
                "`orbit:{text}`: {what}; valid: orbit:CX,CY,CZ,R,N with a centre, a radius above 0 and 1 to {MOST_FRAMES} frames, \
                 and ,ELEVATION in degrees between -90 and 90, such as orbit:0,2,0,12,120,20"
            )
        };
        let words: Vec<&str> = text.split(',').map(str::trim).collect();
        if !matches!(words.len(), 5 | 6) {
            return Err(wrong(&format!("these are {} numbers", words.len())));
        }
        let number = |index: usize| {
            let value = words[index].parse::<f64>().ok().filter(|value: &f64| value.abs() <= f64::from(f32::MAX));
            value.ok_or_else(|| wrong(&format!("`{}` is no number", words[index])))
        };
        let center = DVec3::new(number(0)?, number(1)?, number(2)?);
        let (radius, elevation) = (number(3)?, if words.len() == 6 { number(5)? } else { 0.0 });
        let frames = words[4].parse::<u32>().ok().filter(|frames| (1..=MOST_FRAMES).contains(frames));
        let frames = frames.ok_or_else(|| wrong(&format!("`{}` is no number of frames", words[4])))?;
        if radius <= 0.0 {
            return Err(wrong(&format!("the radius is {radius}")));
        }
        if elevation.abs() >= 90.0 {
            return Err(wrong(&format!("the elevation is {elevation}")));
        }
        Ok(Self { center, radius, frames, elevation })
    }

    /// The circle's axis is the positive or negative world axis nearest to the camera's own up vector; this axis is also the up vector of every
    /// frame. At elevation 0, frame 0 looks against the cyclically next positive axis (with y up, towards -z). The camera then moves towards the
    /// positive axis after that, or away from it if the circle's axis is a negative one.
    pub(super) fn pose(&self, frame: u32, own: Pose) -> Pose {
        let up = axis(own.up);
        let first = DVec3::new(up.z, up.x, up.y).abs();
        let second = up.cross(first);
        let turn = TAU * f64::from(frame) / f64::from(self.frames);
        let height = self.elevation.to_radians();
        let outwards = (first * turn.cos() + second * turn.sin()) * height.cos() + up * height.sin();
        let position = self.center + outwards * self.radius;
        Pose { position: position.as_vec3(), direction: (-outwards).as_vec3(), up: up.as_vec3(), fov_y: own.fov_y }
    }
}

/// The axis (positive or negative) that is nearest to a vector.
fn axis(vector: Vec3) -> DVec3 {
    let size = vector.abs();
    if size.y >= size.x && size.y >= size.z {
        DVec3::Y.copysign(vector.as_dvec3()) * DVec3::Y
    } else if size.z >= size.x {
        DVec3::Z.copysign(vector.as_dvec3()) * DVec3::Z
    } else {
        DVec3::X.copysign(vector.as_dvec3()) * DVec3::X
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn own(up: Vec3) -> Pose {
        Pose { position: Vec3::ZERO, direction: Vec3::X, up, fov_y: 1.0 }
    }

    #[test]
    fn every_frame_looks_at_the_centre_from_the_radius_and_one_turn_closes() {
        for up in [Vec3::Y, Vec3::new(0.1, -0.9, 0.2), Vec3::Z, Vec3::X, -Vec3::Z] {
            let orbit = Orbit::parse("1,2,-3,12.5,7,20").expect("valid");
            let poses: Vec<Pose> = (0..7).map(|frame| orbit.pose(frame, own(up))).collect();
            for pose in &poses {
                let towards = orbit.center - pose.position.as_dvec3();
                assert!((towards.length() - 12.5).abs() < 1e-5, "{pose:?}");
                assert!((towards.normalize() - pose.direction.as_dvec3()).length() < 1e-6, "{pose:?}");
                // The camera is 20 degrees above the centre, as seen with the camera's own up vector.
                let sine = -f64::from(pose.direction.dot(pose.up));
                assert!((sine - 20.0_f64.to_radians().sin()).abs() < 1e-6 && pose.up.dot(up) > 0.0, "{pose:?}");
            }
            let step = |a: &Pose, b: &Pose| f64::from(a.position.distance(b.position));
            for index in 0..7 {
                let even = step(&poses[index], &poses[(index + 1) % 7]) - step(&poses[0], &poses[1]);
                assert!(even.abs() < 1e-5, "frame {index} is {even} off");
            }
        }
        let first = Orbit::parse("0,0,0,2,4").expect("valid");
        assert_eq!(first.pose(0, own(Vec3::Y)).direction, -Vec3::Z);
    }

    #[test]
    fn mistakes_say_what_is_valid() {
        for (text, word) in [
            ("0,0,0,1", "4 numbers"),
            ("0,0,0,0,8", "the radius is 0"),
            ("0,0,0,-1,8", "the radius is -1"),
            ("0,0,0,1,0", "`0` is no number of frames"),
            ("0,0,0,1,1000001", "no number of frames"),
            ("0,0,x,1,8", "`x` is no number"),
            ("0,0,nan,1,8", "`nan` is no number"),
            ("0,0,0,inf,8", "`inf` is no number"),
            ("0,0,0,1,8,90", "the elevation is 90"),
            ("", "1 numbers"),
        ] {
            let error = Orbit::parse(text).expect_err(text);
            assert!(error.contains(word) && error.contains("orbit:CX,CY,CZ,R,N"), "{error}");
        }
    }
}
