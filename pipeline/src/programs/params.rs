//! The parameters of ray programs, in one table for XML attributes, `--set`, help and documents.

use super::{Fresnel, Sampler, TextureLod};
use crate::camera_programs::{CameraParams, LONGEST, MOST_GLOSS};
use crate::glass::{Background, GlassRule, GlassShadow, MOST_BOUNCES, MOST_STRATA, PathLimits};

/// The parameters of ray programs. Each program reads those in its [`RayProgramInfo::params`](super::RayProgramInfo::params).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RayParams {
    /// Ambient-occlusion rays per shaded point (`SQRT_SAMPLES` squared); 0 switches occlusion off.
    pub samples: u32,
    /// Longest distance to an occluder, scene units (`OCC_DIST`).
    pub radius: f32,
    /// Exponent applied to the unoccluded share of directions (`OCC_INTEN`).
    pub intensity: f32,
    /// Index of refraction of a whole pane (`COEF`).
    pub index: f32,
    /// Largest depth of glass bounces (`MAXDEPTH`).
    pub depth: u32,
    /// How occlusion directions are chosen.
    pub sampler: Sampler,
    /// Formula for the reflectance of glass; thesis fidelity uses the report's own weight.
    pub fresnel: Fresnel,
    /// What decides which materials are glass; in thesis fidelity always the project, with the report's panes.
    pub glass: GlassRule,
    /// Colour of rays that miss the scene; in thesis fidelity always black.
    pub background: Background,
    /// How light passes through glass along shadow rays; in thesis fidelity by the report's rule.
    pub shadow: GlassShadow,
    /// Number of spectral strata into which a path splits at a body with dispersion; 1 disables dispersion.
    pub wavelengths: u32,
    /// Number of paths that continue from the first rough glass surface of a path.
    pub paths: u32,
    /// Error that adaptive sampling of stochastic glass aims at: the root mean square over the pixels that show such glass and their red,
    /// green and blue, in the units of the colour, up to 1. 0 follows [`Self::paths`] at every pixel; above 0, `paths` is the largest
    /// number of paths of a pixel.
    pub error: f32,
    /// Photons that are shot at glass meshes for their caustics, with [`GlassShadow::Caustic`]; 0 shoots none.
    pub photons: u32,
    /// Radius of the discs over which photons are averaged, scene units; 0 chooses it by the bodies' size and the number of photons.
    pub photon_radius: f32,
    /// Limits for following light in glass.
    pub limits: PathLimits,
    /// Angular diameter of the light's disc, in degrees; 0 for a light without a disc, whose shadows are hard. Corrected fidelity
    /// only.
    pub sun: f32,
    /// Shadow rays over the light's disc per lit point; without a disc there is one.
    pub sun_samples: u32,
    /// Levels of the edge-avoiding filter over the share of light that is written; 0 filters nothing. Corrected fidelity only.
    pub filter: u32,
    /// At which mip level textures are read at hits; in thesis fidelity always at level 0.
    pub texture_lod: TextureLod,
    /// Position in the sample sequence of the first of the [`Self::samples`]. It is above 0 only in accumulated pictures, and from the
    /// second of several samples a pixel on. Projects cannot set it.
    pub first: u32,
    /// Position in the sequence of the first of the [`Self::paths`].
    pub first_path: u32,
    /// Position in the sequence of the first of the [`Self::sun_samples`].
    pub first_sun: u32,
    /// Number of the batch of [`Self::photons`] that is shot, from 0. Each batch continues the sequence of the batch before, with a
    /// smaller radius.
    pub photon_batch: u32,
    /// Parameters of programs whose rays start at the camera. For these programs [`Self::samples`] is the number of camera rays a
    /// pixel; 0 means one ray through the pixel's centre.
    pub camera: CameraParams,
}

impl Default for RayParams {
    /// The report's constants, the clear colour where rays leave the scene, and textures that are filtered at hits.
    fn default() -> Self {
        Self {
            samples: 100,
            radius: 0.5,
            intensity: 1.6,
            index: 1.1,
            depth: 5,
            sampler: Sampler::Sobol,
            fresnel: Fresnel::Exact,
            glass: GlassRule::Pane,
            background: Background::Clear,
            shadow: GlassShadow::Report,
            wavelengths: 16,
            paths: 16,
            error: 0.0,
            photons: 0,
            photon_radius: 0.0,
            limits: PathLimits::DEFAULT,
            sun: 0.0,
            sun_samples: 16,
            filter: 0,
            texture_lod: TextureLod::Cones,
            first: 0,
            first_path: 0,
            first_sun: 0,
            photon_batch: 0,
            camera: CameraParams::default(),
        }
    }
}

/// Largest value of [`RayParams::samples`].
pub const MOST_SAMPLES: u32 = 65_536;
/// Largest value of [`RayParams::paths`].
pub const MOST_PATHS: u32 = 4096;
/// Least value of [`RayParams::paths`] with an [`RayParams::error`]: two for each of the two halves from which the error is estimated.
pub const LEAST_ADAPTIVE_PATHS: u32 = 4;
/// Bytes a pixel that adaptive sampling takes at most on the processor.
pub const ADAPTIVE_BYTES: u64 = 88;
/// Largest value of [`RayParams::photons`].
pub const MOST_PHOTONS: u32 = 1 << 26;
/// Bytes that a photon takes at most on the processor, including its share of the table for finding photons.
pub const PHOTON_BYTES: u64 = 64;
/// Largest angular diameter of the light's disc, in degrees; the sun's is 0.53.
pub const LARGEST_SUN: f32 = 90.0;
/// Largest value of [`RayParams::sun_samples`].
pub const MOST_SUN_SAMPLES: u32 = 65_536;

/// Greatest number of levels of the filter over a share of light, by rays or by raster.
pub const MAX_FILTER_LEVELS: u32 = 3;

/// Bytes a pixel that the filter takes on the processor: position, normal, and the share before and after a level, in 32-bit floats.
pub const FILTER_BYTES: u64 = 32;

/// A parameter of ray programs, as XML attribute, in `--set`, in help and in documents.
#[derive(Debug, Clone, Copy)]
pub struct ParamInfo {
    /// Name in XML attributes and `--set pass.name=value`.
    pub name: &'static str,
    /// Description, with the unit.
    pub about: &'static str,
    /// Description of the valid values.
    pub valid: &'static str,
    /// The valid values, for user interfaces that offer a choice.
    pub values: Values,
}

/// The values that a parameter accepts. Restrictions that depend on other settings are only in [`ParamInfo::valid`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Values {
    /// Whole numbers from the first to the last.
    Integer(u32, u32),
    /// Numbers from the first to the last.
    Number(f32, f32),
    /// Finite numbers above 0.
    Positive,
    /// One of these names.
    Names(&'static [&'static str]),
}

/// Every parameter of a ray program.
pub const PARAMS: &[ParamInfo] = &[
    ParamInfo {
        name: "samples",
        about: "ambient-occlusion rays per shaded point, 0 switches occlusion off; from the camera: rays a pixel, 0 is one through its centre",
        valid: "0..=65536, a square number with sampler=strata and in thesis fidelity",
        values: Values::Integer(0, 65_536),
    },
    ParamInfo {
        name: "radius",
        about: "longest distance to an occluder, in scene units",
        valid: "a finite number above 0",
        values: Values::Positive,
    },
    ParamInfo {
        name: "intensity",
        about: "exponent of the open share; above 1, few samples come out too bright: at 1.6 by 0.1 with 1 sample, by 0.01 with 4",
        valid: "0..=100",
        values: Values::Number(0.0, 100.0),
    },
    ParamInfo {
        name: "index",
        about: "index of refraction that stands for a whole pane",
        valid: "0.1..=10",
        values: Values::Number(0.1, 10.0),
    },
    ParamInfo {
        name: "depth",
        about: "deepest glass bounce; with glass=auto the deepest at which both branches are followed; from the camera: most bounces",
        valid: "0..=16",
        values: Values::Integer(0, 16),
    },
    ParamInfo {
        name: "sampler",
        about: "how occlusion directions are chosen",
        valid: "sobol, strata",
        values: Values::Names(&["sobol", "strata"]),
    },
    ParamInfo {
        name: "fresnel",
        about: "how much glass reflects by its angle",
        valid: "exact, schlick, s, p (not in thesis fidelity)",
        values: Values::Names(&["exact", "schlick", "s", "p"]),
    },
    ParamInfo {
        name: "glass",
        about: "what glass is: panes of the pass's index, or solid, thin or pane as each material says",
        valid: "pane, auto (thesis fidelity: pane)",
        values: Values::Names(&["pane", "auto"]),
    },
    ParamInfo {
        name: "background",
        about: "what rays show that leave the scene: black, the clear colour of the G-buffer (from the camera: of the target), or blue",
        valid: "black, clear, blue (thesis fidelity: black)",
        values: Values::Names(&["black", "clear", "blue"]),
    },
    ParamInfo {
        name: "shadow",
        about: "light behind glass: 0.9 a surface as in the report, none, or straight on by Fresnel's share and absorption; with caustic, where \
                exact spheres bend it, and meshes with photons above 0",
        valid: "report, opaque, straight, caustic (thesis fidelity: report)",
        values: Values::Names(&["report", "opaque", "straight", "caustic"]),
    },
    ParamInfo {
        name: "wavelengths",
        about: "with glass=auto, into how many a path is split where a body disperses; 1 bends all colours alike",
        valid: "1..=256",
        values: Values::Integer(1, 256),
    },
    ParamInfo {
        name: "paths",
        about: "with glass=auto, ways on from the first rough glass of a path, each with a microfacet of every rough surface that it meets: \
                their noise falls as their number grows",
        valid: "1..=4096",
        values: Values::Integer(1, 4096),
    },
    ParamInfo {
        name: "error",
        about: "with glass=auto, the root mean square error that pixels of rough or dispersing glass, or of roulette, may have: each is given \
                as many paths as that takes, at most paths; 0 gives each pixel all paths",
        valid: "0..=1, above 0 with paths=4 or more",
        values: Values::Number(0.0, 1.0),
    },
    ParamInfo {
        name: "photons",
        about: "with glass=auto and shadow=caustic, photons that are shot at solid meshes for their caustics; 0 lets light go straight \
                through meshes",
        valid: "0..=67108864 (thesis fidelity: 0)",
        values: Values::Integer(0, MOST_PHOTONS),
    },
    ParamInfo {
        name: "photonradius",
        about: "radius of the discs over which photons are averaged, in scene units; 0 chooses it by the size of the bodies and the number \
                of photons",
        valid: "0..=1e5",
        values: Values::Number(0.0, LONGEST),
    },
    ParamInfo {
        name: "cutoff",
        about: "with glass=auto, ways in glass of which less than this share of a pixel depends are not followed; 0 follows all",
        valid: "0..=1",
        values: Values::Number(0.0, 1.0),
    },
    ParamInfo {
        name: "cutoffcolor",
        about: "what stands for ways in glass that are not followed: nothing, or the background",
        valid: "black, background",
        values: Values::Names(&["black", "background"]),
    },
    ParamInfo {
        name: "roulette",
        about: "whether ways below the cutoff are followed by chance, and counted by so much more: noise, and no error in the mean",
        valid: "off, on",
        values: Values::Names(&["off", "on"]),
    },
    ParamInfo {
        name: "reflections",
        about: "with glass=auto, most reflections on a path in glass",
        valid: "0..=128",
        values: Values::Integer(0, MOST_BOUNCES),
    },
    ParamInfo {
        name: "refractions",
        about: "with glass=auto, most refractions on a path in glass",
        valid: "0..=128",
        values: Values::Integer(0, MOST_BOUNCES),
    },
    ParamInfo {
        name: "sun",
        about: "angular diameter of the light's disc, in degrees, for soft shadows; 0 is a point, and the sun of the sky 0.53",
        valid: "0..=90 (thesis fidelity: 0)",
        values: Values::Number(0.0, LARGEST_SUN),
    },
    ParamInfo {
        name: "sunsamples",
        about: "with sun above 0, shadow rays over the light's disc per lit point",
        valid: "1..=65536",
        values: Values::Integer(1, MOST_SUN_SAMPLES),
    },
    ParamInfo {
        name: "filter",
        about: "levels of the filter that averages a share of few samples over its surface: 5 x 5 pixels, then 13 x 13 and 29 x 29; 0 \
                filters nothing",
        valid: "0..=3 (thesis fidelity: 0)",
        values: Values::Integer(0, MAX_FILTER_LEVELS),
    },
    ParamInfo {
        name: "texturelod",
        about: "at which mip level textures are read at hits: at level 0, or at that of a ray cone, as wide as the pixel's part of the surface",
        valid: "zero, cones (thesis fidelity: zero)",
        values: Values::Names(&["zero", "cones"]),
    },
    ParamInfo {
        name: "lightwidth",
        about: "side along x of a rectangular light that looks down, around the light's position, in scene units",
        valid: "0..=1e5; with lightdepth=0 as well the light is a point",
        values: Values::Number(0.0, LONGEST),
    },
    ParamInfo {
        name: "lightdepth",
        about: "side along z of the same",
        valid: "0..=1e5",
        values: Values::Number(0.0, LONGEST),
    },
    ParamInfo {
        name: "radiance",
        about: "what the light sends out: radiance of a rectangle, radiant intensity of a point",
        valid: "a finite number above 0",
        values: Values::Positive,
    },
    ParamInfo {
        name: "ambient",
        about: "light that is everywhere, as a share of white",
        valid: "0..=1",
        values: Values::Number(0.0, 1.0),
    },
    ParamInfo {
        name: "gloss",
        about: "exponent of the cosine lobe of rough mirrors; 0 is a smooth mirror",
        valid: "0..=1e5",
        values: Values::Number(0.0, MOST_GLOSS),
    },
    ParamInfo {
        name: "aperture",
        about: "radius of the camera's lens, in scene units; 0 is a pinhole",
        valid: "0..=1e5",
        values: Values::Number(0.0, LONGEST),
    },
    ParamInfo {
        name: "focus",
        about: "with aperture above 0, how far away the plane is that is sharp, in scene units",
        valid: "a finite number above 0",
        values: Values::Positive,
    },
    ParamInfo {
        name: "gamma",
        about: "what is written is the colour to the power of 1 / gamma",
        valid: "0.1..=10",
        values: Values::Number(0.1, 10.0),
    },
];

impl RayParams {
    /// Sets a parameter by its name in [`PARAMS`].
    ///
    /// # Errors
    /// If the name or the value is invalid; the message says what would be valid.
    pub fn set(&mut self, name: &str, value: &str) -> Result<(), String> {
        let Some(info) = PARAMS.iter().find(|info| info.name == name) else {
            return Err(crate::diagnostic::valid_names(name, PARAMS.iter().map(|info| info.name)));
        };
        let wrong = || format!("`{name}` is {}; valid: {}", info.about, info.valid);
        let float = |valid: fn(f32) -> bool| value.parse::<f32>().ok().filter(|v| valid(*v)).ok_or_else(wrong);
        match name {
            "samples" => self.samples = value.parse().ok().filter(|v| *v <= 65_536).ok_or_else(wrong)?,
            "radius" => self.radius = float(|v| v.is_finite() && v > 0.0)?,
            "intensity" => self.intensity = float(|v| (0.0..=100.0).contains(&v))?,
            "index" => self.index = float(|v| (0.1..=10.0).contains(&v))?,
            "depth" => self.depth = value.parse().ok().filter(|v| *v <= 16).ok_or_else(wrong)?,
            "sampler" => {
                self.sampler = match value {
                    "sobol" => Sampler::Sobol,
                    "strata" => Sampler::Strata,
                    _ => return Err(wrong()),
                }
            }
            "fresnel" => self.fresnel = Fresnel::named(value).ok_or_else(wrong)?,
            "glass" => self.glass = GlassRule::named(value).ok_or_else(wrong)?,
            "background" => self.background = Background::named(value).ok_or_else(wrong)?,
            "shadow" => self.shadow = GlassShadow::named(value).ok_or_else(wrong)?,
            "wavelengths" => {
                let valid = |count: &u32| (1..=MOST_STRATA).contains(count);
                self.wavelengths = value.parse().ok().filter(valid).ok_or_else(wrong)?;
            }
            "paths" => {
                let valid = |count: &u32| (1..=MOST_PATHS).contains(count);
                self.paths = value.parse().ok().filter(valid).ok_or_else(wrong)?;
            }
            "error" => self.error = float(|v| (0.0..=1.0).contains(&v))?,
            "photons" => self.photons = value.parse().ok().filter(|v| *v <= MOST_PHOTONS).ok_or_else(wrong)?,
            "photonradius" => self.photon_radius = float(|v| (0.0..=LONGEST).contains(&v))?,
            "sun" => self.sun = float(|v| (0.0..=LARGEST_SUN).contains(&v))?,
            "sunsamples" => {
                let valid = |count: &u32| (1..=MOST_SUN_SAMPLES).contains(count);
                self.sun_samples = value.parse().ok().filter(valid).ok_or_else(wrong)?;
            }
            "filter" => {
                self.filter = value.parse().ok().filter(|levels| *levels <= MAX_FILTER_LEVELS).ok_or_else(wrong)?;
            }
            "texturelod" => self.texture_lod = TextureLod::named(value).ok_or_else(wrong)?,
            _ => {
                let known = self.limits.set(name, value) || self.camera.set(name, value);
                return if known { Ok(()) } else { Err(wrong()) };
            }
        }
        Ok(())
    }
}

impl RayParams {
    /// The value of a parameter as text.
    ///
    /// # Panics
    /// If the name is not in [`PARAMS`].
    #[must_use]
    pub fn get(&self, name: &str) -> String {
        match name {
            "samples" => self.samples.to_string(),
            "radius" => self.radius.to_string(),
            "intensity" => self.intensity.to_string(),
            "index" => self.index.to_string(),
            "depth" => self.depth.to_string(),
            "sampler" => match self.sampler {
                Sampler::Sobol => "sobol".to_owned(),
                Sampler::Strata => "strata".to_owned(),
            },
            "fresnel" => self.fresnel.name().to_owned(),
            "glass" => self.glass.name().to_owned(),
            "background" => self.background.name().to_owned(),
            "shadow" => self.shadow.name().to_owned(),
            "wavelengths" => self.wavelengths.to_string(),
            "paths" => self.paths.to_string(),
            "error" => self.error.to_string(),
            "photons" => self.photons.to_string(),
            "photonradius" => self.photon_radius.to_string(),
            "sun" => self.sun.to_string(),
            "sunsamples" => self.sun_samples.to_string(),
            "filter" => self.filter.to_string(),
            "texturelod" => self.texture_lod.name().to_owned(),
            _ => self
                .limits
                .get(name)
                .or_else(|| self.camera.get(name))
                .unwrap_or_else(|| panic!("`{name}` is not a parameter")),
        }
    }
}
