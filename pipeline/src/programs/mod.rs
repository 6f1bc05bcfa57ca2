//! The tables of programs that a pass may name: their inputs and parameters.
//!
//! Help, XML validation, `curitiba list`, docs, benchmark ids and conformance tests are derived from these tables.

mod params;
mod query;
mod table;
#[cfg(test)]
pub(crate) mod tests;

pub use params::{
    ADAPTIVE_BYTES, FILTER_BYTES, LARGEST_SUN, LEAST_ADAPTIVE_PATHS, MAX_FILTER_LEVELS, MOST_PATHS, MOST_PHOTONS,
    MOST_SAMPLES, MOST_SUN_SAMPLES, PARAMS, PHOTON_BYTES, ParamInfo, RayParams, Values,
};
pub use query::Query;
pub use table::{PROCS, ProcInfo, RAY_PROGRAMS, RayProgram, RayProgramInfo, Traces, Writes, procs_of_kind};

/// Program of a raster pass, run per fragment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RasterProgram {
    /// The report's `deferredShading`: shaded colour, world position with the light's cosine, shading normal.
    Deferred,
}

/// Program of a quad pass, run per pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum QuadProgram {
    /// Shows one texture.
    Show,
    /// Texture unit 0 times the `x` of texture unit 1.
    Combine,
}

/// Whether the report's programs run as written or with their defects corrected.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Fidelity {
    /// Corrected; `docs/fidelity.md` lists each difference.
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
    /// Fresnel's equation for light whose electric field is perpendicular to the plane of incidence, at every interface.
    S,
    /// Fresnel's equation for light whose electric field lies in the plane of incidence, at every interface.
    P,
}

named!(Fresnel, "exact" => Exact, "schlick" => Schlick, "s" => S, "p" => P);

/// At which mip level ray programs read textures at hits, in `corrected` fidelity. Alpha tests read level 0 in any case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum TextureLod {
    /// At level 0: as sharp as the texture is, so that minified textures glitter.
    Zero,
    /// At the level of the ray's cone, which is as wide as the pixel's part of the surface.
    #[default]
    Cones,
}

named!(TextureLod, "zero" => Zero, "cones" => Cones);

/// A raster or quad program. The file stem of a shader's pixel-shader file selects it.
#[derive(Debug, Clone, Copy)]
pub struct ShaderInfo<P> {
    /// The program.
    pub program: P,
    /// Stem of the `ps` file.
    pub stem: &'static str,
    /// Its output, in one sentence.
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
