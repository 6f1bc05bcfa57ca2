//! The shaders of the pixel programs.

use crate::effects::SHADOWED;
use crate::raster::effects::filter::{self, MOST_OFF, SPLINE};
use crate::raster::effects::occlusion::{DEPTH_TOLERANCE, JITTERS, SECTORS};
use crate::raster::effects::planes::NO_PLANE;
use crate::raster::effects::proxy::LEAST_ALONG;
use crate::raster::effects::screen::camera::{LEAST_COSINE, ScreenCamera};
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
/// Pixels along a side of a workgroup of the programs for depths, occlusions and their filter. Computing depths takes half the time with more
/// threads a workgroup. Occlusions and their filter read texels that neighbouring pixels also read.
pub const LARGE_GROUP: u32 = 16;

/// Shared by all programs. It follows the program's own source, so that line numbers in compiler messages are those of the
/// program's own file.
const COMMON: &str = include_str!("common.wgsl");

/// The entry point of programs that compute each pixel independently of the others.
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

/// Least component of a normal towards the eye, so that a cotangent is finite.
const LEAST_NORMAL: f32 = 1e-6;

/// The depth of pixels that show nothing, beyond any radius. The product of this depth and the side of a picture has a square within the
/// range of `f32`.
const FAR: f32 = 1e14;

/// Adding this to a number below 2²² rounds the number to an integer, which the sum holds in its low bits.
const ROUND: f32 = 12_582_912.0;

/// The choices with which a program is compiled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Variant {
    pub program: EffectProgram,
    /// For shadow maps: the light is a disc. Programs for a point of light are compiled without the code for discs.
    pub soft: bool,
    /// For shadow maps: pixels whose tests differ are left to rays.
    pub border: bool,
    /// For [`EffectProgram::HorizonOcclusion`]: the method by bitmasks instead of the method by horizons.
    pub bitmask: bool,
    /// For occlusions: the camera has perspective.
    pub perspective: bool,
    /// The filter that follows an ambient occlusion, instead of the occlusion itself.
    pub filter: bool,
    /// The output is one number per pixel, for a filter, instead of a colour.
    pub share: bool,
}

impl Variant {
    /// The variant of a program without options, for shadow maps with a point of light.
    pub fn plain(program: EffectProgram) -> Self {
        let (soft, border, bitmask, perspective) = (false, false, false, false);
        Self { program, soft, border, bitmask, perspective, filter: false, share: false }
    }

    /// The filter, which all ambient occlusions share. All levels but the last write one number per pixel.
    pub fn filter(last: bool) -> Self {
        Self { filter: true, share: !last, ..Self::plain(EffectProgram::HorizonOcclusion) }
    }

    /// The variant for a job's program, parameters and camera.
    pub fn of(job: &EffectJob<'_>) -> Self {
        let is = |program| job.program == program;
        let occludes = is(EffectProgram::HorizonOcclusion) || is(EffectProgram::DepthOcclusion);
        Self {
            program: job.program,
            soft: is(EffectProgram::ShadowMap) && job.params.sun > 0.0,
            border: is(EffectProgram::ShadowMap) && job.params.border == Border::Rays,
            bitmask: is(EffectProgram::HorizonOcclusion) && job.params.bitmask,
            perspective: occludes && ScreenCamera::or_blind(&job.view, job.width, job.height).perspective(),
            filter: false,
            share: occludes && job.params.filter > 0,
        }
    }

    /// Pixels along a side of a workgroup.
    pub fn group(self) -> u32 {
        match self.program {
            EffectProgram::DepthOcclusion | EffectProgram::HorizonOcclusion => LARGE_GROUP,
            _ => GROUP,
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
/// If the directives in the program's source are malformed; a test generates every program.
pub fn source(variant: Variant) -> String {
    let Variant { program, soft, border, bitmask, perspective, filter, share } = variant;
    let (file, text) = if filter { ("filter.wgsl", include_str!("filter.wgsl")) } else { text(program) };
    let defines = |name: &str| {
        Some(match name {
            "REFRACT" => program.refracts(),
            "SOFT" => soft,
            "BORDER" => border,
            "BITMASK" => bitmask,
            "HORIZONS" => program == EffectProgram::HorizonOcclusion,
            "PERSPECTIVE" => perspective,
            "SHARE" => share,
            _ => return None,
        })
    };
    let mut source = cut(file, text, defines);
    source.push_str(&cut("common.wgsl", COMMON, defines));
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
    push_constants(&mut source, variant.group());
    source
}

/// Whether a program reads the picture without glass.
pub fn reads_behind(program: EffectProgram) -> bool {
    program == EffectProgram::ScreenRefraction
}

/// The shader that computes a level of the pyramid of nearest surfaces.
pub fn pyramid_source() -> String {
    let mut source = [include_str!("pyramid.wgsl"), SCREEN_CAMERA].concat();
    push_constants(&mut source, GROUP);
    source
}

/// The shader that computes the depths of an occlusion.
pub fn depths_source() -> String {
    let mut source = [include_str!("depths.wgsl"), SCREEN_CAMERA].concat();
    push_constants(&mut source, GROUP);
    source
}

/// The shader that surveys the planes of glass.
pub fn survey_source() -> String {
    let mut source = [include_str!("survey.wgsl"), GLAZING].concat();
    push_constants(&mut source, GROUP);
    source
}

/// The shader that tests whether any pixel needs maps: a pixel of glass, or one that faces the light.
///
/// # Panics
/// As [`source`].
pub fn ask_source(glass: bool) -> String {
    let mut source = cut("ask.wgsl", include_str!("ask.wgsl"), |name| (name == "GLASS").then_some(glass));
    source.push_str(GLASS);
    push_constants(&mut source, GROUP);
    source
}

/// Adds the constants; `group` is the number of pixels along a side of a workgroup.
fn push_constants(source: &mut String, group: u32) {
    // Infinities are not handed to drivers; no program has to distinguish them from large numbers.
    let floats = [
        ("SHADOWED", SHADOWED),
        ("MAX_SLOPE", MAX_SLOPE),
        ("DEPTH_TOLERANCE", DEPTH_TOLERANCE),
        ("LEAST_WEIGHT", LEAST_WEIGHT),
        ("LEAST_NORMAL", LEAST_NORMAL),
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
        ("GROUP", group),
        ("LARGE_GROUP", LARGE_GROUP),
        ("SEGMENT", SEGMENT),
        ("SUMS", SUMS),
        ("MAX_LEVELS", MAX_LEVELS as u32),
        ("NO_PLANE", NO_PLANE),
        ("ROUND_BITS", ROUND.to_bits()),
        ("HASH_OCCLUSION", hash::OCCLUSION),
        ("JITTER_1", JITTERS[0]),
        ("JITTER_2", JITTERS[1]),
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
            let module = validate(&source(Variant::plain(info.program)))
                .unwrap_or_else(|error| panic!("{}\n{error}", info.name));
            let entries: Vec<_> =
                module.entry_points.iter().map(|entry| (entry.name.as_str(), entry.workgroup_size)).collect();
            let group = Variant::plain(info.program).group();
            assert_eq!(entries, [(ENTRY, [group, group, 1])], "{}", info.name);
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
        for source in [
            pyramid_source(),
            survey_source(),
            depths_source(),
            source(Variant::filter(false)),
            source(Variant::filter(true)),
        ] {
            validate(&source).unwrap_or_else(|error| panic!("{error}"));
        }
    }

    #[test]
    fn programs_that_share_a_text_differ() {
        let has = |program, what: &str| source(Variant::plain(program)).contains(what);
        assert!(has(EffectProgram::CubeRefraction, "fn fresnel") && !has(EffectProgram::CubeReflection, "fn fresnel"));
        let soft = source(Variant { soft: true, ..Variant::plain(EffectProgram::ShadowMap) });
        assert!(soft.contains("fn search_radius") && !has(EffectProgram::ShadowMap, "fn search_radius"));
        assert!(validate(&soft).is_ok());
        for program in [EffectProgram::HorizonOcclusion, EffectProgram::DepthOcclusion] {
            for (share, bitmask) in [(false, false), (true, false), (true, true)] {
                let perspective = source(Variant { perspective: true, share, bitmask, ..Variant::plain(program) });
                validate(&perspective).unwrap_or_else(|error| panic!("{error}"));
                assert_eq!(perspective.contains("texture_storage_2d<r32float"), share);
            }
        }
        let bitmask = source(Variant { bitmask: true, ..Variant::plain(EffectProgram::HorizonOcclusion) });
        assert!(bitmask.contains("fn shut_by(") && !has(EffectProgram::HorizonOcclusion, "fn shut_by("));
        validate(&bitmask).unwrap_or_else(|error| panic!("{error}"));
        assert!(has(EffectProgram::HorizonOcclusion, "fn lost(") && !has(EffectProgram::DepthOcclusion, "fn lost("));
    }

    #[test]
    fn an_invalid_program_is_found_out() {
        let source = source(Variant::plain(EffectProgram::ShadowMap));
        let broken = source.replace("depth >= stored", "depth >= params.reach");
        assert_ne!(broken, source);
        assert!(validate(&source).is_ok() && validate(&broken).is_err());
    }
}
