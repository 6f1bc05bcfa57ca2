//! The table of raster effects: they compute what a ray program computes, with raster maps and loops over the G-buffer.
//!
//! A pass of `class="effect"` names one of these programs. It reads and writes the same as the ray pass that it replaces, so that a
//! project can use either of the two passes. Help, XML validation, `curitiba list`, reports and tests iterate these tables.

use crate::programs::{Fresnel, LARGEST_SUN, MAX_FILTER_LEVELS, ParamInfo, RayParams, RayProgram, TextureLod, Values};

/// Greatest number of shadow maps that a frame may have.
pub const MAX_CASCADES: u32 = 8;
/// Greatest number of mirrors that a frame may have.
pub const MAX_PLANES: u32 = 64;
/// Greatest number of texels a side of maps that are fitted to a picture. Each shadow map takes 4 bytes a texel, each cube map six times 16.
const MOST_FITTED: u32 = 2048;

/// The program of an effect pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum EffectProgram {
    /// Shadows of a directional light from cascaded depth maps.
    ShadowMap,
    /// Reflection in glass from cube maps.
    CubeReflection,
    /// Reflection and refraction in glass from cube maps.
    CubeRefraction,
    /// Reflection in flat glass from mirrored cameras.
    PlanarReflection,
    /// Reflection in glass of the surfaces that the picture shows.
    ScreenReflection,
    /// Reflection and refraction in glass of the surfaces that the picture shows, or would show without the glass.
    ScreenRefraction,
    /// Ambient occlusion by the difference of depths.
    DepthOcclusion,
    /// Ambient occlusion by horizons: GTAO.
    HorizonOcclusion,
}

/// What glass shows where screen space does not determine what a ray hits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Missing {
    /// What a cube map shows in the ray's direction.
    #[default]
    Cube,
    /// The glass's own colour.
    Own,
    /// The counterpart program computes the whole pixel on the ray backend.
    Rays,
}

named!(Missing, "cube" => Cube, "none" => Own, "rays" => Rays);

/// What a pixel shows if the tests of the shadow map around its position do not agree on whether it is in light or in shadow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Border {
    /// The mean of the map's tests, as at every other pixel.
    #[default]
    Map,
    /// The counterpart program computes the pixel on the ray backend.
    Rays,
}

named!(Border, "map" => Map, "rays" => Rays);

/// How a cube map is looked up from a position that is not its centre.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Parallax {
    /// In the ray's own direction, as if the surroundings were infinitely far away.
    #[default]
    None,
    /// In the direction from the centre to the point where the ray leaves a box that approximates the surroundings.
    Box,
}

named!(Parallax, "none" => None, "box" => Box);

/// The parameters of the raster effects; a program reads those that [`EffectProgramInfo::params`] lists for it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EffectParams {
    /// Texels a side of each shadow map, or of each face of a cube map. 0 fits them to the picture: a plan replaces it with
    /// [`Self::fitted_map_size`], so an [`EffectJob`](crate::backend::EffectJob) always has a number of texels.
    pub map_size: u32,
    /// Greatest number of shadow maps of a frame. Maps nearer to the camera cover less than farther ones, and are finer.
    pub cascades: u32,
    /// Texels on each side of the middle one that a shadow test averages: 0 tests one texel, 1 tests 3 x 3.
    pub pcf: u32,
    /// Depth bias of a shadow test, in texels of the map along the surface's slope.
    pub bias: f32,
    /// Greatest number of cube maps of a frame.
    pub probes: u32,
    /// Greatest number of mirrors of a frame, each a plane of glass.
    pub planes: u32,
    /// Index of refraction of a whole pane.
    pub index: f32,
    /// Model of the share of light that a pane reflects.
    pub fresnel: Fresnel,
    /// Longest distance to an occluder, scene units.
    pub radius: f32,
    /// Exponent applied to the unoccluded share of directions.
    pub intensity: f32,
    /// Number of directions in the picture along which occluders are searched.
    pub slices: u32,
    /// Number of depths that are read along a direction, on each side of the pixel.
    pub steps: u32,
    /// Angular diameter of the light's disc, in degrees: 0 is a point, whose shadows are hard.
    pub sun: f32,
    /// Depth behind a visible surface up to which a ray still hits it, scene units.
    pub thickness: f32,
    /// What replaces rays whose hit screen space does not determine.
    pub missing: Missing,
    /// How cube maps are looked up.
    pub parallax: Parallax,
    /// Whether a visible surface occludes only the directions between its front and its back, `thickness` behind, instead of all below a
    /// horizon.
    pub bitmask: bool,
    /// Levels of the edge-avoiding filter after an occlusion; 0 filters nothing.
    pub filter: u32,
    /// What pixels at the border of a shadow show.
    pub border: Border,
    /// Mip level at which rays in place of the effect read textures at hits: for pixels that the effect leaves to rays, and for reference
    /// pictures.
    pub texture_lod: TextureLod,
}

impl Default for EffectParams {
    /// The report's constants where the report has them.
    fn default() -> Self {
        Self {
            map_size: 0,
            cascades: 4,
            pcf: 1,
            bias: 1.5,
            probes: 4,
            planes: 16,
            index: 1.1,
            fresnel: Fresnel::Exact,
            radius: 0.5,
            intensity: 1.6,
            slices: 4,
            steps: 8,
            sun: 0.0,
            thickness: 0.1,
            missing: Missing::Cube,
            parallax: Parallax::None,
            bitmask: false,
            filter: 0,
            border: Border::Map,
            texture_lod: TextureLod::Cones,
        }
    }
}

/// Every parameter of a raster effect.
pub const EFFECT_PARAMS: &[ParamInfo] = &[
    ParamInfo {
        name: "mapsize",
        about: "texels a side of each shadow map or cube-map face; 0 fits them to the picture",
        valid: "0 or 16..=16384",
        values: Values::Integer(0, 16_384),
    },
    ParamInfo {
        name: "cascades",
        about: "most shadow maps of a frame, the nearer the finer",
        valid: "1..=8",
        values: Values::Integer(1, MAX_CASCADES),
    },
    ParamInfo {
        name: "pcf",
        about: "texels on each side that a shadow test averages",
        valid: "0..=8",
        values: Values::Integer(0, 8),
    },
    ParamInfo {
        name: "bias",
        about: "depth bias of a shadow test, texels along the slope",
        valid: "0..=100",
        values: Values::Number(0.0, 100.0),
    },
    ParamInfo { name: "probes", about: "most cube maps of a frame", valid: "1..=64", values: Values::Integer(1, 64) },
    ParamInfo {
        name: "planes",
        about: "most planes of glass that mirror in a frame, those of the most pixels first",
        valid: "1..=64",
        values: Values::Integer(1, MAX_PLANES),
    },
    ParamInfo {
        name: "index",
        about: "index of refraction that stands for a whole pane",
        valid: "0.1..=10",
        values: Values::Number(0.1, 10.0),
    },
    ParamInfo {
        name: "fresnel",
        about: "how much glass reflects by its angle",
        valid: "exact, schlick, s, p",
        values: Values::Names(&["exact", "schlick", "s", "p"]),
    },
    ParamInfo {
        name: "radius",
        about: "longest distance to an occluder, in scene units",
        valid: "a finite number above 0",
        values: Values::Positive,
    },
    ParamInfo {
        name: "intensity",
        about: "exponent of the open share",
        valid: "0..=100",
        values: Values::Number(0.0, 100.0),
    },
    ParamInfo {
        name: "slices",
        about: "directions in which occluders are looked for",
        valid: "1..=64",
        values: Values::Integer(1, 64),
    },
    ParamInfo {
        name: "steps",
        about: "depths read in each half of a direction",
        valid: "1..=64",
        values: Values::Integer(1, 64),
    },
    ParamInfo {
        name: "sun",
        about: "angular diameter of the light's disc, in degrees, for soft shadows; 0 is a point, and the sun of the sky 0.53",
        valid: "0..=90 (thesis fidelity: 0)",
        values: Values::Number(0.0, LARGEST_SUN),
    },
    ParamInfo {
        name: "thickness",
        about: "how deep behind a surface that the picture shows a ray still meets it, in scene units; of `gtao` with `bitmask` alone",
        valid: "a finite number above 0",
        values: Values::Positive,
    },
    ParamInfo {
        name: "missing",
        about: "what stands for rays that the screen does not answer: cube maps, the glass's own colour, or ray tracing of these pixels",
        valid: "cube, none, rays",
        values: Values::Names(&["cube", "none", "rays"]),
    },
    ParamInfo {
        name: "parallax",
        about: "how cube maps are looked up beside their centre: in the ray's direction, or where the ray leaves a box found from what the map sees",
        valid: "none, box",
        values: Values::Names(&["none", "box"]),
    },
    ParamInfo {
        name: "bitmask",
        about: "whether light passes behind what the picture shows: occluders are `thickness` deep, instead of shutting all below their horizon",
        valid: "false, true",
        values: Values::Names(&["false", "true"]),
    },
    ParamInfo {
        name: "filter",
        about: "levels of the filter that averages an occlusion over its surface: 5 x 5 pixels, then 13 x 13 and 29 x 29; 0 filters nothing",
        valid: "0..=3",
        values: Values::Integer(0, MAX_FILTER_LEVELS),
    },
    ParamInfo {
        name: "border",
        about: "what a pixel shows whose shadow tests differ, at the border of a shadow: their mean, or ray tracing of these pixels",
        valid: "map, rays (rays: `sun` 0, corrected fidelity)",
        values: Values::Names(&["map", "rays"]),
    },
    ParamInfo {
        name: "texturelod",
        about: "at which mip level rays in the place of the effect read textures at hits: those of pixels that are left to rays, and of its \
                reference",
        valid: "zero, cones",
        values: Values::Names(&["zero", "cones"]),
    },
];

impl EffectParams {
    /// Texels a side of a program's maps that fit a picture of this size. A shadow map has the longer side, rounded up to a power of two
    /// (256 to 2048). A face of a cube map has half of that (64 to 1024), since it spans a right angle. 1024 x 1024 pixels give 1024 and 512.
    #[must_use]
    pub fn fitted_map_size(program: EffectProgram, [width, height]: [u32; 2]) -> u32 {
        let side = width.max(height).clamp(1, MOST_FITTED).next_power_of_two();
        if program.info().params.contains(&"probes") { (side / 2).max(64) } else { side.max(256) }
    }

    /// Whether a program leaves pixels to its counterpart on the ray backend.
    #[must_use]
    pub fn leaves_to_rays(&self, program: EffectProgram) -> bool {
        let reads = |name: &str| program.info().params.contains(&name);
        (reads("missing") && self.missing == Missing::Rays) || (reads("border") && self.border == Border::Rays)
    }

    /// Parameters for the ray program in place of the effect: those that both have are copied, the others have their defaults.
    #[must_use]
    pub fn by_rays(&self) -> RayParams {
        let Self { index, fresnel, radius, intensity, sun, texture_lod, .. } = *self;
        RayParams { index, fresnel, radius, intensity, sun, texture_lod, ..RayParams::default() }
    }

    /// Sets a parameter by its name in [`EFFECT_PARAMS`].
    ///
    /// # Errors
    /// If the name or the value is invalid; the message says what would be valid.
    pub fn set(&mut self, name: &str, value: &str) -> Result<(), String> {
        let Some(info) = EFFECT_PARAMS.iter().find(|info| info.name == name) else {
            return Err(crate::diagnostic::valid_names(name, EFFECT_PARAMS.iter().map(|info| info.name)));
        };
        let wrong = || format!("`{name}` is {}; valid: {}", info.about, info.valid);
        let float = |valid: fn(f32) -> bool| value.parse::<f32>().ok().filter(|v| valid(*v)).ok_or_else(wrong);
        let integer = |valid: std::ops::RangeInclusive<u32>| {
            value.parse::<u32>().ok().filter(|value| valid.contains(value)).ok_or_else(wrong)
        };
        match name {
            "mapsize" if value == "0" => self.map_size = 0,
            "mapsize" => self.map_size = integer(16..=16_384)?,
            "cascades" => self.cascades = integer(1..=MAX_CASCADES)?,
            "pcf" => self.pcf = integer(0..=8)?,
            "bias" => self.bias = float(|v| (0.0..=100.0).contains(&v))?,
            "probes" => self.probes = integer(1..=64)?,
            "planes" => self.planes = integer(1..=MAX_PLANES)?,
            "index" => self.index = float(|v| (0.1..=10.0).contains(&v))?,
            "fresnel" => self.fresnel = Fresnel::named(value).ok_or_else(wrong)?,
            "radius" => self.radius = float(|v| v.is_finite() && v > 0.0)?,
            "intensity" => self.intensity = float(|v| (0.0..=100.0).contains(&v))?,
            "slices" => self.slices = integer(1..=64)?,
            "steps" => self.steps = integer(1..=64)?,
            "sun" => self.sun = float(|v| (0.0..=LARGEST_SUN).contains(&v))?,
            "thickness" => self.thickness = float(|v| v.is_finite() && v > 0.0)?,
            "missing" => self.missing = Missing::named(value).ok_or_else(wrong)?,
            "parallax" => self.parallax = Parallax::named(value).ok_or_else(wrong)?,
            "filter" => self.filter = integer(0..=MAX_FILTER_LEVELS)?,
            "bitmask" => self.bitmask = value.parse().map_err(|_| wrong())?,
            "border" => self.border = Border::named(value).ok_or_else(wrong)?,
            "texturelod" => self.texture_lod = TextureLod::named(value).ok_or_else(wrong)?,
            _ => unreachable!("every name in EFFECT_PARAMS is matched"),
        }
        Ok(())
    }

    /// The value of a parameter as text.
    ///
    /// # Panics
    /// If the name is not in [`EFFECT_PARAMS`].
    #[must_use]
    pub fn get(&self, name: &str) -> String {
        match name {
            "mapsize" => self.map_size.to_string(),
            "cascades" => self.cascades.to_string(),
            "pcf" => self.pcf.to_string(),
            "bias" => self.bias.to_string(),
            "probes" => self.probes.to_string(),
            "planes" => self.planes.to_string(),
            "index" => self.index.to_string(),
            "fresnel" => self.fresnel.name().to_owned(),
            "radius" => self.radius.to_string(),
            "intensity" => self.intensity.to_string(),
            "slices" => self.slices.to_string(),
            "steps" => self.steps.to_string(),
            "sun" => self.sun.to_string(),
            "thickness" => self.thickness.to_string(),
            "missing" => self.missing.name().to_owned(),
            "parallax" => self.parallax.name().to_owned(),
            "bitmask" => self.bitmask.to_string(),
            "filter" => self.filter.to_string(),
            "border" => self.border.name().to_owned(),
            "texturelod" => self.texture_lod.name().to_owned(),
            _ => panic!("`{name}` is not a parameter"),
        }
    }
}

/// A raster effect, and the inputs that a project must provide.
#[derive(Debug, Clone, Copy)]
pub struct EffectProgramInfo {
    /// The program.
    pub program: EffectProgram,
    /// Its name in `<program name="…"/>`.
    pub name: &'static str,
    /// What it computes, in one sentence.
    pub about: &'static str,
    /// The ray program that computes the same by rays.
    pub counterpart: RayProgram,
    /// Variables of `<input>` that it reads: `pos_buffer`, `norm_buffer`, `color_buffer`.
    pub buffers: &'static [&'static str],
    /// Whether it reads the light.
    pub lit: bool,
    /// Whether it identifies pixels that show glass, by their triangle ids.
    pub glass: bool,
    /// Parameters that it reads, by their names in [`EFFECT_PARAMS`].
    pub params: &'static [&'static str],
}

/// Every raster effect.
pub const EFFECT_PROGRAMS: &[EffectProgramInfo] = &[
    EffectProgramInfo {
        program: EffectProgram::ShadowMap,
        name: "shadowMap",
        about: "shadow of a directional light from cascaded depth maps: 0.5 in shadow, 1 in light; soft with `sun` above 0, exact where `border` is rays",
        counterpart: RayProgram::DeferredShadows,
        buffers: &["pos_buffer", "norm_buffer"],
        lit: true,
        glass: false,
        params: &["mapsize", "cascades", "pcf", "bias", "sun", "border"],
    },
    EffectProgramInfo {
        program: EffectProgram::CubeReflection,
        name: "cubeReflection",
        about: "reflection in glass from cube maps centred on the panes; other pixels keep their colour",
        counterpart: RayProgram::Reflection,
        buffers: &["pos_buffer", "norm_buffer", "color_buffer"],
        lit: true,
        glass: true,
        params: &["mapsize", "probes", "parallax", "texturelod"],
    },
    EffectProgramInfo {
        program: EffectProgram::CubeRefraction,
        name: "cubeRefraction",
        about: "reflection and refraction in glass from cube maps centred on the panes; other pixels keep their colour",
        counterpart: RayProgram::Refraction,
        buffers: &["pos_buffer", "norm_buffer", "color_buffer"],
        lit: true,
        glass: true,
        params: &["mapsize", "probes", "parallax", "index", "fresnel", "texturelod"],
    },
    EffectProgramInfo {
        program: EffectProgram::PlanarReflection,
        name: "planarReflection",
        about: "reflection in flat glass from cameras mirrored at its planes; other pixels, and glass that is not flat, keep their colour",
        counterpart: RayProgram::Reflection,
        buffers: &["pos_buffer", "norm_buffer", "color_buffer"],
        lit: true,
        glass: true,
        params: &["planes", "texturelod"],
    },
    EffectProgramInfo {
        program: EffectProgram::ScreenReflection,
        name: "screenReflection",
        about: "reflection in glass of what the picture shows; `missing` stands for the rest, and other pixels keep their colour",
        counterpart: RayProgram::Reflection,
        buffers: &["pos_buffer", "norm_buffer", "color_buffer"],
        lit: true,
        glass: true,
        params: &["thickness", "missing", "mapsize", "probes", "parallax", "texturelod"],
    },
    EffectProgramInfo {
        program: EffectProgram::ScreenRefraction,
        name: "screenRefraction",
        about: "reflection and refraction in glass of what the picture shows without the glass; `missing` stands for the rest, and other pixels keep their colour",
        counterpart: RayProgram::Refraction,
        buffers: &["pos_buffer", "norm_buffer", "color_buffer"],
        lit: true,
        glass: true,
        params: &["thickness", "missing", "mapsize", "probes", "parallax", "index", "fresnel", "texturelod"],
    },
    EffectProgramInfo {
        program: EffectProgram::DepthOcclusion,
        name: "depthOcclusion",
        about: "ambient occlusion by the difference of depths alone, with its error where near things cross far ones",
        counterpart: RayProgram::Ssao,
        buffers: &["pos_buffer", "norm_buffer"],
        lit: false,
        glass: false,
        params: &["radius", "intensity", "slices", "steps", "filter"],
    },
    EffectProgramInfo {
        program: EffectProgram::HorizonOcclusion,
        name: "gtao",
        about: "ambient occlusion by the horizons that the G-buffer shows (GTAO), or with `bitmask` by the sectors that what it shows shuts",
        counterpart: RayProgram::Ssao,
        buffers: &["pos_buffer", "norm_buffer"],
        lit: false,
        glass: false,
        params: &["radius", "intensity", "slices", "steps", "bitmask", "thickness", "filter"],
    },
];

impl EffectProgram {
    /// Its entry in [`EFFECT_PROGRAMS`].
    #[must_use]
    pub fn info(self) -> &'static EffectProgramInfo {
        EFFECT_PROGRAMS.iter().find(|info| info.program == self).expect("every program has an entry")
    }

    /// Whether its maps show shaded surfaces, so that materials and textures are needed.
    #[must_use]
    pub fn shades_maps(self) -> bool {
        self.info().glass
    }

    /// Whether it marches rays through the picture.
    #[must_use]
    pub fn marches(self) -> bool {
        matches!(self, Self::ScreenReflection | Self::ScreenRefraction)
    }

    /// Whether it leaves pixels to rays with some value of its parameters.
    #[must_use]
    pub fn may_leave_to_rays(self) -> bool {
        self.info().params.iter().any(|name| matches!(*name, "missing" | "border"))
    }

    /// Whether it shows what is behind glass, too.
    #[must_use]
    pub fn refracts(self) -> bool {
        matches!(self, Self::CubeRefraction | Self::ScreenRefraction)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_that_is_offered_is_taken_and_none_beyond() {
        for info in EFFECT_PARAMS {
            crate::programs::tests::offers(info.values, |value| EffectParams::default().set(info.name, value).is_ok());
        }
    }

    #[test]
    fn every_parameter_is_settable_by_its_name_and_read_by_a_program() {
        let mut params = EffectParams::default();
        for (info, value) in EFFECT_PARAMS.iter().zip([
            "64", "2", "3", "2.5", "7", "5", "1.5", "schlick", "2", "1", "9", "11", "0.5", "3", "rays", "box", "true",
            "2", "rays", "zero",
        ]) {
            assert_ne!(params.get(info.name), value);
            params.set(info.name, value).expect("valid");
            assert_eq!(params.get(info.name), value);
            assert!(EFFECT_PROGRAMS.iter().any(|program| program.params.contains(&info.name)), "{}", info.name);
        }
    }

    #[test]
    fn maps_fit_the_picture() {
        use EffectProgram::{CubeReflection, ScreenRefraction, ShadowMap};
        let fitted =
            |size| [ShadowMap, CubeReflection, ScreenRefraction].map(|p| EffectParams::fitted_map_size(p, size));
        assert_eq!(fitted([1024, 1024]), [1024, 512, 512]);
        assert_eq!(fitted([1080, 1920]), [2048, 1024, 1024]);
        assert_eq!(fitted([512, 300]), [512, 256, 256]);
        assert_eq!([fitted([1, 1]), fitted([0, 0])], [[256, 64, 64]; 2]);
        assert_eq!(fitted([u32::MAX, 1]), [2048, 1024, 1024]);
    }

    #[test]
    fn only_what_a_program_reads_leaves_pixels_to_rays() {
        let rays = EffectParams { missing: Missing::Rays, border: Border::Rays, ..EffectParams::default() };
        for info in EFFECT_PROGRAMS {
            assert_eq!(rays.leaves_to_rays(info.program), info.program.may_leave_to_rays(), "{}", info.name);
            assert!(!EffectParams::default().leaves_to_rays(info.program), "{}", info.name);
        }
        assert!(EffectParams { missing: Missing::Cube, ..rays }.leaves_to_rays(EffectProgram::ShadowMap));
        assert!(!EffectParams { missing: Missing::Cube, ..rays }.leaves_to_rays(EffectProgram::ScreenReflection));
    }

    #[test]
    fn wrong_parameters_say_what_is_valid() {
        let mut params = EffectParams::default();
        assert!(params.set("mapsiez", "4").unwrap_err().contains("did you mean `mapsize`?"));
        assert!(params.set("mapsize", "8").unwrap_err().contains("0 or 16..=16384"));
        assert!(params.set("cascades", "0").unwrap_err().contains("1..=8"));
        assert!(params.set("radius", "NaN").unwrap_err().contains("above 0"));
        assert_eq!(params, EffectParams::default());
    }
}
