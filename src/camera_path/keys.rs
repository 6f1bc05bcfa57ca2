//! Paths through keyframes.

use super::MOST_FRAMES;
use super::curve::{angle, hermite, slerp, tangent};
use crate::pipeline::project::Pose;
use glam::DVec3;
use serde::Deserialize;
use std::f64::consts::PI;

/// Least angle in radians between the direction of a key and the opposite of the previous key's direction. The same holds for up vectors.
/// Between opposite vectors the shortest great circle is not unique.
const LEAST_ANGLE: f64 = 1e-4;

/// A path through keyframes.
#[derive(Debug, Clone, PartialEq)]
pub struct Keyframes {
    /// The camera that is moved, if the file names one.
    pub camera: Option<String>,
    /// At least 2 keys; their frames start at 0 and increase.
    keys: Vec<Key>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Key {
    frame: u32,
    position: DVec3,
    /// Unit viewing direction.
    direction: DVec3,
    /// Unit up vector; `None` for the camera's own.
    up: Option<DVec3>,
    /// Vertical field of view, radians; `None` for the camera's own.
    fov_y: Option<f64>,
}

/// The contents of a file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    camera: Option<String>,
    keys: Vec<FileKey>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FileKey {
    frame: u32,
    position: [f64; 3],
    direction: Option<[f64; 3]>,
    look_at: Option<[f64; 3]>,
    up: Option<[f64; 3]>,
    fov: Option<f64>,
}

impl Keyframes {
    /// Parses the text of a file. An error names the field.
    pub(super) fn parse(text: &[u8]) -> Result<Self, String> {
        let file: File = serde_json::from_slice(text).map_err(|error| error.to_string())?;
        let at = |index: usize, message: String| format!("keys[{index}].{message}");
        let mut keys: Vec<Key> = Vec::new();
        for (index, found) in file.keys.iter().enumerate() {
            let key = found.key().map_err(|message| at(index, message))?;
            match keys.last() {
                None if key.frame != 0 => return Err(at(index, "frame: the first key is that of frame 0".to_owned())),
                Some(last) if key.frame <= last.frame => {
                    return Err(at(index, format!("frame: {} does not come after {}", key.frame, last.frame)));
                }
                Some(last) if PI - angle(last.direction, key.direction) < LEAST_ANGLE => {
                    return Err(at(index, "direction: it is opposite to the one before; put a key between".to_owned()));
                }
                Some(last) if last.up.is_some() != key.up.is_some() => {
                    return Err(at(index, "up: either every key has one, or none".to_owned()));
                }
                Some(Key { up: Some(up), .. }) if key.up.is_some_and(|other| PI - angle(*up, other) < LEAST_ANGLE) => {
                    return Err(at(index, "up: it is opposite to the one before; put a key between".to_owned()));
                }
                _ => keys.push(key),
            }
        }
        if keys.len() < 2 {
            return Err(format!("keys: these are {}; valid: at least 2", keys.len()));
        }
        Ok(Self { camera: file.camera, keys })
    }

    /// Number of frames: the last key's frame plus one.
    pub(super) fn frames(&self) -> u32 {
        self.keys.last().map_or(0, |key| key.frame + 1)
    }

    pub(super) fn pose(&self, frame: u32, own: Pose) -> Pose {
        let next = self.keys.partition_point(|key| key.frame <= frame).clamp(1, self.keys.len() - 1);
        let (from, to) = (&self.keys[next - 1], &self.keys[next]);
        let at = |index: usize| {
            let key = &self.keys[index.min(self.keys.len() - 1)];
            (f64::from(key.frame), key.position)
        };
        let span = f64::from(to.frame - from.frame);
        let u = f64::from(frame.min(to.frame) - from.frame) / span;
        let leaving = tangent(at((next - 1).saturating_sub(1)), at(next)) * span;
        let arriving = tangent(at(next - 1), at(next + 1)) * span;
        let position = hermite(from.position, leaving, to.position, arriving, u);
        let fov = |key: &Key| key.fov_y.unwrap_or(f64::from(own.fov_y));
        let up = from.up.zip(to.up).map_or(own.up, |(from, to)| slerp(from, to, u).as_vec3());
        Pose {
            position: position.as_vec3(),
            direction: slerp(from.direction, to.direction, u).as_vec3(),
            up,
            fov_y: (fov(from) + (fov(to) - fov(from)) * u) as f32,
        }
    }
}

impl FileKey {
    fn key(&self) -> Result<Key, String> {
        let finite = |name: &str, numbers: [f64; 3]| {
            let fits = numbers.iter().all(|number| number.abs() <= f64::from(f32::MAX));
            fits.then(|| DVec3::from_array(numbers)).ok_or_else(|| format!("{name}: valid: three finite numbers"))
        };
        let unit = |name: &str, vector: DVec3| {
            vector.try_normalize().ok_or_else(|| format!("{name}: it has no direction; valid: a length that is not 0"))
        };
        if self.frame >= MOST_FRAMES {
            return Err(format!("frame: {}; valid: below {MOST_FRAMES}", self.frame));
        }
        let position = finite("position", self.position)?;
        let direction = match (self.direction, self.look_at) {
            (Some(direction), None) => unit("direction", finite("direction", direction)?)?,
            (None, Some(point)) => unit("look_at", finite("look_at", point)? - position)?,
            (Some(_), Some(_)) => return Err("look_at: there is a direction too; leave one of the two out".to_owned()),
            (None, None) => return Err("direction: it is missing; write direction or look_at".to_owned()),
        };
        let up = self.up.map(|up| unit("up", finite("up", up)?)).transpose()?;
        if let Some(fov) = self.fov.filter(|fov| !(*fov > 0.0 && *fov < 180.0)) {
            return Err(format!("fov: {fov}; valid: degrees above 0 and below 180"));
        }
        Ok(Key { frame: self.frame, position, direction, up, fov_y: self.fov.map(f64::to_radians) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    const OWN: Pose = Pose { position: Vec3::ZERO, direction: Vec3::NEG_Z, up: Vec3::Y, fov_y: 1.25 };

    fn keys(text: &str) -> Keyframes {
        Keyframes::parse(text.as_bytes()).unwrap_or_else(|error| panic!("{error}"))
    }

    #[test]
    fn keys_are_met_exactly_and_what_they_leave_out_is_the_cameras_own() {
        let path = keys(
            r#"{"camera": "Main", "keys": [
                {"frame": 0, "position": [0, 2, 9], "look_at": [0, 2, 0]},
                {"frame": 10, "position": [4.5, 2, 9], "direction": [0, 0, -3]},
                {"frame": 12, "position": [9, 3, 1], "look_at": [0, 3, 1], "fov": 90}]}"#,
        );
        assert_eq!((path.frames(), path.camera.as_deref()), (13, Some("Main")));
        assert_eq!(path.pose(0, OWN), Pose { position: Vec3::new(0.0, 2.0, 9.0), ..OWN });
        assert_eq!(path.pose(10, OWN), Pose { position: Vec3::new(4.5, 2.0, 9.0), ..OWN });
        let last = path.pose(12, OWN);
        assert_eq!((last.position, last.direction), (Vec3::new(9.0, 3.0, 1.0), Vec3::NEG_X));
        assert!((last.fov_y - 90.0_f32.to_radians()).abs() < 1e-6 && last.up == OWN.up);
        let between = path.pose(11, OWN);
        assert!(between.fov_y > OWN.fov_y && between.fov_y < last.fov_y);
        assert!((between.direction.length() - 1.0).abs() < 1e-6 && between.direction.x < -0.7);
        let tilted = keys(
            r#"{"keys": [{"frame": 0, "position": [0,0,0], "direction": [0,0,-1], "up": [0,2,0]},
                {"frame": 2, "position": [1,0,0], "direction": [0,0,-1], "up": [3,0,0]}]}"#,
        );
        assert!((tilted.pose(1, OWN).up - Vec3::new(0.5, 0.5, 0.0) * 2.0_f32.sqrt()).length() < 1e-6);
    }

    #[test]
    fn an_even_line_is_kept_and_speed_does_not_jump_at_a_key() {
        let line = keys(
            r#"{"keys": [{"frame": 0, "position": [0,0,0], "direction": [0,0,-1]}, {"frame": 4, "position": [4,0,0], "direction": [0,0,-1]},
                {"frame": 10, "position": [10,0,0], "direction": [0,0,-1]}]}"#,
        );
        for frame in 0..=10 {
            assert!((line.pose(frame, OWN).position - Vec3::X * frame as f32).length() < 1e-6, "{frame}");
        }
        let bend = keys(
            r#"{"keys": [{"frame": 0, "position": [0,0,0], "direction": [0,0,-1]}, {"frame": 1000, "position": [7,5,0], "direction": [0,0,-1]},
                {"frame": 1500, "position": [9,-3,4], "direction": [0,0,-1]}, {"frame": 4000, "position": [0,0,0], "direction": [0,0,-1]}]}"#,
        );
        let at = |frame: u32| bend.pose(frame, OWN).position.as_dvec3();
        for key in [1000, 1500] {
            let (before, after) = (at(key) - at(key - 1), at(key + 1) - at(key));
            // The intervals before and after the key are 1000 and 500 frames long, or 500 and 2500. If tangents ignored these
            // lengths, the speed would jump at the key by their ratio.
            assert!((before - after).length() < 0.1 * before.length(), "{before} {after}");
        }
    }

    #[test]
    fn mistakes_name_their_field() {
        let two = |first: &str, second: &str| format!(r#"{{"keys": [{{"frame": 0, {first}}}, {{{second}}}]}}"#);
        let good = r#""position": [0,0,0], "direction": [0,0,-1]"#;
        let next = format!(r#""frame": 5, {good}"#);
        for (text, word) in [
            ("".to_owned(), "line 1"),
            ("{}".to_owned(), "missing field `keys`"),
            (r#"{"keys": []}"#.to_owned(), "keys: these are 0"),
            (r#"{"keys": [], "speed": 1}"#.to_owned(), "unknown field `speed`"),
            (two(good, good), "missing field `frame`"),
            (two(good, &format!(r#""frame": 0, {good}"#)), "keys[1].frame: 0 does not come after 0"),
            (two(good, &format!(r#""frame": 1000000, {good}"#)), "keys[1].frame: 1000000"),
            (two(r#""position": [0,0,0]"#, &next), "keys[0].direction: it is missing"),
            (two(r#""position": [0,0,0], "look_at": [0,0,0]"#, &next), "keys[0].look_at: it has no direction"),
            (two(r#""position": [0,0,0], "direction": [0,0,1]"#, &next), "keys[1].direction: it is opposite"),
            (two(good, &format!(r#"{next}, "up": [0,1,0]"#)), "keys[1].up: either every key"),
            (two(r#""position": [0,0,1e39], "direction": [0,0,1]"#, &next), "keys[0].position"),
            (two(&format!(r#"{good}, "fov": 180"#), &next), "keys[0].fov: 180"),
            (two(&format!(r#"{good}, "look_at": [1,1,1]"#), &next), "leave one of the two out"),
        ] {
            let error = Keyframes::parse(text.as_bytes()).expect_err(&text);
            assert!(error.contains(word), "{text}: {error}");
        }
    }
}
