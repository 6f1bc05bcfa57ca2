//! The WGSL sources of the programs: one file an effect, and their common parts.

use super::layout;
use super::split::Split;
use crate::effects::Lighting;
use crate::effects::dielectric::Variant;
use curitiba_pipeline::backend::{BackendError, RayJob};
use curitiba_pipeline::programs::{Fidelity, RayProgram, TextureLod};

/// How the products of the triangle test are rounded. No variant leaks rays between triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Rounding {
    /// By `fma`: fused or not, as long as the driver does the same everywhere.
    #[default]
    Fma,
    /// Each product separately, as on the processor: for drivers that may choose differently for each instruction.
    Separate,
    /// As the driver chooses: for tests.
    Driver,
    /// One of the two products is not rounded before the difference, as drivers that fuse compute it: for tests.
    Fused,
}

/// How a driver computes the programs' arithmetic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Arithmetic {
    /// Rounding of the triangle test.
    pub rounding: Rounding,
    /// Whether `fma` rounds only once; then exact products take few instructions.
    pub fused: bool,
    /// Whether the 32 threads of a group are one subgroup.
    pub subgroups: bool,
}

/// The properties of a job that its kernels are written for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Kind {
    pub program: RayProgram,
    pub variant: Variant,
    pub lighting: Lighting,
    /// Whether the scene has exact spheres.
    pub spheres: bool,
    /// Whether glass focuses light: some of the spheres, or meshes at which photons are shot.
    pub focuses: bool,
    /// Whether the ways of paths in glass are a sample.
    pub sampled: bool,
}

impl Kind {
    /// The kind for one light that is a point, in a scene without exact spheres and focused light, for paths that take all ways.
    pub const fn plain(program: RayProgram, variant: Variant) -> Self {
        Self { program, variant, lighting: Lighting::Sun, spheres: false, focuses: false, sampled: false }
    }

    /// The kind for a job whose paths take all ways; `focuses` says whether its glass focuses light.
    pub fn of(job: &RayJob<'_>, focuses: bool) -> Self {
        let spheres = !job.scene.geometry.spheres.is_empty();
        let (variant, lighting) = (Variant::of(job), Lighting::of(job));
        Self { program: job.program, variant, lighting, spheres, focuses, sampled: false }
    }

    /// The kind for one kernel: only kernels that compute light depend on whether glass focuses light, and only those that follow paths depend on
    /// whether the ways are a sample.
    pub fn at(self, stage: Stage) -> Self {
        let follows = matches!(stage, Stage::Whole | Stage::List | Stage::Sum);
        let asks = follows || stage == Stage::Focus;
        Self { focuses: self.focuses && asks, sampled: self.sampled && follows, ..self }
    }
}

/// A kernel of a program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Stage {
    /// Finds the bodies that the camera is in: one thread.
    Eye,
    /// The whole program, one thread a pixel.
    Whole,
    /// Lists the points of surfaces that pixels see, also through glass.
    List,
    /// Traces the points' shadow rays.
    Light,
    /// Finds the light that glass focuses on the points.
    Focus,
    /// Settles the points' occlusion rays: finds their results from the triangles near each point alone, as far as these suffice.
    Settle,
    /// Traces the occlusion rays that are not settled.
    Trace,
    /// Traces all of the points' occlusion rays.
    TraceAll,
    /// Sums the points of each pixel; for `deferredShadows`, traces the pixels' rays.
    Sum,
    /// Writes surface normals for the filter, which averages the output of the other kernels.
    Surfaces,
}

/// Least number of occlusion rays a point for which [`Stage::Settle`] runs; fewer are traced directly.
pub const SETTLED_SAMPLES: u32 = 6;

/// The kernels of a program, in order of execution, without [`Stage::Eye`]: it runs first where the camera may be in a body. In two
/// cases [`Stage::List`] also computes the points' light: with several lights or a disc, all of it; where glass focuses light, only the light that
/// falls straight.
pub fn stages(Kind { program, variant, lighting, focuses, .. }: Kind, samples: u32) -> &'static [Stage] {
    if variant == Variant::Panes(Fidelity::Thesis) {
        return &[Stage::Whole];
    }
    match program {
        RayProgram::Final if focuses && samples >= SETTLED_SAMPLES => {
            &[Stage::List, Stage::Focus, Stage::Settle, Stage::Trace, Stage::Sum]
        }
        RayProgram::Final if focuses && samples > 0 => &[Stage::List, Stage::Focus, Stage::TraceAll, Stage::Sum],
        RayProgram::Final if focuses => &[Stage::List, Stage::Focus, Stage::Sum],
        RayProgram::DeferredShadows if lighting == Lighting::Lights => &[Stage::Whole],
        RayProgram::Final if lighting == Lighting::Lights && samples >= SETTLED_SAMPLES => {
            &[Stage::List, Stage::Settle, Stage::Trace, Stage::Sum]
        }
        RayProgram::Final if lighting == Lighting::Lights && samples > 0 => &[Stage::List, Stage::TraceAll, Stage::Sum],
        RayProgram::DeferredShadows => &[Stage::List, Stage::Sum],
        RayProgram::Ssao if samples >= SETTLED_SAMPLES => &[Stage::List, Stage::Settle, Stage::Trace, Stage::Sum],
        RayProgram::Final if samples >= SETTLED_SAMPLES => {
            &[Stage::List, Stage::Light, Stage::Settle, Stage::Trace, Stage::Sum]
        }
        RayProgram::Ssao if samples > 0 => &[Stage::List, Stage::TraceAll, Stage::Sum],
        RayProgram::Final if samples > 0 => &[Stage::List, Stage::Light, Stage::TraceAll, Stage::Sum],
        _ => &[Stage::Whole],
    }
}

/// The WGSL source of a file in `programs/`.
type Text = &'static str;

macro_rules! text {
    ($stem:literal) => {
        include_str!(concat!("programs/", $stem, ".wgsl"))
    };
}

/// The programs that are written for this backend.
const TABLE: &[(RayProgram, &[Text])] = &[
    (RayProgram::Dummy, &[text!("dummy")]),
    (RayProgram::DeferredShadows, &[SHADOWS]),
    (RayProgram::Reflection, &[text!("optics"), text!("reflection")]),
    (
        RayProgram::Refraction,
        &[text!("sampling"), text!("optics"), WEIGHTS, GLASS, text!("glass_thesis"), text!("refraction")],
    ),
    (RayProgram::Ssao, &[text!("sampling"), text!("hemisphere"), text!("occlusion"), text!("ssao")]),
    (RayProgram::Final, FINAL),
];

const FINAL: &[Text] = &[
    text!("sampling"),
    text!("hemisphere"),
    text!("occlusion"),
    text!("optics"),
    WEIGHTS,
    GLASS,
    LIGHT,
    LIGHT_SHARE,
    text!("glass_thesis"),
    text!("final"),
];

/// Weights of light on a path; programs with bodies use other sources.
const WEIGHTS: Text = text!("panes");
/// Paths through glass; programs with bodies use other sources.
const GLASS: Text = text!("glass");
/// Light that arrives through glass; programs with bodies use other sources.
const LIGHT: Text = text!("light");

/// The share of the light that reaches a surface; programs with several lights or a disc use other sources.
const LIGHT_SHARE: Text = text!("light_share");
/// How points are listed with their light; programs with several lights, a disc or focused light use other sources.
const LISTED_LIGHT: Text = text!("list_light");
/// `deferredShadows`; programs with several lights or a disc use other sources.
const SHADOWS: Text = text!("deferredShadows");

/// The share of several lights, and of discs, that shadows leave.
const LIGHTS_SHARE: [Text; 3] = [LIGHT_COSINE, text!("discs"), text!("lights_share")];
/// Light that comes straight through glass: its transmittance, and the functions that use it.
const STRAIGHT: [Text; 2] = [text!("light_straight"), text!("light_from")];
/// [`STRAIGHT`] where glass focuses light.
const STRAIGHT_OR_FOCUSED: [Text; 2] = [text!("light_straight"), text!("light_focused")];
/// Light that glass focuses on a surface; programs add the sources that find it.
const FOCUS: Text = text!("focus");
/// The sources that find the light that photons bring.
const PHOTONS: Text = text!("photons");
/// The sources that find the light that exact spheres focus.
const LENSES: [Text; 2] = [text!("ball"), text!("lens")];
/// The source of [`LIGHTS_SHARE`] that [`FOCUS`] needs.
const LIGHT_COSINE: Text = text!("light_cosine");

/// The sources that all programs share, except for those that depend on the rounding of products or on the lights.
const COMMON: [Text; 6] =
    [text!("params"), text!("wide"), text!("scene"), text!("triangle"), text!("traverse"), text!("surface")];

/// The sources of a kernel, which follow the common sources; `None` if the program is not written for this backend.
fn texts(kind: Kind, stage: Stage, subgroups: bool) -> Option<Vec<Text>> {
    let Kind { program, variant, lighting, spheres, focuses, sampled } = kind;
    let mut texts = of_panes(program, stage, subgroups)?;
    if focuses {
        let listed = [LIGHT, LIGHT_SHARE, text!("list_focused")];
        let instead = |text: Text| match (text, lighting) {
            (LISTED_LIGHT, Lighting::Sun) => [LIGHT_COSINE].into_iter().chain(listed).collect(),
            (LISTED_LIGHT, Lighting::Lights) => listed.to_vec(),
            (LIGHT_SHARE, Lighting::Sun) => vec![LIGHT_SHARE, LIGHT_COSINE, FOCUS],
            (LIGHT_SHARE, Lighting::Lights) => vec![LIGHT_SHARE, FOCUS],
            (text, _) => vec![text],
        };
        texts = texts.into_iter().flat_map(instead).collect();
    }
    if lighting == Lighting::Lights {
        let instead = |text: Text| match text {
            SHADOWS => [text!("sampling")].into_iter().chain(LIGHTS_SHARE).chain([text!("lights_shadows")]).collect(),
            LIGHT_SHARE => LIGHTS_SHARE.into_iter().chain([text!("lights_final")]).collect(),
            LISTED_LIGHT => {
                [LIGHT].into_iter().chain(LIGHTS_SHARE).chain([text!("lights_final"), text!("list_lights")]).collect()
            }
            text => vec![text],
        };
        texts = texts.into_iter().flat_map(instead).collect();
    }
    if !variant.knows_bodies() {
        return Some(texts);
    }
    let instead = |text: Text| match text {
        WEIGHTS if variant == Variant::Ways => vec![text!("media"), text!("start_media"), text!("face_own")],
        WEIGHTS => vec![text!("media"), text!("start_media"), text!("face_smooth")],
        GLASS if variant == Variant::Ways => {
            let followed = if sampled { text!("sampled_ways") } else { text!("all_ways") };
            vec![text!("bodies"), text!("facets"), text!("ways"), followed]
        }
        GLASS => vec![text!("bodies"), text!("smooth")],
        LIGHT if focuses => STRAIGHT_OR_FOCUSED.to_vec(),
        LIGHT => STRAIGHT.to_vec(),
        FOCUS if spheres => [FOCUS, PHOTONS].into_iter().chain(LENSES).collect(),
        FOCUS => vec![FOCUS, PHOTONS],
        text => vec![text],
    };
    Some(texts.into_iter().flat_map(instead).collect())
}

/// The sources of a kernel in the variants with panes; `None` if the program is not written for this backend.
fn of_panes(program: RayProgram, stage: Stage, subgroups: bool) -> Option<Vec<Text>> {
    let (_, whole) = TABLE.iter().find(|(own, _)| *own == program)?;
    let is_final = program == RayProgram::Final;
    let listed = [text!("sampling"), text!("points")];
    let group = if subgroups { text!("group_subgroups") } else { text!("group") };
    let shadows = [text!("points"), SHADOWS];
    let fans = [text!("sampling"), text!("hemisphere"), text!("points"), group, text!("fans")];
    Some(match stage {
        Stage::Eye => vec![text!("optics"), WEIGHTS, text!("find_eye")],
        Stage::Surfaces if program.info().buffers.contains(&"norm_buffer") => {
            vec![text!("surfaces"), text!("surfaces_stored"), text!("whole")]
        }
        Stage::Surfaces => vec![text!("surfaces"), text!("surfaces_flat"), text!("whole")],
        Stage::Whole => whole.iter().copied().chain([text!("whole")]).collect(),
        Stage::List if program == RayProgram::DeferredShadows => {
            shadows.into_iter().chain([text!("shadow_list"), text!("list")]).collect()
        }
        Stage::Sum if program == RayProgram::DeferredShadows => {
            shadows.into_iter().chain([text!("shadow_sum"), text!("whole")]).collect()
        }
        Stage::List if is_final => listed
            .into_iter()
            .chain([text!("optics"), WEIGHTS, GLASS, LISTED_LIGHT, text!("final_list"), text!("list")])
            .collect(),
        Stage::List => listed.into_iter().chain([text!("ssao_list"), text!("list")]).collect(),
        Stage::Light => {
            listed.into_iter().chain([text!("optics"), WEIGHTS, LIGHT, LIGHT_SHARE, text!("final_light")]).collect()
        }
        Stage::Focus => {
            let light = [text!("optics"), WEIGHTS, LIGHT, LIGHT_COSINE, FOCUS, text!("final_focus")];
            listed.into_iter().chain(light).collect()
        }
        Stage::Settle => fans.into_iter().chain([text!("cone"), text!("nearby"), text!("settle")]).collect(),
        Stage::Trace | Stage::TraceAll => fans.into_iter().chain([text!("trace")]).collect(),
        Stage::Sum if is_final => {
            whole.iter().copied().chain([text!("points"), text!("final_sum"), text!("whole")]).collect()
        }
        Stage::Sum => vec![text!("points"), text!("ssao_sum"), text!("whole")],
    })
}

/// A source with or without its parts between two marks.
fn with_marked(source: &str, marks: [char; 2], are_kept: bool) -> String {
    let mut text = String::with_capacity(source.len());
    for (index, part) in source.split(marks).enumerate() {
        if index % 2 == 0 || are_kept {
            text.push_str(part);
        }
    }
    text
}

/// A source with its parts between ⟨ and ⟩ where textures are read by ray cones, and without them where they are read at level 0.
fn of_levels(source: &str, lod: TextureLod) -> String {
    with_marked(source, ['⟨', '⟩'], lod == TextureLod::Cones)
}

/// A source with its parts between ⟪ and ⟫ where the scene has exact spheres; else without them. Marks of [`of_levels`] may lie between them.
fn of_spheres(source: &str, spheres: bool) -> String {
    with_marked(source, ['⟪', '⟫'], spheres)
}

/// A source with its parts between ⦃ and ⦄ where glass focuses light; else without them. The marks may lie between those of [`of_spheres`].
fn of_focus(source: &str, focuses: bool) -> String {
    with_marked(source, ['⦃', '⦄'], focuses)
}

/// A source with its parts between ⟬ and ⟭ where the ways of paths are a sample; else without them.
fn of_sample(source: &str, sampled: bool) -> String {
    with_marked(source, ['⟬', '⟭'], sampled)
}

/// A source without marks, for a kind and a level of textures.
fn unmarked(source: &str, Kind { spheres, focuses, sampled, .. }: Kind, lod: TextureLod) -> String {
    of_levels(&of_focus(&of_spheres(&of_sample(source, sampled), spheres), focuses), lod)
}

/// The functions that programs use, without a program, and with the marks that [`unmarked`] takes out.
fn functions(
    arithmetic: Arithmetic,
    Kind { variant, lighting, spheres, focuses, sampled, .. }: Kind,
    split: Split,
    lod: TextureLod,
) -> String {
    let rounding = match arithmetic.rounding {
        Rounding::Fma => text!("rounding_fma"),
        Rounding::Separate => text!("rounding_separate"),
        Rounding::Driver => text!("rounding_driver"),
        Rounding::Fused => text!("rounding_fused"),
    };
    let product = if arithmetic.fused { text!("product_fused") } else { text!("product_split") };
    let mut source = layout::constants() + &split.text();
    let crossings = if variant.knows_bodies() { text!("crossings_hits") } else { text!("crossings") };
    let lights: &[Text] = match lighting {
        Lighting::Sun if focuses => &[text!("sun_segments"), text!("shading")],
        Lighting::Lights if focuses => &[text!("lights"), text!("lights_segments"), text!("shading")],
        Lighting::Sun => &[text!("sun")],
        Lighting::Lights => &[text!("lights"), text!("shading")],
    };
    COMMON
        .into_iter()
        .chain(lights.iter().copied())
        .chain([crossings, rounding, product])
        .for_each(|text| source.push_str(text));
    if lod == TextureLod::Cones {
        source.push_str(text!("ray_cones"));
    }
    if spheres {
        source.push_str(&layout::sphere_constants());
        source.push_str(text!("spheres"));
    }
    if focuses {
        source.push_str(&layout::focus_constants());
    }
    if focuses && spheres {
        source.push_str(&layout::lens_constants());
    }
    if sampled {
        source.push_str(&layout::sample_constants());
    }
    source
}

/// The complete source of a kernel; `None` if the program is not written for this backend.
pub fn source(kind: Kind, stage: Stage, (arithmetic, lod): (Arithmetic, TextureLod), split: Split) -> Option<String> {
    let kind = kind.at(stage);
    let Kind { program, variant, .. } = kind;
    let texts = texts(kind, stage, arithmetic.subgroups)?;
    let function = if variant == Variant::Panes(Fidelity::Thesis) { "thesis" } else { "corrected" };
    let mut source = functions(arithmetic, kind, split, lod);
    source.push_str(text!("pass"));
    source.push_str(text!("cut_loops"));
    texts.into_iter().for_each(|text| source.push_str(text));
    match stage {
        Stage::Whole => {
            source.push_str(&format!("fn picture(pixel: Pixel) -> vec4f {{ return {function}(pixel); }}\n"));
        }
        Stage::Settle | Stage::Trace | Stage::TraceAll => {
            let accept = if program == RayProgram::Final { "ACCEPT_STOPS" } else { "ACCEPT_COVERED" };
            source.push_str(&format!("const OCCLUSION_ACCEPT: u32 = {accept};\n"));
            source.push_str(&format!("const IS_SETTLED: bool = {};\n", stage == Stage::Trace));
        }
        _ => {}
    }
    Some(unmarked(&source, kind, lod))
}

/// The source of how a sphere focuses parallel light, with all sources that it needs, for tests that add their own use of the bundles.
#[cfg(test)]
pub fn ball(arithmetic: Arithmetic) -> String {
    let kind = Kind { spheres: true, focuses: true, ..Kind::plain(RayProgram::Final, Variant::Bodies) };
    let texts = texts(kind, Stage::Focus, false).expect("it is written");
    // All sources except those of the kernel and of the lighting of surfaces.
    let texts = texts.into_iter().filter(|text| ![FOCUS, PHOTONS, text!("lens"), text!("final_focus")].contains(text));
    let source = functions(arithmetic, kind, Split::default(), TextureLod::Zero) + text!("pass") + text!("cut_loops");
    let source = texts.fold(source, |source, text| source + text);
    unmarked(&source, kind, TextureLod::Zero)
}

/// The program that traces segments between triangles.
pub fn segments(arithmetic: Arithmetic) -> String {
    let lod = TextureLod::Zero;
    // The functions do not depend on the program.
    let kind = Kind::plain(RayProgram::DeferredShadows, Variant::Panes(Fidelity::Corrected));
    unmarked(&functions(arithmetic, kind, Split::default(), lod), kind, lod) + text!("segments")
}

/// Whether the program is written for this backend.
pub fn is_written(program: RayProgram) -> bool {
    TABLE.iter().any(|(own, _)| *own == program)
}

/// The error for a program that is not written for this backend.
pub fn not_written(backend: &'static str, program: RayProgram) -> BackendError {
    let why = "it is not written for this backend; `--backend cpu` runs it".to_owned();
    BackendError::Unsupported { backend, what: program.info().stem.to_owned(), why }
}
