//! The uniforms and tables that the shaders of the pixel programs read. A test compares their memory layouts with those of the shaders.

use super::shader::Variant;
use crate::raster::effects::cascades::Cascades;
use crate::raster::effects::cube::{AXES, FACES};
use crate::raster::effects::mirrors::Mirror;
use crate::raster::effects::occlusion::most_pixels;
use crate::raster::effects::panes::Probe;
use crate::raster::effects::screen::camera::ScreenCamera;
use crate::raster::effects::screen::pyramid::{Level, MAX_LEVELS};
use crate::raster::effects::soft::{FILTER_TAPS, SEARCH_TAPS, TAPS, Tap};
use curitiba_pipeline::backend::EffectJob;
use curitiba_pipeline::raster_effects::{EffectProgram, MAX_CASCADES, Missing};
use glam::{Mat4, Vec2, Vec4};

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
    /// The camera's [`depth_plane`](crate::raster::effects::cascades::depth_plane); not read in the question for glass.
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
    /// The uniforms for these cascades; without a cascade, every pixel is lit.
    pub fn new(job: &EffectJob<'_>, cascades: &Cascades) -> Self {
        let params = &job.params;
        let mut uniform: Self = bytemuck::Zeroable::zeroed();
        uniform.count = cascades.fits.len() as u32;
        uniform.map_size = params.map_size as i32;
        uniform.reach = params.pcf as i32;
        (uniform.search, uniform.filter_taps) = (TAPS.search, TAPS.filter);
        // The bias is for the distance of the hard filter's farthest texel. With a disc, the shader adds the distance of each tap.
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
    fresnel: u32,
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
            fresnel: job.params.fresnel as u32,
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
    fresnel: u32,
    thickness: f32,
    leaves: u32,
}

impl ScreenUniform {
    /// `seen` is the picture's camera and the levels of its pyramid. If it is `None`, every pixel keeps its own colour.
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
            fresnel: job.params.fresnel as u32,
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
    pub level: u32,
    pub exponent: f32,
}

/// `Params` of `occlusion.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct OcclusionUniform {
    camera: ScreenCamera,
    eye: Vec4,
    corner: Vec4,
    sight: Vec4,
    turn: Vec2,
    radius: f32,
    intensity: f32,
    slices: u32,
    steps: u32,
    seed: u32,
    thickness: f32,
    per_slice: f32,
    interval: f32,
    most: f32,
    padding: u32,
}

impl OcclusionUniform {
    pub fn new(job: &EffectJob<'_>, camera: ScreenCamera) -> Self {
        let params = &job.params;
        let (sin, cos) = (std::f64::consts::PI / f64::from(params.slices)).sin_cos();
        let [corner, sight] = camera.sights();
        Self {
            camera,
            // `w` is 1, which shader compilers cannot know, so they cannot simplify products with it.
            eye: job.view.eye.extend(1.0),
            corner: corner.extend(0.0),
            sight: sight.extend(0.0),
            turn: Vec2::new(cos as f32, sin as f32),
            radius: params.radius,
            // If there is a filter, it applies the exponent to the averages.
            intensity: if params.filter > 0 { 1.0 } else { params.intensity },
            slices: params.slices,
            steps: params.steps,
            seed: job.seed,
            thickness: job.params.thickness,
            per_slice: 1.0 / params.slices as f32,
            interval: 1.0 / params.steps as f32,
            most: most_pixels(job.width, job.height),
            padding: 0,
        }
    }
}

/// `Params` of `depths.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct DepthsUniform {
    pub camera: ScreenCamera,
}

#[cfg(test)]
mod tests {
    use super::super::shader::tests::validate;
    use super::super::shader::{ask_source, depths_source, pyramid_source, source, survey_source};
    use super::*;
    use curitiba_pipeline::raster_effects::EFFECT_PROGRAMS;
    use std::mem::offset_of;
    use wgpu::naga;

    macro_rules! offsets {
        ($ty:ty: $($field:ident),*) => {
            (vec![$((stringify!($field).to_owned(), offset_of!($ty, $field))),*], size_of::<$ty>())
        };
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
        layout_in(&validate(&source(Variant::plain(program))).expect("valid"), name)
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
            let cube = offsets!(CubeUniform: eye, axes, map_size, probes, ranges, index, fresnel);
            assert_eq!(layout(program, "Params"), cube);
            assert_eq!(layout(program, "Probe"), offsets!(ProbeBox: low, high, center, proxy_low, proxy_high));
        }
        for program in [ScreenReflection, ScreenRefraction] {
            let screen = offsets!(
                ScreenUniform: camera, eye, axes, levels, level_count, map_size, probes, ranges, index, fresnel, thickness, leaves
            );
            assert_eq!(layout(program, "Params"), screen);
            let camera = offsets!(ScreenCamera: columns, rows, depths, from, right, down, forward);
            let (named, bytes) = layout(program, "ScreenCamera");
            // `from` is not allowed as a name in WGSL.
            let named: Vec<_> = named.into_iter().map(|(name, at)| (name.replace("origin", "from"), at)).collect();
            assert_eq!((named, bytes), camera);
            assert_eq!(layout(program, "Probe"), offsets!(ProbeBox: low, high, center, proxy_low, proxy_high));
        }
        let params = |source: &str| layout_in(&validate(source).expect("valid"), "Params");
        assert_eq!(params(&source(Variant::filter(true))), offsets!(FilterUniform: level, exponent));
        assert_eq!(params(&depths_source()), offsets!(DepthsUniform: camera));
        assert_eq!(params(&pyramid_source()), offsets!(PyramidUniform: camera, fine, coarse, base));
        assert_eq!(params(&survey_source()), offsets!(SurveyUniform: size, id_base, ranges));
        for glass in [false, true] {
            assert_eq!(params(&ask_source(glass)), offsets!(AskUniform: depth_plane, size, id_base, ranges));
        }
        assert_eq!(layout(PlanarReflection, "Params"), offsets!(PlanarUniform: mirrors, ranges));
        assert_eq!(layout(PlanarReflection, "Mirror"), offsets!(MirrorPlane: normal, plane, layer));
        for program in [HorizonOcclusion, DepthOcclusion] {
            let occlusion = offsets!(
                OcclusionUniform: camera, eye, corner, sight, turn, radius, intensity, slices, steps, seed, thickness, per_slice, interval,
                most
            );
            assert_eq!(layout(program, "Params"), occlusion);
        }
    }
}
