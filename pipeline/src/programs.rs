//! The one table of programs that a pass may name: what each reads, and its parameters.
//!
//! Help, XML validation, `curitiba list`, docs, bench ids and conformance tests iterate these tables.

use crate::camera_programs::{CameraParams, LONGEST, MOST_GLOSS};
use crate::glass::{Background, GlassRule, GlassShadow, MOST_BOUNCES, MOST_STRATA, PathLimits};

/// What a raster pass runs per pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RasterProgram {
    /// The report's `deferredShading`: shaded colour, world position with the light's cosine, shading normal.
    Deferred,
}

/// What a quad pass runs per pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum QuadProgram {
    /// Shows one texture.
    Show,
    /// Texture unit 0 times the `x` of texture unit 1.
    Combine,
}

/// What a ray pass runs per pixel, named by the stem of its program file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum RayProgram {
    /// Copies the colour: what joining the two systems costs.
    Dummy,
    /// Shadows of a directional light.
    DeferredShadows,
    /// Mirror reflection in glass.
    Reflection,
    /// Reflection and refraction in glass.
    Refraction,
    /// Ambient occlusion.
    Ssao,
    /// All of them, at every hit.
    Final,
    /// From the camera: colours without light.
    Albedo,
    /// From the camera: colours in light that nothing is in the way of.
    Lambert,
    /// From the camera: shadows, mirrors and glass.
    Whitted,
    /// From the camera: ambient occlusion.
    CameraOcclusion,
    /// From the camera: light that surfaces send each other.
    PathTracing,
}

/// Whether the report's programs are followed to the letter or their defects are mended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Fidelity {
    /// Mended; see `docs/fidelity.md` for each difference.
    #[default]
    Corrected,
    /// As the report's programs were written.
    Thesis,
}

/// How ambient occlusion directions are chosen in `corrected` fidelity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Sampler {
    /// Owen-scrambled Sobol points.
    #[default]
    Sobol,
    /// The report's N x N jittered strata, with hashed jitter.
    Strata,
}

/// How much of the light an interface of glass reflects, in `corrected` fidelity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Fresnel {
    /// Fresnel's equations for unpolarised light.
    #[default]
    Exact,
    /// Schlick's approximation; `docs/numerics.md` has its error.
    Schlick,
}

impl Fresnel {
    /// Each with the name that parameters give it.
    pub const NAMED: [(&'static str, Self); 2] = [("exact", Self::Exact), ("schlick", Self::Schlick)];

    /// Its name as a value of a parameter.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::Schlick => "schlick",
        }
    }

    /// The one of this name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::NAMED.iter().find(|(known, _)| *known == name).map(|(_, weights)| *weights)
    }
}

/// The parameters of the ray programs; a program reads those that [`RayProgramInfo::params`] lists for it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RayParams {
    /// Ambient-occlusion rays per shaded point (`SQRT_SAMPLES` squared); 0 switches occlusion off.
    pub samples: u32,
    /// Longest distance to an occluder, scene units (`OCC_DIST`).
    pub radius: f32,
    /// Exponent of the open share (`OCC_INTEN`).
    pub intensity: f32,
    /// Index of refraction of a whole pane (`COEF`).
    pub index: f32,
    /// Deepest glass bounce (`MAXDEPTH`).
    pub depth: u32,
    /// How occlusion directions are chosen.
    pub sampler: Sampler,
    /// How much glass reflects; thesis fidelity has the report's own weight.
    pub fresnel: Fresnel,
    /// What decides what glass is; in thesis fidelity always the report's panes.
    pub glass: GlassRule,
    /// What rays show that leave the scene; in thesis fidelity always black.
    pub background: Background,
    /// What shadow rays find behind glass; in thesis fidelity the report's rule.
    pub shadow: GlassShadow,
    /// Strata of the spectrum into which a path is split where a body bends colours differently; 1 bends all alike.
    pub wavelengths: u32,
    /// Ways on from the first rough glass of a path.
    pub paths: u32,
    /// Where light in glass is no longer followed.
    pub limits: PathLimits,
    /// Angular diameter of the light's disc, in degrees: 0 is a point, whose shadows are hard. Corrected fidelity only.
    pub sun: f32,
    /// Shadow rays over the light's disc per lit point; without a disc it is one.
    pub sun_samples: u32,
    /// Place in the sequence of the first of the [`Self::samples`]: 0, but for pictures whose samples are accumulated, and for all but the
    /// first of several samples a pixel. No parameter of projects.
    pub first: u32,
    /// The same of the first of the [`Self::paths`].
    pub first_path: u32,
    /// The same of the first of the [`Self::sun_samples`].
    pub first_sun: u32,
    /// What programs alone read whose rays start at the camera. Of these the [`Self::samples`] are rays a pixel; 0 is one, through the
    /// pixel's centre.
    pub camera: CameraParams,
}

impl Default for RayParams {
    /// The report's constants.
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
            background: Background::Black,
            shadow: GlassShadow::Report,
            wavelengths: 16,
            paths: 16,
            limits: PathLimits::DEFAULT,
            sun: 0.0,
            sun_samples: 16,
            first: 0,
            first_path: 0,
            first_sun: 0,
            camera: CameraParams::default(),
        }
    }
}

/// Most [`RayParams::samples`].
pub const MOST_SAMPLES: u32 = 65_536;
/// Most [`RayParams::paths`].
pub const MOST_PATHS: u32 = 4096;
/// Largest angular diameter of the light's disc, in degrees; that of the sun in the sky is 0.53.
pub const LARGEST_SUN: f32 = 90.0;
/// Most [`RayParams::sun_samples`].
pub const MOST_SUN_SAMPLES: u32 = 65_536;

/// A parameter of the ray programs: one entry serves the XML attribute, `--set`, help and docs.
#[derive(Debug, Clone, Copy)]
pub struct ParamInfo {
    /// Name in XML attributes and `--set pass.name=value`.
    pub name: &'static str,
    /// What it is, with its unit.
    pub about: &'static str,
    /// What is valid.
    pub valid: &'static str,
    /// The same, for programs that offer values.
    pub values: Values,
}

/// Which values a parameter takes; what depends on other settings is in [`ParamInfo::valid`] alone.
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
        valid: "exact, schlick (not in thesis fidelity)",
        values: Values::Names(&["exact", "schlick"]),
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
                exact spheres bend it",
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
    /// What would be valid, if the name or the value is not.
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
            "sun" => self.sun = float(|v| (0.0..=LARGEST_SUN).contains(&v))?,
            "sunsamples" => {
                let valid = |count: &u32| (1..=MOST_SUN_SAMPLES).contains(count);
                self.sun_samples = value.parse().ok().filter(valid).ok_or_else(wrong)?;
            }
            _ => {
                let known = self.limits.set(name, value) || self.camera.set(name, value);
                return if known { Ok(()) } else { Err(wrong()) };
            }
        }
        Ok(())
    }
}

impl RayParams {
    /// The value of a parameter as it is written.
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
            "sun" => self.sun.to_string(),
            "sunsamples" => self.sun_samples.to_string(),
            _ => self
                .limits
                .get(name)
                .or_else(|| self.camera.get(name))
                .unwrap_or_else(|| panic!("`{name}` is not a parameter")),
        }
    }
}

/// A device program that a project names: `<optixProgram type ray file proc/>`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ProcInfo {
    /// `Closest_Hit`, `Any_Hit` or `Miss`.
    pub kind: &'static str,
    /// Ray type: `Phong` (radiance) or `Shadow`.
    pub ray: &'static str,
    /// Name of the program.
    pub proc: &'static str,
    /// Whether the project must name it in the default material; otherwise it may, per material.
    pub required: bool,
}

/// When a ray program traces rays, and so needs an acceleration structure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Traces {
    /// Never.
    Nothing,
    /// At every pixel that it computes: shadow rays, whatever else.
    ShadowRays,
    /// Where it takes samples of occlusion: with `samples` above 0.
    Samples,
    /// Where a pixel shows glass.
    FromGlass,
    /// At every pixel, from the camera: it reads no G-buffer.
    FromCamera,
}

/// What the numbers that a program writes are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Writes {
    /// A linear colour.
    Color,
    /// A share from 0 to 1, the same in red, green and blue.
    Share,
}

/// A ray program: what a project must hand it, and what it does with it.
///
/// The table of these entries is the one place that tells programs apart: plan, executor, reports, benches and help read it.
#[derive(Debug, Clone, Copy)]
pub struct RayProgramInfo {
    /// Which.
    pub program: RayProgram,
    /// Stem of the program file, as in `optix/final.ptx`.
    pub stem: &'static str,
    /// Its name in bench ids and reports.
    pub short: &'static str,
    /// When it traces rays.
    pub traces: Traces,
    /// What it writes.
    pub writes: Writes,
    /// Ray-generation program; empty for programs whose rays start at the camera, which passes name by `program`.
    pub entry: &'static str,
    /// What it computes, in one sentence.
    pub about: &'static str,
    /// Variables of `optixInput` that it reads: `pos_buffer`, `norm_buffer`, `color_buffer`.
    pub buffers: &'static [&'static str],
    /// Vertex attributes that it reads.
    pub vertex_attributes: &'static [&'static str],
    /// Material attributes that it reads (`optixVar`).
    pub material_attributes: &'static [&'static str],
    /// Global attributes that it reads (`optixVar`).
    pub globals: &'static [&'static str],
    /// Hit and miss programs.
    pub procs: &'static [ProcInfo],
    /// Parameters that it reads, by their names in [`PARAMS`].
    pub params: &'static [&'static str],
}

const fn required(kind: &'static str, ray: &'static str, proc: &'static str) -> ProcInfo {
    ProcInfo { kind, ray, proc, required: true }
}

const fn optional(kind: &'static str, ray: &'static str, proc: &'static str) -> ProcInfo {
    ProcInfo { kind, ray, proc, required: false }
}

/// What a program file has, whatever it computes and whether it calls it or not: names by the type under which projects name
/// them. Triangles (`Geometry_Intersection` and `Bounding_Box`) are the tracers' own; their names stand for that.
pub const PROCS: &[(&str, &[&str])] = &[
    ("RayGen", &["buffer_camera"]),
    ("Exception", &["exception"]),
    ("Closest_Hit", &["closest_hit", "closest_hit_glass"]),
    ("Any_Hit", &["any_hit_shadow", "any_hit_shadow_glass"]),
    ("Miss", &["miss", "miss_shadow"]),
    ("Geometry_Intersection", &["geometryintersection"]),
    ("Bounding_Box", &["boundingbox"]),
];

/// The names of a type, in any letters' case, in [`PROCS`].
#[must_use]
pub fn procs_of_kind(kind: &str) -> Option<&'static [&'static str]> {
    PROCS.iter().find(|(known, _)| kind.eq_ignore_ascii_case(known)).map(|(_, names)| *names)
}

/// Every ray program.
pub const RAY_PROGRAMS: &[RayProgramInfo] = &[
    RayProgramInfo {
        program: RayProgram::Dummy,
        stem: "dummy",
        short: "dummy",
        traces: Traces::Nothing,
        writes: Writes::Color,
        entry: "buffer_camera",
        about: "writes the input colour: the cost of joining two systems",
        buffers: &["color_buffer"],
        vertex_attributes: &[],
        material_attributes: &[],
        globals: &[],
        procs: &[],
        params: &[],
    },
    RayProgramInfo {
        program: RayProgram::DeferredShadows,
        stem: "deferredShadows",
        short: "shadows",
        traces: Traces::ShadowRays,
        writes: Writes::Share,
        entry: "buffer_camera",
        about: "shadow of a directional light: 0.5 in shadow, 1 in light; soft with `sun` above 0",
        buffers: &["pos_buffer"],
        vertex_attributes: &["position"],
        material_attributes: &[],
        globals: &["lightDir"],
        procs: &[required("Any_Hit", "Shadow", "any_hit_shadow"), optional("Miss", "Shadow", "miss")],
        params: &["sun", "sunsamples"],
    },
    RayProgramInfo {
        program: RayProgram::Reflection,
        stem: "reflection",
        short: "reflection",
        traces: Traces::FromGlass,
        writes: Writes::Color,
        entry: "buffer_camera",
        about: "mirror reflection in glass; other pixels keep their colour",
        buffers: &["pos_buffer", "norm_buffer", "color_buffer"],
        vertex_attributes: &["position", "normal", "texCoord0"],
        material_attributes: &["diffuse", "texCount"],
        globals: &["lightDir", "lightColor"],
        procs: &[
            required("Closest_Hit", "Phong", "closest_hit"),
            required("Miss", "Phong", "miss"),
            optional("Closest_Hit", "Phong", "closest_hit_glass"),
        ],
        params: &["depth", "background"],
    },
    RayProgramInfo {
        program: RayProgram::Refraction,
        stem: "refraction",
        short: "refraction",
        traces: Traces::FromGlass,
        writes: Writes::Color,
        entry: "buffer_camera",
        about: "reflection and refraction in glass; other pixels keep their colour",
        buffers: &["pos_buffer", "norm_buffer", "color_buffer"],
        vertex_attributes: &["position", "normal", "texCoord0"],
        material_attributes: &["diffuse", "texCount"],
        globals: &["lightDir", "lightColor"],
        procs: &[
            required("Closest_Hit", "Phong", "closest_hit"),
            required("Miss", "Phong", "miss"),
            optional("Closest_Hit", "Phong", "closest_hit_glass"),
        ],
        params: &[
            "index",
            "depth",
            "fresnel",
            "glass",
            "background",
            "wavelengths",
            "paths",
            "cutoff",
            "cutoffcolor",
            "roulette",
            "reflections",
            "refractions",
        ],
    },
    RayProgramInfo {
        program: RayProgram::Ssao,
        stem: "ssao",
        short: "ao",
        traces: Traces::Samples,
        writes: Writes::Share,
        entry: "buffer_camera",
        about: "ambient occlusion: the open share of the cosine-weighted hemisphere, to the power of `intensity`",
        buffers: &["pos_buffer", "norm_buffer"],
        vertex_attributes: &["position"],
        material_attributes: &[],
        globals: &[],
        procs: &[required("Any_Hit", "Shadow", "any_hit_shadow"), required("Miss", "Shadow", "miss")],
        params: &["samples", "radius", "intensity", "sampler"],
    },
    RayProgramInfo {
        program: RayProgram::Final,
        stem: "final",
        short: "all",
        traces: Traces::ShadowRays,
        writes: Writes::Color,
        entry: "buffer_camera",
        about: "shadows, reflection, refraction and ambient occlusion, at every hit",
        buffers: &["pos_buffer", "norm_buffer", "color_buffer"],
        vertex_attributes: &["position", "normal", "texCoord0"],
        material_attributes: &["diffuse", "texCount"],
        globals: &["lightDir", "lightColor"],
        procs: &[
            required("Closest_Hit", "Phong", "closest_hit"),
            required("Miss", "Phong", "miss"),
            required("Any_Hit", "Shadow", "any_hit_shadow"),
            required("Miss", "Shadow", "miss_shadow"),
            optional("Closest_Hit", "Phong", "closest_hit_glass"),
            optional("Any_Hit", "Shadow", "any_hit_shadow_glass"),
        ],
        params: &[
            "samples",
            "radius",
            "intensity",
            "index",
            "depth",
            "sampler",
            "fresnel",
            "glass",
            "background",
            "shadow",
            "wavelengths",
            "paths",
            "cutoff",
            "cutoffcolor",
            "roulette",
            "reflections",
            "refractions",
            "sun",
            "sunsamples",
        ],
    },
    RayProgramInfo {
        program: RayProgram::Albedo,
        stem: "albedo",
        short: "albedo",
        traces: Traces::FromCamera,
        writes: Writes::Color,
        entry: "",
        about: "from the camera: texture and diffuse colour of what a pixel shows, without light",
        buffers: &[],
        vertex_attributes: &["position", "normal", "texCoord0"],
        material_attributes: &["diffuse", "texCount"],
        globals: &[],
        procs: &[],
        params: &["samples", "aperture", "focus", "background", "gamma"],
    },
    RayProgramInfo {
        program: RayProgram::Lambert,
        stem: "lambert",
        short: "lambert",
        traces: Traces::FromCamera,
        writes: Writes::Color,
        entry: "",
        about: "from the camera: the same in the light, by its cosine, that nothing is in the way of",
        buffers: &[],
        vertex_attributes: &["position", "normal", "texCoord0"],
        material_attributes: &["diffuse", "texCount"],
        globals: &[],
        procs: &[],
        params: &["samples", "aperture", "focus", "background", "gamma", "ambient"],
    },
    RayProgramInfo {
        program: RayProgram::Whitted,
        stem: "whitted",
        short: "whitted",
        traces: Traces::FromCamera,
        writes: Writes::Color,
        entry: "",
        about: "from the camera: light with shadows, mirrors, rough mirrors and glass; a rectangular light has soft shadows",
        buffers: &[],
        vertex_attributes: &["position", "normal", "texCoord0"],
        material_attributes: &["diffuse", "texCount"],
        globals: &[],
        procs: &[],
        params: &[
            "samples",
            "aperture",
            "focus",
            "background",
            "gamma",
            "ambient",
            "depth",
            "index",
            "fresnel",
            "gloss",
            "lightwidth",
            "lightdepth",
        ],
    },
    RayProgramInfo {
        program: RayProgram::CameraOcclusion,
        stem: "cameraOcclusion",
        short: "camera-ao",
        traces: Traces::FromCamera,
        writes: Writes::Color,
        entry: "",
        about: "from the camera: ambient occlusion, the open share of the cosine-weighted hemisphere",
        buffers: &[],
        vertex_attributes: &["position", "normal", "texCoord0"],
        material_attributes: &["diffuse", "texCount"],
        globals: &[],
        procs: &[],
        params: &["samples", "aperture", "focus", "background", "gamma", "radius"],
    },
    RayProgramInfo {
        program: RayProgram::PathTracing,
        stem: "pathTracing",
        short: "paths",
        traces: Traces::FromCamera,
        writes: Writes::Color,
        entry: "",
        about: "from the camera: light over several diffuse bounces, mirrors and glass, from the light or emitting surfaces",
        buffers: &[],
        vertex_attributes: &["position", "normal", "texCoord0"],
        material_attributes: &["diffuse", "texCount"],
        globals: &[],
        procs: &[],
        params: &[
            "samples",
            "aperture",
            "focus",
            "background",
            "gamma",
            "depth",
            "index",
            "fresnel",
            "gloss",
            "lightwidth",
            "lightdepth",
            "radiance",
        ],
    },
];

impl RayProgram {
    /// Its entry in [`RAY_PROGRAMS`].
    #[must_use]
    pub fn info(self) -> &'static RayProgramInfo {
        RAY_PROGRAMS.iter().find(|info| info.program == self).expect("every program has an entry")
    }

    /// Whether a pass with these parameters asks for more of glass than the report's panes, in a scene that has glass.
    #[must_use]
    pub fn asks_of_glass(self, params: &RayParams) -> Option<String> {
        let reads = |name: &str| self.info().reads(name);
        let asked = [
            (reads("glass") && params.glass != GlassRule::Pane, "glass"),
            (reads("background") && params.background != Background::Black, "background"),
            (reads("shadow") && params.shadow != GlassShadow::Report, "shadow"),
        ];
        let names: Vec<String> =
            asked.iter().filter(|(asked, _)| *asked).map(|(_, name)| format!("{name}={}", params.get(name))).collect();
        (!names.is_empty()).then(|| names.join(" "))
    }

    /// The disc of the light that a pass with these parameters asks for, in words; `None` where the light is a point.
    #[must_use]
    pub fn asks_of_sun(self, params: &RayParams) -> Option<String> {
        (self.info().sun_samples(params) > 0).then(|| format!("sun={}", params.sun))
    }

    /// Whether it traces rays with these parameters, in a scene that has what it looks for.
    #[must_use]
    pub fn can_trace(self, params: &RayParams) -> bool {
        self.info().needs_structure(params, true).0
    }
}

impl RayProgramInfo {
    /// Whether it reads a parameter of [`PARAMS`].
    #[must_use]
    pub fn reads(&self, param: &str) -> bool {
        self.params.contains(&param)
    }

    /// Whether projects may name this hit or miss program for it.
    #[must_use]
    pub fn names(&self, proc: &str) -> bool {
        self.procs.iter().any(|info| info.proc == proc)
    }

    /// Whether its rays start at the camera: it reads no G-buffer, and a pass names it by `program`.
    #[must_use]
    pub fn starts_at_camera(&self) -> bool {
        self.traces == Traces::FromCamera
    }

    /// The parameters of a pass that names none.
    #[must_use]
    pub fn defaults(&self) -> RayParams {
        let defaults = RayParams::default();
        if self.starts_at_camera() {
            RayParams { samples: 0, index: 1.5, background: Background::Clear, ..defaults }
        } else {
            defaults
        }
    }

    /// The occlusion rays of a shaded point, 0 where the program traces none; of programs whose rays start at the camera the rays of a
    /// pixel.
    #[must_use]
    pub fn samples(&self, params: &RayParams) -> u32 {
        match () {
            () if self.starts_at_camera() => params.samples.max(1),
            () if self.reads("samples") => params.samples,
            () => 0,
        }
    }

    /// The shadow rays over the light's disc of a lit point; 0 where the light is a point.
    #[must_use]
    pub fn sun_samples(&self, params: &RayParams) -> u32 {
        if self.reads("sun") && params.sun > 0.0 { params.sun_samples } else { 0 }
    }

    /// Whether it needs an acceleration structure, and why; `finds_glass` says whether any pixel may show glass.
    #[must_use]
    pub fn needs_structure(&self, params: &RayParams, finds_glass: bool) -> (bool, String) {
        match self.traces {
            Traces::Nothing => (false, format!("program {} traces no ray", self.stem)),
            Traces::ShadowRays => (true, "it traces shadow rays".into()),
            Traces::Samples if params.samples == 0 => (false, "samples is 0".into()),
            Traces::Samples => (true, "it traces occlusion rays".into()),
            Traces::FromGlass if finds_glass => (true, "rays leave its glass".into()),
            Traces::FromCamera => (true, "its rays start at the camera".into()),
            Traces::FromGlass => (false, "no material of the scene is mapped to `closest_hit_glass`".into()),
        }
    }
}

/// A raster or quad program, selected by the stem of a shader's pixel-shader file.
#[derive(Debug, Clone, Copy)]
pub struct ShaderInfo<P> {
    /// Which.
    pub program: P,
    /// Stem of the `ps` file.
    pub stem: &'static str,
    /// What it writes, in one sentence.
    pub about: &'static str,
}

/// Every raster program. A `default` pass without an injected shader runs the first.
pub const RASTER_PROGRAMS: &[ShaderInfo<RasterProgram>] = &[ShaderInfo {
    program: RasterProgram::Deferred,
    stem: "deferredShading",
    about: "target 0 `color`: diffuse lighting and texture; 1 `pos`: world position, light cosine in w; 2 `norm`: shading normal",
}];

/// Every quad program that a material may name.
pub const QUAD_PROGRAMS: &[ShaderInfo<QuadProgram>] = &[ShaderInfo {
    program: QuadProgram::Combine,
    stem: "combine",
    about: "texture unit 0 times the x of texture unit 1",
}];

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::glass::{CutoffColor, Roulette};

    #[test]
    fn what_a_program_calls_is_in_its_file() {
        for info in RAY_PROGRAMS.iter().filter(|info| !info.starts_at_camera()) {
            assert!(procs_of_kind("rayGEN").is_some_and(|names| names.contains(&info.entry)), "{}", info.stem);
            for proc in info.procs {
                assert!(procs_of_kind(proc.kind).is_some_and(|names| names.contains(&proc.proc)), "{proc:?}");
            }
        }
        assert_eq!(procs_of_kind("Any_Hat"), None);
    }

    #[test]
    fn every_parameter_is_settable_by_its_name() {
        let mut params = RayParams::default();
        for (name, value) in [
            ("samples", "49"),
            ("radius", "2"),
            ("intensity", "1"),
            ("index", "1.5"),
            ("depth", "3"),
            ("sampler", "strata"),
            ("fresnel", "schlick"),
            ("glass", "auto"),
            ("background", "clear"),
            ("shadow", "straight"),
            ("wavelengths", "24"),
            ("paths", "48"),
            ("cutoff", "0.01"),
            ("cutoffcolor", "background"),
            ("roulette", "on"),
            ("reflections", "3"),
            ("refractions", "12"),
            ("sun", "0.53"),
            ("sunsamples", "32"),
            ("lightwidth", "0.4"),
            ("lightdepth", "0.3"),
            ("radiance", "5"),
            ("ambient", "0.25"),
            ("gloss", "128"),
            ("aperture", "0.1"),
            ("focus", "3"),
            ("gamma", "2.2"),
        ] {
            params.set(name, value).expect("valid");
            assert_eq!(params.get(name), value);
        }
        let expected = RayParams {
            samples: 49,
            radius: 2.0,
            intensity: 1.0,
            index: 1.5,
            depth: 3,
            sampler: Sampler::Strata,
            fresnel: Fresnel::Schlick,
            glass: GlassRule::Auto,
            background: Background::Clear,
            shadow: GlassShadow::Straight,
            wavelengths: 24,
            paths: 48,
            limits: PathLimits {
                cutoff: 0.01,
                cutoff_color: CutoffColor::Background,
                roulette: Roulette::On,
                reflections: 3,
                refractions: 12,
            },
            sun: 0.53,
            sun_samples: 32,
            first: 0,
            first_path: 0,
            first_sun: 0,
            camera: CameraParams {
                light_width: 0.4,
                light_depth: 0.3,
                radiance: 5.0,
                ambient: 0.25,
                gloss: 128.0,
                aperture: 0.1,
                focus: 3.0,
                gamma: 2.2,
            },
        };
        assert_eq!(params, expected);
        assert_eq!(PARAMS.len(), 27, "this test sets every parameter");
    }

    #[test]
    fn every_value_that_is_offered_is_taken_and_none_beyond() {
        for info in PARAMS {
            offers(info.values, |value| RayParams::default().set(info.name, value).is_ok());
        }
    }

    /// Whether a parameter takes what [`Values`] say, and not what lies beside.
    pub(crate) fn offers(values: Values, takes: impl Fn(&str) -> bool) {
        let both = |inside: [String; 2], outside: [String; 2]| {
            assert!(inside.iter().all(|value| takes(value)), "{inside:?}");
            assert!(outside.iter().all(|value| !takes(value)), "{outside:?}");
        };
        match values {
            Values::Integer(low, high) => both(
                [low, high].map(|value| value.to_string()),
                [i64::from(low) - 1, i64::from(high) + 1].map(|value| value.to_string()),
            ),
            Values::Number(low, high) => both(
                [low, high].map(|value| value.to_string()),
                [low - 0.01, high + 0.01].map(|value| value.to_string()),
            ),
            Values::Positive => {
                both([f32::MIN_POSITIVE, f32::MAX].map(|value| value.to_string()), ["0".to_owned(), "inf".to_owned()]);
            }
            Values::Names(names) => assert!(names.iter().all(|name| takes(name)) && !takes("other"), "{names:?}"),
        }
    }

    #[test]
    fn wrong_parameters_say_what_is_valid() {
        let mut params = RayParams::default();
        assert!(params.set("sampels", "4").unwrap_err().contains("did you mean `samples`?"));
        assert!(params.set("radius", "NaN").unwrap_err().contains("above 0"));
        assert!(params.set("fresnel", "Schlick").unwrap_err().contains("exact, schlick"));
        assert!(params.set("depth", "17").unwrap_err().contains("0..=16"));
        assert!(["0", "257", "-1", "16.0"].iter().all(|count| params.set("wavelengths", count).is_err()));
        assert!(["0", "4097", "-1"].iter().all(|count| params.set("paths", count).is_err()));
        assert!(["-0.1", "1.1", "NaN"].iter().all(|share| params.set("cutoff", share).is_err()));
        assert!(["129", "-1"].iter().all(|count| params.set("reflections", count).is_err()));
        assert!(["-0.1", "90.1", "NaN", "inf"].iter().all(|angle| params.set("sun", angle).is_err()));
        assert!(["0", "65537"].iter().all(|count| params.set("sunsamples", count).is_err()));
        assert_eq!(params, RayParams::default());
    }
}
