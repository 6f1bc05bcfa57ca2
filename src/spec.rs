//! `project.xml@setting,setting`: a project with settings, in one word of a command line.

use crate::passes::raster::gpu;
use crate::pipeline::color::ColorSpace;
use crate::pipeline::diagnostic::valid_names;
use crate::pipeline::plan::Settings;
use crate::pipeline::programs::Fidelity;
use crate::pipeline::project::{SCENE_EXTENSIONS, SceneOptions, names_scenes};
use crate::{BackendChoice, Choice, RasterChoice};
use std::fmt;
use std::path::{Path, PathBuf};

/// Names of the settings, with the valid values; the last ones are `PASS.NAME=VALUE` and `TEXTURE.format=FORMAT`.
pub const SETTINGS: &[(&str, &str)] = &[
    ("raster", "auto, cpu or wgpu: what draws"),
    ("backend", "auto, cpu, wgpu, cuda or optix: what traces rays"),
    ("gpus", "N or all: the GPUs of cuda and optix"),
    ("adapter", "NAME or place of the device of wgpu, for rasteriser and rays; `curitiba list` has them"),
    ("fidelity", "corrected or thesis: the report's programs mended, or as written"),
    ("color", "report or linear: colours as stored, or decoded from sRGB and shaded in linear light"),
    ("camera", "NAME of a camera of the project"),
    ("size", "WIDTHxHEIGHT of the window"),
    ("seed", "N, of the random numbers"),
    ("aa", "N or N:TOLERANCE, samples of every pixel: 1, 2, 4, 8, 16, 32 or 64"),
    ("pipeline", "NAME of a pipeline of the project"),
    ("reference", "picture: what `curitiba reference` made of the project is taken, and nothing is rendered"),
    ("effects", "of scene files: shadows, ao, glass with + between, or none"),
    ("look-from", "of scene files: X/Y/Z, where the camera stands"),
    ("look-at", "of scene files: X/Y/Z, what it looks at"),
    ("fov", "of scene files: DEGREES, vertical"),
    ("sun", "of scene files: X/Y/Z, the direction in which the sun stands"),
    ("up", "of scene files: y or z, the axis that points up"),
    ("background", "of scene files: R/G/B from 0 to 1, or #rrggbb"),
    ("PASS.NAME", "VALUE of a parameter of a pass"),
    ("TEXTURE.format", "RGBA32F, RGBA16F, RGBA8, R32F or R8: how a render target stores it"),
];

const FIDELITIES: [(&str, Fidelity); 2] = [("corrected", Fidelity::Corrected), ("thesis", Fidelity::Thesis)];

/// A project file, or scene files to make one from, with settings that differ from the defaults.
#[derive(Debug, Clone)]
pub struct Spec {
    /// The project file, scene file or folder.
    pub project: PathBuf,
    /// The settings of the plan.
    pub settings: Settings,
    /// The choice of engines.
    pub choice: Choice,
    /// Whether the stored reference of the project's picture is meant, instead of a rendered picture.
    pub is_reference: bool,
}

/// An error in the text of a [`Spec`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SpecError {
    /// The whole text.
    pub text: String,
    /// Position of the error in characters, from 1.
    pub position: usize,
    /// What is wrong there.
    pub message: String,
    /// What would be valid.
    pub help: String,
}

impl fmt::Display for SpecError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let indent = " ".repeat(7 + self.position.saturating_sub(1));
        write!(f, "{} at character {}\n       {}\n{indent}^\n", self.message, self.position, self.text)?;
        write!(f, "       {}", self.help)
    }
}

impl std::error::Error for SpecError {}

impl Spec {
    /// Whether a text names a project, a scene file or a folder of scene files: `x.xml`, `x.xml@` or `x.xml@setting`.
    #[must_use]
    pub fn is_project(text: &str) -> bool {
        let path = Path::new(split(text).0);
        path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("xml")) || names_scenes(path)
    }

    /// Parses `project.xml@setting,setting`. Settings that are not given have the project's values, so `project.xml@` and
    /// `project.xml` mean the same. Names of cameras, pipelines and passes are checked only when the project is opened.
    ///
    /// # Errors
    /// At the first setting that is unknown, repeated, or has an invalid value.
    pub fn parse(text: &str) -> Result<Self, SpecError> {
        let (project, settings) = split(text);
        let error = |offset: usize, message: String, help: String| SpecError {
            text: text.to_owned(),
            position: text[..offset].chars().count() + 1,
            message,
            help,
        };
        if project.is_empty() {
            let help = "write PROJECT.xml@SETTING,SETTING".to_owned();
            return Err(error(0, "there is no project file".to_owned(), help));
        }
        let mut spec = Self {
            project: project.into(),
            settings: Settings::default(),
            choice: Choice::default(),
            is_reference: false,
        };
        let mut given: Vec<&str> = Vec::new();
        let mut offset = project.len() + 1;
        for setting in settings.into_iter().filter(|settings| !settings.is_empty()).flat_map(|all| all.split(',')) {
            let (key, value) = setting.split_once('=').ok_or_else(|| {
                let message = format!("`{setting}` is not NAME=VALUE");
                error(offset, message, valid_names(setting, SETTINGS.iter().map(|(name, _)| *name)))
            })?;
            if given.contains(&key) {
                let message = format!("`{key}` is set twice");
                return Err(error(offset, message, "leave one of the two out".to_owned()));
            }
            given.push(key);
            spec.set(key, value).map_err(|(in_value, message, help)| {
                error(if in_value { offset + key.len() + 1 } else { offset }, message, help)
            })?;
            offset += setting.len() + 1;
        }
        Ok(spec)
    }

    /// Sets a value. The error contains whether the value (not the key) is wrong, a message, and what is valid.
    fn set(&mut self, key: &str, value: &str) -> Result<(), (bool, String, String)> {
        if value.is_empty() {
            let help = format!("write {key}=VALUE, or leave it out for the project's own");
            return Err((true, format!("`{key}` has no value"), help));
        }
        match key {
            "raster" => self.choice.raster = named(key, value, &RasterChoice::NAMES)?,
            "backend" => self.choice.backend = named(key, value, &BackendChoice::NAMES)?,
            "gpus" => {
                let help = "valid: 1 to 255, or all".to_owned();
                self.choice.gpus =
                    value.parse().map_err(|_| (true, format!("`{value}` is no number of GPUs"), help))?;
            }
            "adapter" => {
                let place = gpu::named(value).map_err(|help| in_value(key, value, help))?;
                self.choice.adapter = Some(place);
            }
            "fidelity" => self.settings.fidelity = named(key, value, &FIDELITIES)?,
            "color" => self.settings.color = Some(named(key, value, ColorSpace::NAMED)?),
            "camera" => self.settings.camera = Some(value.to_owned()),
            "pipeline" => self.settings.pipeline = Some(value.to_owned()),
            "reference" => self.is_reference = named(key, value, &[("picture", true)])?,
            "seed" => {
                let help = format!("valid: 0 to {}", u32::MAX);
                self.settings.seed = value.parse().map_err(|_| (true, format!("`{value}` is no seed"), help))?;
            }
            "aa" => self.settings.aa = value.parse().map_err(|help| in_value(key, value, help))?,
            "size" => {
                let sides = value.split_once(['x', 'X']);
                let sides = sides.and_then(|(width, height)| Some([width.parse().ok()?, height.parse().ok()?]));
                let wrong =
                    || (true, format!("`{value}` is no size"), "valid: WIDTHxHEIGHT, such as 512x512".to_owned());
                self.settings.size = Some(sides.ok_or_else(wrong)?);
            }
            "effects" => {
                self.settings.scene.effects = Some(value.parse().map_err(|help| in_value(key, value, help))?);
            }
            "look-from" | "look-at" => {
                let point = Some(SceneOptions::parse_point(value).map_err(|help| in_value(key, value, help))?);
                let scene = &mut self.settings.scene;
                *(if key == "look-at" { &mut scene.look_at } else { &mut scene.look_from }) = point;
            }
            "sun" => {
                let direction = SceneOptions::parse_direction(value).map_err(|help| in_value(key, value, help))?;
                self.settings.scene.sun = Some(direction);
            }
            "fov" => {
                self.settings.scene.fov =
                    Some(SceneOptions::parse_fov(value).map_err(|help| in_value(key, value, help))?);
            }
            "up" => self.settings.scene.up = value.parse().map_err(|help| in_value(key, value, help))?,
            "background" => {
                let color = SceneOptions::parse_color(value).map_err(|help| in_value(key, value, help))?;
                self.settings.scene.background = Some(color);
            }
            _ if key.rsplit_once('.').is_some_and(|(pass, name)| !pass.is_empty() && !name.is_empty()) => {
                self.settings.set.push(format!("{key}={value}"));
            }
            _ => {
                let help = valid_names(key, SETTINGS.iter().map(|(name, _)| *name));
                return Err((false, format!("there is no setting `{key}`"), help));
            }
        }
        Ok(())
    }
}

/// The error for a value that its parser rejected.
fn in_value(key: &str, value: &str, help: String) -> (bool, String, String) {
    (true, format!("`{value}` is no value of `{key}`"), help)
}

fn named<T: Copy>(key: &str, value: &str, valid: &[(&str, T)]) -> Result<T, (bool, String, String)> {
    valid.iter().find(|(name, _)| *name == value).map(|(_, choice)| *choice).ok_or_else(|| {
        let help = valid_names(value, valid.iter().map(|(name, _)| *name));
        (true, format!("`{value}` is no value of `{key}`"), help)
    })
}

/// Splits at the first `@` that follows `.xml` or a scene extension, since names of folders may contain `@`; otherwise at the last `@`. A text
/// that ends with such an extension, or names a folder, is not split.
fn split(text: &str) -> (&str, Option<&str>) {
    let lower = text.to_ascii_lowercase();
    let extensions = || ["xml"].into_iter().chain(SCENE_EXTENSIONS).map(|extension| format!(".{extension}"));
    let at = extensions().filter_map(|end| Some(lower.find(&format!("{end}@"))? + end.len())).min();
    let whole = || extensions().any(|end| lower.ends_with(&end)) || Path::new(text).is_dir();
    let at = at.or_else(|| if whole() { None } else { text.rfind('@') });
    at.map_or((text, None), |at| (&text[..at], Some(&text[at + 1..])))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Gpus;

    #[test]
    fn every_setting_is_read() {
        let text = "a@b/p.xml@raster=wgpu,backend=cpu,gpus=2,fidelity=thesis,color=linear,camera=Vidro é,size=64x32,seed=7,aa=16,pipeline=x,pass2.samples=4,pass2.sampler=strata";
        let spec = Spec::parse(text).expect("valid");
        assert_eq!(spec.project, Path::new("a@b/p.xml"));
        assert_eq!(spec.choice, Choice { raster: RasterChoice::Wgpu, gpus: Gpus::Count(2), ..Choice::CPU });
        let settings = spec.settings;
        assert_eq!((settings.fidelity, settings.seed, settings.size), (Fidelity::Thesis, 7, Some([64, 32])));
        assert_eq!((settings.color, settings.aa.count()), (Some(ColorSpace::Linear), 16));
        assert_eq!((settings.camera.as_deref(), settings.pipeline.as_deref()), (Some("Vidro é"), Some("x")));
        assert_eq!(settings.set, ["pass2.samples=4", "pass2.sampler=strata"]);
        assert!(!spec.is_reference && Spec::parse("p.xml@reference=picture").expect("valid").is_reference);
    }

    #[test]
    fn a_project_alone_has_its_defaults() {
        for text in ["p.xml@", "p.xml", "P.XML@"] {
            let spec = Spec::parse(text).expect("valid");
            assert!(Spec::is_project(text));
            assert_eq!(spec.choice, Choice::default());
            assert!(spec.settings.set.is_empty() && spec.settings.size.is_none() && spec.settings.camera.is_none());
        }
        for text in ["a.png", "a@b.png", "a.exr", "p.xml.png", ""] {
            assert!(!Spec::is_project(text), "{text}");
        }
    }

    #[test]
    fn mistakes_are_named_with_their_place_and_what_is_valid() {
        for (text, position, words) in [
            ("é.xml@bakend=cpu", 7, &["no setting `bakend`", "did you mean `backend`?"][..]),
            ("p.xml@seed=1,raster=gpu", 21, &["no value of `raster`", "auto, cpu, wgpu"]),
            ("p.xml@color=lineal", 13, &["did you mean `linear`?"]),
            ("p.xml@fidelity=thesys", 16, &["did you mean `thesis`?"]),
            ("p.xml@size=64", 12, &["WIDTHxHEIGHT"]),
            ("p.xml@size=64x-1", 12, &["WIDTHxHEIGHT"]),
            ("p.xml@aa=9", 10, &["no value of `aa`", "1, 2, 4, 8"]),
            ("p.xml@gpus=0", 12, &["no number of GPUs", "or all"]),
            ("p.xml@reference=pictures", 17, &["did you mean `picture`?"]),
            ("p.xml@seed=-1", 12, &["0 to 4294967295"]),
            ("p.xml@camera=", 14, &["`camera` has no value"]),
            ("p.xml@cpu", 7, &["not NAME=VALUE", "raster"]),
            ("p.xml@seed=1,,size=1x1", 14, &["not NAME=VALUE"]),
            ("p.xml@seed=1,seed=2", 14, &["set twice"]),
            ("p.xml@.samples=2", 7, &["no setting `.samples`"]),
            ("@seed=1", 1, &["no project file"]),
        ] {
            let error = Spec::parse(text).expect_err(text);
            assert_eq!(error.position, position, "{error}");
            let printed = error.to_string();
            for word in words {
                assert!(printed.contains(word), "{printed}");
            }
            assert_eq!(printed.lines().nth(2).map(|line| line.chars().count()), Some(7 + position), "{printed}");
        }
    }
}
