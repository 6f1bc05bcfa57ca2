//! The table of ray programs.

use super::{RayParams, TextureLod};
use crate::glass::{Dielectric, GlassRule, GlassShadow, Roulette};

/// Program of a ray pass, run per pixel. The file stem of its program file names it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum RayProgram {
    /// Copies the colour: measures the cost of coupling rasteriser and ray tracer.
    Dummy,
    /// Shadows of a directional light.
    DeferredShadows,
    /// Mirror reflection in glass.
    Reflection,
    /// Reflection and refraction in glass.
    Refraction,
    /// Ambient occlusion.
    Ssao,
    /// Shadows, occlusion, reflection and refraction, at every hit.
    Final,
    /// Camera rays: unlit colours.
    Albedo,
    /// Camera rays: colours lit without shadows.
    Lambert,
    /// Camera rays: Whitted ray tracing with shadows, mirrors and glass.
    Whitted,
    /// Camera rays: ambient occlusion.
    CameraOcclusion,
    /// Camera rays: path tracing, with light reflected between surfaces.
    PathTracing,
}

/// A device program that a project names: `<optixProgram type ray file proc/>`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ProcInfo {
    /// `Closest_Hit`, `Any_Hit` or `Miss`.
    pub kind: &'static str,
    /// Ray type: `Phong` (radiance) or `Shadow`.
    pub ray: &'static str,
    /// Name of the device program.
    pub proc: &'static str,
    /// Whether the default material of a pass must name it; otherwise single materials may.
    pub required: bool,
}

/// When a ray program traces rays, and so needs an acceleration structure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Traces {
    /// Never.
    Nothing,
    /// At every pixel that it computes: at least shadow rays.
    ShadowRays,
    /// Where it takes occlusion samples: with `samples` above 0.
    Samples,
    /// At pixels that show glass.
    FromGlass,
    /// At every pixel, from the camera; it reads no G-buffer.
    FromCamera,
}

/// What a program's output is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Writes {
    /// A linear colour.
    Color,
    /// A share from 0 to 1, the same in red, green and blue.
    Share,
}

/// A ray program: the inputs that a project must provide, and its output.
///
/// Programs are distinguished only by the entries of this table: plan, executor, reports, benchmarks and help read it.
#[derive(Debug, Clone, Copy)]
pub struct RayProgramInfo {
    /// The program.
    pub program: RayProgram,
    /// Stem of the program file, as in `optix/final.ptx`.
    pub stem: &'static str,
    /// Name in benchmark ids and reports.
    pub short: &'static str,
    /// When it traces rays.
    pub traces: Traces,
    /// Kind of its output.
    pub writes: Writes,
    /// Name of the ray-generation program. Empty for programs whose rays start at the camera: passes name those by `program`.
    pub entry: &'static str,
    /// Its output, in one sentence.
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
    /// Parameters that it reads, by their names in [`PARAMS`](super::PARAMS).
    pub params: &'static [&'static str],
}

const fn required(kind: &'static str, ray: &'static str, proc: &'static str) -> ProcInfo {
    ProcInfo { kind, ray, proc, required: true }
}

const fn optional(kind: &'static str, ray: &'static str, proc: &'static str) -> ProcInfo {
    ProcInfo { kind, ray, proc, required: false }
}

/// The device programs that every program file contains, by the type under which projects name them. Not all of them are called: ray
/// tracers intersect triangles themselves, so the names of `Geometry_Intersection` and `Bounding_Box` are accepted and nothing more.
pub const PROCS: &[(&str, &[&str])] = &[
    ("RayGen", &["buffer_camera"]),
    ("Exception", &["exception"]),
    ("Closest_Hit", &["closest_hit", "closest_hit_glass"]),
    ("Any_Hit", &["any_hit_shadow", "any_hit_shadow_glass"]),
    ("Miss", &["miss", "miss_shadow"]),
    ("Geometry_Intersection", &["geometryintersection"]),
    ("Bounding_Box", &["boundingbox"]),
];

/// The names of a type in [`PROCS`]; case does not matter. `None` for an unknown type.
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
        params: &["sun", "sunsamples", "filter"],
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
        params: &["depth", "background", "texturelod"],
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
            "error",
            "cutoff",
            "cutoffcolor",
            "roulette",
            "reflections",
            "refractions",
            "texturelod",
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
        params: &["samples", "radius", "intensity", "sampler", "filter"],
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
            "photons",
            "photonradius",
            "wavelengths",
            "paths",
            "error",
            "cutoff",
            "cutoffcolor",
            "roulette",
            "reflections",
            "refractions",
            "sun",
            "sunsamples",
            "texturelod",
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
        params: &["samples", "aperture", "focus", "background", "gamma", "texturelod"],
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
        params: &["samples", "aperture", "focus", "background", "gamma", "texturelod", "ambient"],
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
            "texturelod",
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
        params: &["samples", "aperture", "focus", "background", "gamma", "texturelod", "radius"],
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
            "texturelod",
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
    /// The program's entry in [`RAY_PROGRAMS`].
    #[must_use]
    pub fn info(self) -> &'static RayProgramInfo {
        RAY_PROGRAMS.iter().find(|info| info.program == self).expect("every program has an entry")
    }

    /// The glass features that these parameters ask for beyond the report's panes, for scenes with glass; `None` if there are none.
    #[must_use]
    pub fn asks_of_glass(self, params: &RayParams) -> Option<String> {
        let reads = |name: &str| self.info().reads(name);
        let asked = [
            (reads("glass") && params.glass != GlassRule::Pane, "glass"),
            (reads("shadow") && params.shadow != GlassShadow::Report, "shadow"),
        ];
        let names: Vec<String> =
            asked.iter().filter(|(asked, _)| *asked).map(|(_, name)| format!("{name}={}", params.get(name))).collect();
        (!names.is_empty()).then(|| names.join(" "))
    }

    /// The light's disc that these parameters ask for, in words; `None` for a light without a disc.
    #[must_use]
    pub fn asks_of_sun(self, params: &RayParams) -> Option<String> {
        (self.info().sun_samples(params) > 0).then(|| format!("sun={}", params.sun))
    }

    /// The filter that a pass with these parameters asks for, in words; `None` where nothing is filtered.
    #[must_use]
    pub fn asks_of_filter(self, params: &RayParams) -> Option<String> {
        (self.info().filter_levels(params) > 0).then(|| format!("filter={}", params.filter))
    }

    /// The filter of texture lookups at hits that these parameters ask for, in words; `None` for lookups at level 0.
    #[must_use]
    pub fn asks_of_cones(self, params: &RayParams) -> Option<String> {
        let asks = self.info().reads("texturelod") && params.texture_lod != TextureLod::Zero;
        asks.then(|| format!("texturelod={}", params.texture_lod.name()))
    }

    /// The error that adaptive sampling of glass aims at with these parameters; `None` where every pixel has the same number of paths.
    #[must_use]
    pub fn sampled_to(self, params: &RayParams) -> Option<f32> {
        let asks = params.error > 0.0 && self.info().reads("error") && params.glass == GlassRule::Auto;
        asks.then_some(params.error)
    }

    /// Number of photons that are shot at glass meshes with these parameters; 0 where light goes straight through meshes.
    #[must_use]
    pub fn photons(self, params: &RayParams) -> u32 {
        let asks =
            self.info().reads("photons") && params.glass == GlassRule::Auto && params.shadow == GlassShadow::Caustic;
        if asks { params.photons } else { 0 }
    }

    /// Whether the parameter `name` of [`PARAMS`](super::PARAMS) has an effect together with `params`. The program must read it; photon
    /// parameters have an effect only if the rules for glass and its shadow use photons.
    #[must_use]
    pub fn heeds(self, name: &str, params: &RayParams) -> bool {
        let of_photons = matches!(name, "photons" | "photonradius");
        self.info().reads(name) && (!of_photons || self.photons(&RayParams { photons: 1, ..*params }) > 0)
    }

    /// Whether a pixel's colour is stochastic with these parameters and materials ([`RayJob::dielectrics`]): rough glass, glass with
    /// dispersion, or Russian roulette.
    ///
    /// [`RayJob::dielectrics`]: crate::backend::RayJob::dielectrics
    #[must_use]
    pub fn has_stochastic_glass(self, params: &RayParams, dielectrics: &[Dielectric]) -> bool {
        let roulette = params.limits.cutoff > 0.0 && params.limits.roulette == Roulette::On;
        let stochastic =
            |glass: &Dielectric| glass.alpha > 0.0 || glass.spread > 0.0 && params.wavelengths > 1 || roulette;
        self.info().reads("paths") && dielectrics.iter().any(stochastic)
    }

    /// Whether the program traces rays with these parameters, if the scene has glass.
    #[must_use]
    pub fn can_trace(self, params: &RayParams) -> bool {
        self.info().needs_structure(params, true).0
    }
}

impl RayProgramInfo {
    /// Whether the program reads a parameter of [`PARAMS`](super::PARAMS).
    #[must_use]
    pub fn reads(&self, param: &str) -> bool {
        self.params.contains(&param)
    }

    /// Whether projects may name this hit or miss program together with the program.
    #[must_use]
    pub fn names(&self, proc: &str) -> bool {
        self.procs.iter().any(|info| info.proc == proc)
    }

    /// Whether its rays start at the camera: it reads no G-buffer, and passes name it by `program`.
    #[must_use]
    pub fn starts_at_camera(&self) -> bool {
        self.traces == Traces::FromCamera
    }

    /// The parameters of a pass that sets none.
    #[must_use]
    pub fn defaults(&self) -> RayParams {
        let defaults = RayParams::default();
        if self.starts_at_camera() { RayParams { samples: 0, index: 1.5, ..defaults } } else { defaults }
    }

    /// Number of occlusion rays per shaded point, 0 if the program traces none; for programs whose rays start at the camera, the
    /// number of camera rays per pixel.
    #[must_use]
    pub fn samples(&self, params: &RayParams) -> u32 {
        match () {
            () if self.starts_at_camera() => params.samples.max(1),
            () if self.reads("samples") => params.samples,
            () => 0,
        }
    }

    /// Number of shadow rays over the light's disc per lit point; 0 for a light without a disc.
    #[must_use]
    pub fn sun_samples(&self, params: &RayParams) -> u32 {
        if self.reads("sun") && params.sun > 0.0 { params.sun_samples } else { 0 }
    }

    /// Levels of the filter over the program's output; 0 where nothing is filtered. A share without samples of occlusion or of the
    /// light's disc has no noise.
    #[must_use]
    pub fn filter_levels(&self, params: &RayParams) -> u32 {
        if self.reads("filter") && self.has_noise(params) { params.filter } else { 0 }
    }

    /// Whether the program takes random samples of occlusion or of the light's disc.
    #[must_use]
    pub fn has_noise(&self, params: &RayParams) -> bool {
        self.samples(params) > 0 || self.sun_samples(params) > 0
    }

    /// Whether the program needs an acceleration structure, and why. `finds_glass` says whether any pixel may show glass.
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
