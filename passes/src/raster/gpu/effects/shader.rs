//! The shaders of the pixel programs.

use crate::effects::SHADOWED;
use crate::raster::effects::filter::{self, MOST_OFF, SPLINE};
use crate::raster::effects::occlusion::{DEPTH_TOLERANCE, SECTORS};
use crate::raster::effects::planes::NO_PLANE;
use crate::raster::effects::proxy::LEAST_ALONG;
use crate::raster::effects::screen::camera::LEAST_COSINE;
use crate::raster::effects::screen::march::{LEAST_SPAN, ROUNDING, STEP};
use crate::raster::effects::screen::pyramid::{MAX_LEVELS, NOTHING};
use crate::raster::effects::shadow::MAX_SLOPE;
use crate::raster::effects::soft::{FILTER_TAPS, SEARCH_TAPS};
use crate::raster::gpu::shader::cut;
use crate::sampling::hash;
use curitiba_pipeline::backend::{Answers, EffectJob};
use curitiba_pipeline::raster_effects::{Border, EffectProgram, MAX_CASCADES};
use std::fmt::Write;

/// The entry point of every program.
pub const ENTRY: &str = "main";
/// Pixels along a side of a workgroup.
pub const GROUP: u32 = 8;
/// The same where depths are computed: with more threads a group, that little work takes half the time.
pub const DEPTHS_GROUP: u32 = 16;

/// Shared by all programs. It comes last in the text, so that compiler messages count the lines of the program's own
/// file.
const COMMON: &str = include_str!("common.wgsl");

/// The entry point of programs that compute every pixel on its own.
const PIXELS: &str = include_str!("pixels.wgsl");

/// Shared by programs that look up glass triangles.
const GLASS: &str = concat!(include_str!("ranges.wgsl"), include_str!("glass.wgsl"));

/// Shared by programs that look up planes of glass.
const GLAZING: &str = concat!(include_str!("ranges.wgsl"), include_str!("glazing.wgsl"));

/// Shared by programs that read cube maps.
const CUBES: &str = concat!(include_str!("probes.wgsl"), include_str!("ranges.wgsl"), include_str!("glass.wgsl"));

/// Weights of the reflected and the refracted ray of a pane.
const FRESNEL: &str = include_str!("fresnel.wgsl");

/// Shared by the march through the picture and its pyramid, and by occlusions and their depths.
const SCREEN_CAMERA: &str = include_str!("screen_camera.wgsl");

/// Number of sums over which the counts of pixels are distributed, so that few atomic additions collide.
pub const SUMS: u32 = 64;

/// Pixels of a row that one invocation of the survey reads.
pub const SEGMENT: u32 = 16;

/// Squared weight below which a slice does not count, as in `raster::effects::occlusion`.
const LEAST_WEIGHT: f32 = 1e-6;

/// The depth of pixels that show nothing, beyond any radius. Squares of it times the side of a picture are within the range of `f32`.
const FAR: f32 = 1e14;

/// Added to a number below 2²², it rounds that to an integer, which the sum holds in its low bits.
const ROUND: f32 = 12_582_912.0;

/// The choices with which a program is compiled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Variant {
    pub program: EffectProgram,
    /// For shadow maps: the light is a disc. Programs for a point of light are compiled without it.
    pub soft: bool,
    /// For shadow maps: pixels whose tests differ are left to rays.
    pub border: bool,
    /// For `gtao`: by bitmasks instead of horizons.
    pub bitmask: bool,
    /// The filter that follows an ambient occlusion, instead of the occlusion itself.
    pub filter: bool,
}

impl Variant {
    /// The variant of the filter, which all ambient occlusions share.
    pub const FILTER: Self =
        Self { program: EffectProgram::HorizonOcclusion, soft: false, border: false, bitmask: false, filter: true };

    /// The variant that a job asks for.
    pub fn of(job: &EffectJob<'_>) -> Self {
        let is = |program| job.program == program;
        Self {
            program: job.program,
            soft: is(EffectProgram::ShadowMap) && job.params.sun > 0.0,
            border: is(EffectProgram::ShadowMap) && job.params.border == Border::Rays,
            bitmask: is(EffectProgram::HorizonOcclusion) && job.params.bitmask,
            filter: false,
        }
    }
}

fn text(program: EffectProgram) -> (&'static str, &'static str) {
    match program {
        EffectProgram::ShadowMap => ("shadow_map.wgsl", include_str!("shadow_map.wgsl")),
        EffectProgram::CubeReflection | EffectProgram::CubeRefraction => ("cube.wgsl", include_str!("cube.wgsl")),
        EffectProgram::ScreenReflection | EffectProgram::ScreenRefraction => {
            ("screen.wgsl", include_str!("screen.wgsl"))
        }
        EffectProgram::PlanarReflection => ("planar.wgsl", include_str!("planar.wgsl")),
        EffectProgram::DepthOcclusion | EffectProgram::HorizonOcclusion => {
            ("occlusion.wgsl", include_str!("occlusion.wgsl"))
        }
    }
}

/// A program's WGSL, with the constants that it shares with the host.
///
/// # Panics
/// If the directives in its text are malformed; a test generates every program.
pub fn source(Variant { program, soft, border, bitmask, filter }: Variant) -> String {
    let (file, text) = if filter { ("filter.wgsl", include_str!("filter.wgsl")) } else { text(program) };
    let mut source = cut(file, text, |name| {
        Some(match name {
            "REFRACT" => program.refracts(),
            "SOFT" => soft,
            "BORDER" => border,
            "BITMASK" => bitmask,
            "HORIZONS" => program == EffectProgram::HorizonOcclusion,
            _ => return None,
        })
    });
    source.push_str(COMMON);
    if !filter {
        source.push_str(PIXELS);
    }
    match program {
        EffectProgram::CubeReflection | EffectProgram::CubeRefraction => source.push_str(CUBES),
        EffectProgram::ScreenReflection | EffectProgram::ScreenRefraction => {
            source.push_str(CUBES);
            source.push_str(SCREEN_CAMERA);
        }
        EffectProgram::PlanarReflection => source.push_str(GLAZING),
        EffectProgram::DepthOcclusion | EffectProgram::HorizonOcclusion if !filter => source.push_str(SCREEN_CAMERA),
        EffectProgram::ShadowMap | EffectProgram::DepthOcclusion | EffectProgram::HorizonOcclusion => {}
    }
    if program.refracts() {
        source.push_str(FRESNEL);
    }
    push_constants(&mut source);
    source
}

/// Whether a program reads the picture without glass.
pub fn reads_behind(program: EffectProgram) -> bool {
    program == EffectProgram::ScreenRefraction
}

/// The shader that computes a level of the pyramid of nearest surfaces.
pub fn pyramid_source() -> String {
    let mut source = [include_str!("pyramid.wgsl"), SCREEN_CAMERA].concat();
    push_constants(&mut source);
    source
}

/// The shader that computes the depths of an occlusion.
pub fn depths_source() -> String {
    let mut source = [include_str!("depths.wgsl"), SCREEN_CAMERA].concat();
    push_constants(&mut source);
    source
}

/// The shader that surveys the planes of glass.
pub fn survey_source() -> String {
    let mut source = [include_str!("survey.wgsl"), GLAZING].concat();
    push_constants(&mut source);
    source
}

/// The shader that finds out whether any pixel needs maps: a pixel of glass, or one that faces the light.
///
/// # Panics
/// As [`source`].
pub fn ask_source(glass: bool) -> String {
    let mut source = cut("ask.wgsl", include_str!("ask.wgsl"), |name| (name == "GLASS").then_some(glass));
    source.push_str(GLASS);
    push_constants(&mut source);
    source
}

fn push_constants(source: &mut String) {
    // Infinities are not handed to drivers; no program has to distinguish them from large numbers.
    let floats = [
        ("SHADOWED", SHADOWED),
        ("MAX_SLOPE", MAX_SLOPE),
        ("DEPTH_TOLERANCE", DEPTH_TOLERANCE),
        ("LEAST_WEIGHT", LEAST_WEIGHT),
        ("EPSILON", f32::EPSILON),
        ("PI", std::f32::consts::PI),
        ("LARGEST", f32::MAX),
        ("SMALLEST", f32::MIN_POSITIVE),
        ("LEAST_COSINE", LEAST_COSINE),
        ("LEAST_SPAN", LEAST_SPAN),
        ("LEAST_ALONG", LEAST_ALONG),
        ("SECTORS", SECTORS as f32),
        ("SPLINE_0", SPLINE[0]),
        ("SPLINE_1", SPLINE[1]),
        ("SPLINE_2", SPLINE[2]),
        ("LEAST_NORMALS", filter::LEAST_COSINE),
        ("MOST_OFF", MOST_OFF),
        ("STEP", STEP),
        ("ROUNDING", ROUNDING),
        ("NOTHING", NOTHING),
        ("LEFT", Answers::LEFT),
        ("FAR", FAR),
        ("ROUND", ROUND),
    ];
    for (name, value) in floats {
        // Writing to a string does not fail. `{:e}` is the shortest text that reads back as the same number.
        _ = writeln!(source, "const {name} = {value:e}f;");
    }
    let integers = [
        ("MAX_CASCADES", MAX_CASCADES),
        ("SEARCH_TAPS", SEARCH_TAPS as u32),
        ("FILTER_TAPS", FILTER_TAPS as u32),
        ("GROUP", GROUP),
        ("DEPTHS_GROUP", DEPTHS_GROUP),
        ("SEGMENT", SEGMENT),
        ("SUMS", SUMS),
        ("MAX_LEVELS", MAX_LEVELS as u32),
        ("NO_PLANE", NO_PLANE),
        ("ROUND_BITS", ROUND.to_bits()),
        ("HASH_PIXEL", hash::PIXEL),
        ("HASH_DIMENSIONS", hash::DIMENSIONS),
    ];
    for (name, value) in integers {
        _ = writeln!(source, "const {name} = {value}u;");
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use curitiba_pipeline::raster_effects::EFFECT_PROGRAMS;
    use wgpu::naga;

    /// The variant for a point of light.
    pub fn hard(program: EffectProgram) -> Variant {
        Variant { program, soft: false, border: false, bitmask: false, filter: false }
    }

    pub fn validate(source: &str) -> Result<naga::Module, String> {
        let module = naga::front::wgsl::parse_str(source).map_err(|error| error.emit_to_string(source))?;
        naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::empty())
            .validate(&module)
            .map_err(|error| error.emit_to_string(source))?;
        Ok(module)
    }

    #[test]
    fn every_program_parses_and_validates_and_needs_no_feature() {
        for info in EFFECT_PROGRAMS {
            let module = validate(&source(hard(info.program))).unwrap_or_else(|error| panic!("{}\n{error}", info.name));
            let entries: Vec<_> =
                module.entry_points.iter().map(|entry| (entry.name.as_str(), entry.workgroup_size)).collect();
            assert_eq!(entries, [(ENTRY, [GROUP, GROUP, 1])], "{}", info.name);
        }
    }

    #[test]
    fn both_questions_parse_and_validate() {
        for glass in [false, true] {
            validate(&ask_source(glass)).unwrap_or_else(|error| panic!("{error}"));
        }
        assert_ne!(ask_source(false), ask_source(true));
    }

    #[test]
    fn the_pyramid_the_survey_and_the_depths_parse_and_validate() {
        for source in [pyramid_source(), survey_source(), depths_source(), source(Variant::FILTER)] {
            validate(&source).unwrap_or_else(|error| panic!("{error}"));
        }
    }

    #[test]
    fn programs_that_share_a_text_differ() {
        let has = |program, what: &str| source(hard(program)).contains(what);
        assert!(has(EffectProgram::CubeRefraction, "fn fresnel") && !has(EffectProgram::CubeReflection, "fn fresnel"));
        let soft = source(Variant { soft: true, ..hard(EffectProgram::ShadowMap) });
        assert!(soft.contains("fn search_radius") && !has(EffectProgram::ShadowMap, "fn search_radius"));
        assert!(validate(&soft).is_ok());
        let bitmask = source(Variant { bitmask: true, ..hard(EffectProgram::HorizonOcclusion) });
        assert!(bitmask.contains("fn shut_by(") && !has(EffectProgram::HorizonOcclusion, "fn shut_by("));
        validate(&bitmask).unwrap_or_else(|error| panic!("{error}"));
        assert!(has(EffectProgram::HorizonOcclusion, "fn lost(") && !has(EffectProgram::DepthOcclusion, "fn lost("));
    }

    #[test]
    fn an_invalid_program_is_found_out() {
        let source = source(hard(EffectProgram::ShadowMap));
        let broken = source.replace("depth >= stored", "depth >= params.reach");
        assert_ne!(broken, source);
        assert!(validate(&source).is_ok() && validate(&broken).is_err());
    }
}
