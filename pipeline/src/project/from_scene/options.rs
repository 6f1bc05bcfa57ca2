//! Options of projects made from scene files.

use crate::diagnostic::valid_names;
use glam::{DVec3, Mat4, Vec3, Vec4};
use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

/// The effects of a project.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Effects {
    /// Shadows of the sun.
    pub shadows: bool,
    /// Ambient occlusion.
    pub occlusion: bool,
    /// Reflection and refraction in glass.
    pub glass: bool,
}

impl Effects {
    /// Names of the effects, in the order of the fields.
    pub const NAMES: [&'static str; 3] = ["shadows", "ao", "glass"];

    fn flags(&mut self) -> [&mut bool; 3] {
        [&mut self.shadows, &mut self.occlusion, &mut self.glass]
    }
}

impl FromStr for Effects {
    type Err = String;

    /// Parses `shadows,ao,glass` or a subset, separated by `,` or `+`; or `none`.
    fn from_str(text: &str) -> Result<Self, String> {
        let mut effects = Self::default();
        if text.trim() == "none" {
            return Ok(effects);
        }
        for word in text.split([',', '+']).map(str::trim) {
            let Some(index) = Self::NAMES.iter().position(|name| *name == word) else {
                return Err(valid_names(word, Self::NAMES.into_iter().chain(["none"])));
            };
            *effects.flags()[index] = true;
        }
        Ok(effects)
    }
}

impl fmt::Display for Effects {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut copy = *self;
        let on: Vec<&str> =
            copy.flags().into_iter().zip(Self::NAMES).filter(|(on, _)| **on).map(|(_, name)| name).collect();
        f.write_str(&if on.is_empty() { "none".to_owned() } else { on.join("+") })
    }
}

/// The axis of a scene file that points up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Up {
    /// y, as in glTF and most OBJ files.
    #[default]
    Y,
    /// z, as in many files of CAD programs and of 3D Studio. The scene is rotated: new y = z, new z = -y.
    Z,
}

impl Up {
    /// The rotation that makes y point up.
    pub(super) fn turn(self) -> Mat4 {
        match self {
            Self::Y => Mat4::IDENTITY,
            Self::Z => Mat4::from_cols(Vec4::X, Vec4::NEG_Z, Vec4::Y, Vec4::W),
        }
    }
}

impl FromStr for Up {
    type Err = String;

    /// Parses `y` or `z`.
    fn from_str(text: &str) -> Result<Self, String> {
        match text.trim() {
            "y" | "Y" => Ok(Self::Y),
            "z" | "Z" => Ok(Self::Z),
            other => Err(valid_names(other, ["y", "z"])),
        }
    }
}

/// Options of a project made from scene files. A value of `None` is chosen from the scene.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SceneOptions {
    /// Further scene files, in addition to the first.
    pub more: Vec<PathBuf>,
    /// The effects. Default: shadows, occlusion, and glass if a drawn material is glass.
    pub effects: Option<Effects>,
    /// Position of the camera, world. Default: a position that shows the whole focus (the scene, or most of it), or one inside the
    /// shell around the focus.
    pub look_from: Option<DVec3>,
    /// Point that the camera looks at, world. Default: the centre of the focus, rounded.
    pub look_at: Option<DVec3>,
    /// Vertical field of view, degrees, above 0 and below 180. Default: 45.
    pub fov: Option<f32>,
    /// Direction towards the sun, of any length. Default: the files' own lights, or a sun behind the viewer's left shoulder.
    pub sun: Option<Vec3>,
    /// The upward axis of the files.
    pub up: Up,
    /// Colour of the background, display values. Default: a light blue grey.
    pub background: Option<Vec3>,
}

impl SceneOptions {
    /// The options that are set, each with its name and its value as on the command line and in `compare`. [`Self::more`] is not among them.
    #[must_use]
    pub fn given(&self) -> Vec<(&'static str, String)> {
        let vector = |Vec3 { x, y, z }: Vec3| format!("{x}/{y}/{z}");
        let point = |DVec3 { x, y, z }: DVec3| format!("{x}/{y}/{z}");
        let given = [
            ("effects", self.effects.map(|effects| effects.to_string())),
            ("look-from", self.look_from.map(point)),
            ("look-at", self.look_at.map(point)),
            ("fov", self.fov.map(|fov| fov.to_string())),
            ("sun", self.sun.map(vector)),
            ("up", (self.up == Up::Z).then(|| "z".to_owned())),
            ("background", self.background.map(vector)),
        ];
        given.into_iter().filter_map(|(name, value)| Some((name, value?))).collect()
    }

    /// The options that are set and the further files, as words such as `effects=shadows+ao` and `with b.obj`.
    #[must_use]
    pub fn words(&self) -> Vec<String> {
        let given = self.given().into_iter().map(|(name, value)| format!("{name}={value}"));
        let more = self.more.iter().map(|path| format!("with {}", path.display()));
        given.chain(more).collect()
    }

    /// Whether the camera is described, so that none of the file's cameras is the default.
    #[must_use]
    pub fn has_camera(&self) -> bool {
        self.look_from.is_some() || self.look_at.is_some() || self.fov.is_some()
    }

    /// Parses three numbers separated by `,` or `/`, finite in `f32`.
    ///
    /// # Errors
    /// A message that says what would be valid.
    pub fn parse_vector(text: &str) -> Result<Vec3, String> {
        three(text, |number: &f32| number.is_finite()).map(Vec3::from)
    }

    /// [`Self::parse_vector`] in `f64`: positions in map coordinates have more digits than `f32` holds.
    ///
    /// # Errors
    /// A message that says what would be valid.
    pub fn parse_point(text: &str) -> Result<DVec3, String> {
        three(text, |number: &f64| (*number as f32).is_finite()).map(DVec3::from)
    }

    /// Parses a vector that is not 0.
    ///
    /// # Errors
    /// A message that says what would be valid.
    pub fn parse_direction(text: &str) -> Result<Vec3, String> {
        Self::parse_vector(text).and_then(|vector| match vector.as_dvec3().try_normalize() {
            Some(_) => Ok(vector),
            None => Err(format!("`{text}` has no direction: its length is 0")),
        })
    }

    /// Parses `R,G,B` from 0 to 1, or `#rrggbb`.
    ///
    /// # Errors
    /// A message that says what would be valid.
    pub fn parse_color(text: &str) -> Result<Vec3, String> {
        let wrong = || format!("`{text}` is not R,G,B from 0 to 1, nor #rrggbb, such as 0.6,0.7,0.8 or #99b2cc");
        if let Some(digits) = text.strip_prefix('#') {
            let value = u32::from_str_radix(digits, 16).ok().filter(|_| digits.len() == 6 && !digits.starts_with('+'));
            let [_, r, g, b] = value.ok_or_else(wrong)?.to_be_bytes();
            return Ok(Vec3::new(f32::from(r), f32::from(g), f32::from(b)) / 255.0);
        }
        let color = Self::parse_vector(text).map_err(|_| wrong())?;
        let valid = color.cmpge(Vec3::ZERO).all() && color.cmple(Vec3::ONE).all();
        if valid { Ok(color) } else { Err(wrong()) }
    }

    /// Parses a vertical field of view in degrees.
    ///
    /// # Errors
    /// A message that says what would be valid.
    pub fn parse_fov(text: &str) -> Result<f32, String> {
        let degrees: Option<f32> = text.trim().parse().ok().filter(|degrees| *degrees > 0.0 && *degrees < 180.0);
        degrees.ok_or_else(|| format!("`{text}` is no angle above 0 and below 180 degrees"))
    }
}

fn three<T: Copy + FromStr>(text: &str, valid: impl Fn(&T) -> bool) -> Result<[T; 3], String> {
    let numbers: Vec<T> = text.split([',', '/']).map_while(|word| word.trim().parse().ok()).filter(valid).collect();
    match (&numbers[..], text.split([',', '/']).count()) {
        (&[x, y, z], 3) => Ok([x, y, z]),
        _ => Err(format!("`{text}` is not X,Y,Z, such as 1,2.5,-3")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_read_as_they_are_written() {
        let effects = |text: &str| text.parse::<Effects>();
        let some = Effects { shadows: true, occlusion: false, glass: true };
        assert_eq!(effects("glass,shadows"), Ok(some));
        assert_eq!(effects(&some.to_string()), Ok(some));
        assert_eq!(effects("none"), Ok(Effects::default()));
        assert!(effects("shadow").expect_err("a typing error").contains("did you mean `shadows`?"));
        assert!(effects("").is_err());
        assert_eq!(SceneOptions::parse_vector("1, -2/.5"), Ok(Vec3::new(1.0, -2.0, 0.5)));
        assert_eq!(SceneOptions::parse_point("5000000.3, -2/.5"), Ok(DVec3::new(5_000_000.3, -2.0, 0.5)));
        assert!(SceneOptions::parse_point("1e39,0,0").is_err());
        for wrong in ["", "1,2", "1,2,3,4", "1,2,x", "1,2,inf", "nan,0,0"] {
            assert!(SceneOptions::parse_vector(wrong).is_err(), "{wrong}");
            assert!(SceneOptions::parse_point(wrong).is_err(), "{wrong}");
        }
        assert_eq!(SceneOptions::parse_color("#ff0080").map(|c| (c * 255.0).round()), Ok(Vec3::new(255.0, 0.0, 128.0)));
        for wrong in ["#ff00", "#ff00é", "1,0,2", "-0.1,0,0", "#+12345"] {
            assert!(SceneOptions::parse_color(wrong).is_err(), "{wrong}");
        }
        assert!(SceneOptions::parse_direction("0,0,0").is_err() && SceneOptions::parse_direction("0,1e-20,0").is_ok());
        assert!(SceneOptions::parse_fov("180").is_err() && SceneOptions::parse_fov("0").is_err());
        assert_eq!(SceneOptions::parse_fov("60"), Ok(60.0));
        assert_eq!(["y", "Z"].map(str::parse::<Up>), [Ok(Up::Y), Ok(Up::Z)]);
        assert!("x".parse::<Up>().is_err());
    }
}
