//! The shaders of the pixel programs, and the uniforms that they read.

use crate::effects::SHADOWED;
use crate::raster::effects::cascades::Cascades;
use crate::raster::effects::cube::{AXES, FACES};
use crate::raster::effects::filter::{self, MOST_OFF, SPLINE};
use crate::raster::effects::mirrors::Mirror;
use crate::raster::effects::occlusion::{DEPTH_TOLERANCE, SECTORS};
use crate::raster::effects::panes::Probe;
use crate::raster::effects::planes::NO_PLANE;
use crate::raster::effects::proxy::LEAST_ALONG;
use crate::raster::effects::screen::camera::{LEAST_COSINE, ScreenCamera};
use crate::raster::effects::screen::march::{LEAST_SPAN, ROUNDING, STEP};
use crate::raster::effects::screen::pyramid::{Level, MAX_LEVELS, NOTHING};
use crate::raster::effects::shadow::MAX_SLOPE;
use crate::raster::effects::soft::{FILTER_TAPS, SEARCH_TAPS, TAPS, Tap};
use crate::raster::gpu::shader::cut;
use crate::sampling::hash;
use curitiba_pipeline::backend::{Answers, EffectJob};
use curitiba_pipeline::programs::Fresnel;
use curitiba_pipeline::raster_effects::{EffectProgram, MAX_CASCADES, Missing};
use glam::{Mat4, Vec4};
use std::fmt::Write;

/// The entry point of every program.
pub const ENTRY: &str = "main";
/// Pixels along a side of a workgroup.
pub const GROUP: u32 = 8;

/// Shared by all programs. It comes last in the text, so that compiler messages count the lines of the program's own
/// file.
const COMMON: &str = include_str!("common.wgsl");

/// Shared by programs that look up glass triangles.
const GLASS: &str = concat!(include_str!("ranges.wgsl"), include_str!("glass.wgsl"));

/// Shared by programs that look up planes of glass.
const GLAZING: &str = concat!(include_str!("ranges.wgsl"), include_str!("glazing.wgsl"));

/// Shared by programs that read cube maps.
const CUBES: &str = concat!(include_str!("probes.wgsl"), include_str!("ranges.wgsl"), include_str!("glass.wgsl"));

/// Weights of the reflected and the refracted ray of a pane.
const FRESNEL: &str = include_str!("fresnel.wgsl");

/// Shared by the march through the picture and by its pyramid.
const SCREEN_CAMERA: &str = include_str!("screen_camera.wgsl");

/// Number of sums over which the counts of pixels are distributed, so that few atomic additions collide.
pub const SUMS: u32 = 64;

/// Pixels of a row that one invocation of the survey reads.
pub const SEGMENT: u32 = 16;

/// Squared weight below which a slice does not count, as in `raster::effects::occlusion`.
const LEAST_WEIGHT: f32 = 1e-6;

/// The choices with which a program is compiled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Variant {
    pub program: EffectProgram,
    /// For shadow maps: the light is a disc. Programs for a point of light are compiled without it.
    pub soft: bool,
    /// For `gtao`: by bitmasks instead of horizons.
    pub bitmask: bool,
    /// The filter that follows an ambient occlusion, instead of the occlusion itself.
    pub filter: bool,
}

impl Variant {
    /// The variant of the filter, which all ambient occlusions share.
    pub const FILTER: Self =
        Self { program: EffectProgram::HorizonOcclusion, soft: false, bitmask: false, filter: true };

    /// The variant that a job asks for.
    pub fn of(job: &EffectJob<'_>) -> Self {
        let is = |program| job.program == program;
        Self {
            program: job.program,
            soft: is(EffectProgram::ShadowMap) && job.params.sun > 0.0,
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
pub fn source(Variant { program, soft, bitmask, filter }: Variant) -> String {
    let (file, text) = if filter { ("filter.wgsl", include_str!("filter.wgsl")) } else { text(program) };
    let mut source = cut(file, text, |name| {
        Some(match name {
            "REFRACT" => program.refracts(),
            "SOFT" => soft,
            "BITMASK" => bitmask,
            "HORIZONS" => program == EffectProgram::HorizonOcclusion,
            _ => return None,
        })
    });
    source.push_str(COMMON);
    match program {
        EffectProgram::CubeReflection | EffectProgram::CubeRefraction => source.push_str(CUBES),
        EffectProgram::ScreenReflection | EffectProgram::ScreenRefraction => {
            source.push_str(CUBES);
            source.push_str(SCREEN_CAMERA);
        }
        EffectProgram::PlanarReflection => source.push_str(GLAZING),
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
        ("SEGMENT", SEGMENT),
        ("SUMS", SUMS),
        ("MAX_LEVELS", MAX_LEVELS as u32),
        ("NO_PLANE", NO_PLANE),
        ("HASH_PIXEL", hash::PIXEL),
        ("HASH_DIMENSIONS", hash::DIMENSIONS),
    ];
    for (name, value) in integers {
        _ = writeln!(source, "const {name} = {value}u;");
    }
}

/// Size of a program's own uniforms, in bytes.
pub const fn params_bytes(variant: Variant) -> usize {
    match variant.program {
        _ if variant.filter => size_of::<FilterUniform>(),
        EffectProgram::ShadowMap => size_of::<ShadowUniform>(),
        EffectProgram::CubeReflection | EffectProgram::CubeRefraction => size_of::<CubeUniform>(),
        EffectProgram::ScreenReflection | EffectProgram::ScreenRefraction => size_of::<ScreenUniform>(),
        EffectProgram::PlanarReflection => size_of::<PlanarUniform>(),
        EffectProgram::DepthOcclusion | EffectProgram::HorizonOcclusion => size_of::<OcclusionUniform>(),
    }
}

/// `Frame` of the shaders.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct FrameUniform {
    size: [u32; 2],
    first_row: u32,
    id_base: u32,
}

impl FrameUniform {
    pub fn new(width: u32, height: u32, first_row: u32, id_base: u32) -> Self {
        Self { size: [width, height], first_row, id_base }
    }
}

/// `Params` of `ask.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct AskUniform {
    /// Without glass, the [`depth_plane`](crate::raster::effects::cascades::depth_plane).
    pub depth_plane: Vec4,
    pub size: [u32; 2],
    pub id_base: u32,
    pub ranges: u32,
}

/// `Cascade` of `shadow_map.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct CascadeUniform {
    map_from_world: Mat4,
    slope_bias: f32,
    rounding_bias: f32,
    texel_bias: f32,
    spread: f32,
    aside: f32,
    padding: [u32; 3],
}

/// `Params` of `shadow_map.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct ShadowUniform {
    cascades: [CascadeUniform; MAX_CASCADES as usize],
    count: u32,
    map_size: i32,
    reach: i32,
    padding: u32,
    search: [Tap; SEARCH_TAPS],
    filter_taps: [Tap; FILTER_TAPS],
}

impl ShadowUniform {
    /// The uniforms for some cascades; without a cascade, everything is lit.
    pub fn new(job: &EffectJob<'_>, cascades: &Cascades) -> Self {
        let params = &job.params;
        let mut uniform: Self = bytemuck::Zeroable::zeroed();
        uniform.count = cascades.fits.len() as u32;
        uniform.map_size = params.map_size as i32;
        uniform.reach = params.pcf as i32;
        (uniform.search, uniform.filter_taps) = (TAPS.search, TAPS.filter);
        // Distance of the hard filter's farthest texel. With a disc, the distance of each tap is added.
        let texels = params.bias * if params.sun > 0.0 { 1.0 } else { (params.pcf + 1) as f32 };
        for (to, fit) in uniform.cascades.iter_mut().zip(&cascades.fits) {
            *to = CascadeUniform {
                map_from_world: fit.map_from_world,
                slope_bias: texels * fit.texel * fit.depth_per_unit,
                rounding_bias: fit.rounding * fit.depth_per_unit,
                texel_bias: fit.texel * fit.depth_per_unit,
                spread: fit.spread,
                aside: fit.aside,
                padding: [0; 3],
            };
        }
        uniform
    }
}

/// `Params` of `cube.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct CubeUniform {
    eye: Vec4,
    axes: [[Vec4; 3]; FACES],
    map_size: u32,
    probes: u32,
    ranges: u32,
    index: f32,
    schlick: u32,
    padding: [u32; 3],
}

impl CubeUniform {
    pub fn new(job: &EffectJob<'_>, probes: usize, ranges: usize) -> Self {
        Self {
            eye: job.view.eye.extend(0.0),
            axes: AXES.map(|axes| axes.map(|axis| axis.extend(0.0))),
            map_size: job.params.map_size,
            probes: probes as u32,
            ranges: ranges as u32,
            index: job.params.index,
            schlick: u32::from(job.params.fresnel == Fresnel::Schlick),
            padding: [0; 3],
        }
    }
}

/// `Params` of `screen.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct ScreenUniform {
    camera: ScreenCamera,
    eye: Vec4,
    axes: [[Vec4; 3]; FACES],
    levels: [Level; MAX_LEVELS],
    level_count: u32,
    map_size: u32,
    probes: u32,
    ranges: u32,
    index: f32,
    schlick: u32,
    thickness: f32,
    leaves: u32,
}

impl ScreenUniform {
    /// Without a camera and levels, every pixel keeps its own colour.
    pub fn new(
        job: &EffectJob<'_>,
        seen: Option<(&ScreenCamera, &[Level])>,
        map_size: u32,
        probes: usize,
        ranges: usize,
    ) -> Self {
        let mut uniform: Self = bytemuck::Zeroable::zeroed();
        if let Some((camera, levels)) = seen {
            uniform.camera = *camera;
            uniform.level_count = levels.len() as u32;
            uniform.levels.iter_mut().zip(levels).for_each(|(to, level)| *to = *level);
        }
        let leaves = u32::from(job.params.missing == Missing::Rays);
        Self {
            eye: job.view.eye.extend(0.0),
            axes: AXES.map(|axes| axes.map(|axis| axis.extend(0.0))),
            map_size,
            probes: probes as u32,
            ranges: ranges as u32,
            index: job.params.index,
            schlick: u32::from(job.params.fresnel == Fresnel::Schlick),
            thickness: job.params.thickness,
            leaves,
            ..uniform
        }
    }
}

/// `Params` of `pyramid.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct PyramidUniform {
    camera: ScreenCamera,
    fine: Level,
    coarse: Level,
    base: u32,
    padding: [u32; 3],
}

impl PyramidUniform {
    pub fn new(camera: &ScreenCamera, fine: Level, coarse: Level, base: bool) -> Self {
        Self { camera: *camera, fine, coarse, base: u32::from(base), padding: [0; 3] }
    }
}

/// `Probe` of `probes.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct ProbeBox {
    low: Vec4,
    high: Vec4,
    center: Vec4,
    proxy_low: Vec4,
    proxy_high: Vec4,
}

impl ProbeBox {
    pub fn new(probe: &Probe) -> Self {
        let corners =
            probe.proxy.map_or([Vec4::ZERO; 2], |proxy| [proxy.low, proxy.high].map(|corner| corner.extend(0.0)));
        Self {
            low: probe.bounds.min.extend(0.0),
            high: probe.bounds.max.extend(0.0),
            center: probe.center.extend(if probe.proxy.is_some() { 1.0 } else { 0.0 }),
            proxy_low: corners[0],
            proxy_high: corners[1],
        }
    }
}

/// `Params` of `planar.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct PlanarUniform {
    pub mirrors: u32,
    pub ranges: u32,
}

/// `Mirror` of `planar.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct MirrorPlane {
    normal: Vec4,
    plane: u32,
    layer: u32,
    padding: [u32; 2],
}

impl MirrorPlane {
    /// A mirror whose picture is in layer `layer`.
    pub fn new(mirror: &Mirror, layer: u32) -> Self {
        Self { normal: mirror.normal, plane: mirror.plane, layer, padding: [0; 2] }
    }
}

/// `Params` of `survey.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct SurveyUniform {
    pub size: [u32; 2],
    pub id_base: u32,
    pub ranges: u32,
}

/// `Params` of `filter.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct FilterUniform {
    pub step: i32,
    pub exponent: f32,
}

/// `Params` of `occlusion.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct OcclusionUniform {
    clip_from_world: Mat4,
    eye: Vec4,
    radius: f32,
    intensity: f32,
    slices: u32,
    steps: u32,
    seed: u32,
    thickness: f32,
    padding: [u32; 2],
}

impl OcclusionUniform {
    pub fn new(job: &EffectJob<'_>) -> Self {
        let params = &job.params;
        Self {
            clip_from_world: job.view.clip_from_world,
            eye: job.view.eye.extend(0.0),
            radius: params.radius,
            // If there is a filter, it applies the exponent to the averages.
            intensity: if params.filter > 0 { 1.0 } else { params.intensity },
            slices: params.slices,
            steps: params.steps,
            seed: job.seed,
            thickness: job.params.thickness,
            padding: [0; 2],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use curitiba_pipeline::raster_effects::EFFECT_PROGRAMS;
    use std::mem::offset_of;
    use wgpu::naga;

    /// The variant for a point of light.
    fn hard(program: EffectProgram) -> Variant {
        Variant { program, soft: false, bitmask: false, filter: false }
    }

    macro_rules! offsets {
        ($ty:ty: $($field:ident),*) => {
            (vec![$((stringify!($field).to_owned(), offset_of!($ty, $field))),*], size_of::<$ty>())
        };
    }

    fn validate(source: &str) -> Result<naga::Module, String> {
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
            let module = validate(&ask_source(glass)).unwrap_or_else(|error| panic!("{error}"));
            let offsets = offsets!(AskUniform: depth_plane, size, id_base, ranges);
            assert_eq!(layout_in(&module, "Params"), offsets);
        }
        assert_ne!(ask_source(false), ask_source(true));
    }

    #[test]
    fn the_pyramid_parses_and_validates() {
        let module = validate(&pyramid_source()).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(layout_in(&module, "Params"), offsets!(PyramidUniform: camera, fine, coarse, base));
    }

    #[test]
    fn the_survey_parses_and_validates() {
        let module = validate(&survey_source()).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(layout_in(&module, "Params"), offsets!(SurveyUniform: size, id_base, ranges));
    }

    #[test]
    fn programs_that_share_a_text_differ() {
        let has = |program, what: &str| source(hard(program)).contains(what);
        assert!(has(EffectProgram::CubeRefraction, "fn fresnel") && !has(EffectProgram::CubeReflection, "fn fresnel"));
        let soft = source(Variant { soft: true, ..hard(EffectProgram::ShadowMap) });
        assert!(soft.contains("fn search_radius") && !has(EffectProgram::ShadowMap, "fn search_radius"));
        assert!(validate(&soft).is_ok());
        let module = validate(&source(Variant::FILTER)).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(layout_in(&module, "Params"), offsets!(FilterUniform: step, exponent));
        let bitmask = source(Variant { bitmask: true, ..hard(EffectProgram::HorizonOcclusion) });
        assert!(bitmask.contains("fn shut_by(") && !has(EffectProgram::HorizonOcclusion, "fn shut_by("));
        validate(&bitmask).unwrap_or_else(|error| panic!("{error}"));
        assert!(has(EffectProgram::HorizonOcclusion, "fn arc(") && !has(EffectProgram::DepthOcclusion, "fn arc("));
    }

    #[test]
    fn an_invalid_program_is_found_out() {
        let source = source(hard(EffectProgram::ShadowMap));
        let broken = source.replace("depth >= stored", "depth >= params.reach");
        assert_ne!(broken, source);
        assert!(validate(&source).is_ok() && validate(&broken).is_err());
    }

    /// Offsets of the members of a shader's struct, and the struct's size.
    fn layout_in(module: &naga::Module, name: &str) -> (Vec<(String, usize)>, usize) {
        let (_, ty) =
            module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(name)).expect("the shader has the struct");
        let naga::TypeInner::Struct { members, span } = &ty.inner else { panic!("{name} is no struct") };
        let offsets = members.iter().map(|m| (m.name.clone().expect("named"), m.offset as usize)).collect();
        (offsets, *span as usize)
    }

    fn layout(program: EffectProgram, name: &str) -> (Vec<(String, usize)>, usize) {
        layout_in(&validate(&source(hard(program))).expect("valid"), name)
    }

    #[test]
    fn uniforms_lie_as_the_shaders_read_them() {
        use EffectProgram::{
            CubeReflection, CubeRefraction, DepthOcclusion, HorizonOcclusion, PlanarReflection, ScreenReflection,
            ScreenRefraction, ShadowMap,
        };
        for info in EFFECT_PROGRAMS {
            let frame = offsets!(FrameUniform: size, first_row, id_base);
            assert_eq!(layout(info.program, "Frame"), frame, "{}", info.name);
        }
        let shadow = offsets!(ShadowUniform: cascades, count, map_size, reach, search, filter_taps);
        assert_eq!(layout(ShadowMap, "Params"), shadow);
        let cascade = offsets!(CascadeUniform: map_from_world, slope_bias, rounding_bias, texel_bias, spread, aside);
        assert_eq!(layout(ShadowMap, "Cascade"), cascade);
        for program in [CubeReflection, CubeRefraction] {
            let cube = offsets!(CubeUniform: eye, axes, map_size, probes, ranges, index, schlick);
            assert_eq!(layout(program, "Params"), cube);
            assert_eq!(layout(program, "Probe"), offsets!(ProbeBox: low, high, center, proxy_low, proxy_high));
        }
        for program in [ScreenReflection, ScreenRefraction] {
            let screen = offsets!(
                ScreenUniform: camera, eye, axes, levels, level_count, map_size, probes, ranges, index, schlick, thickness, leaves
            );
            assert_eq!(layout(program, "Params"), screen);
            let camera = offsets!(ScreenCamera: columns, rows, depths, from, right, down, forward);
            let (named, bytes) = layout(program, "ScreenCamera");
            // `from` is not allowed as a name in WGSL.
            let named: Vec<_> = named.into_iter().map(|(name, at)| (name.replace("origin", "from"), at)).collect();
            assert_eq!((named, bytes), camera);
            assert_eq!(layout(program, "Probe"), offsets!(ProbeBox: low, high, center, proxy_low, proxy_high));
        }
        assert_eq!(layout(PlanarReflection, "Params"), offsets!(PlanarUniform: mirrors, ranges));
        assert_eq!(layout(PlanarReflection, "Mirror"), offsets!(MirrorPlane: normal, plane, layer));
        for program in [HorizonOcclusion, DepthOcclusion] {
            let occlusion =
                offsets!(OcclusionUniform: clip_from_world, eye, radius, intensity, slices, steps, seed, thickness);
            assert_eq!(layout(program, "Params"), occlusion);
        }
    }
}
