//! Structs and constants that the host and the programs share.

use crate::effects::constants as effects;
use crate::effects::dielectric::{LENS_WIDTH, MET_CHANCE, MET_DIVIDED, Photon, ball};
use crate::trace::gpu_binary;
use bytemuck::{Pod, Zeroable};
use curitiba_pipeline::programs::Fresnel;
use std::f64::consts::FRAC_PI_2;

/// Rays bounce on the material (reflection and refraction).
pub const SHADE_GLASS: u32 = 1;
/// Shadow rays pass the material, dimmed.
pub const SHADE_SHADOW_GLASS: u32 = 2;
/// The material has cut-outs, by the alpha of its texture and vertices.
pub const SHADE_CUT: u32 = 4;
/// The material's reflected colour and alpha are multiplied by the vertex colours.
pub const SHADE_VERTEX_COLORS: u32 = 8;
/// The material emits light.
pub const SHADE_GLOW: u32 = 16;
/// A normal map bends the material's shading normals.
pub const SHADE_NORMAL_MAP: u32 = 32;
/// The material is a sky, whose colour `final` leaves without lighting and occlusion.
pub const SHADE_SKY: u32 = 64;
/// Photons carry the light that meets triangles of the material, so they stop straight light.
pub const SHADE_TARGET: u32 = 128;
/// Words of a material in the tables.
pub const SHADE_WORDS: u32 = 12;
/// Words of a texture in the tables.
pub const TEXTURE_WORDS: u32 = 6;
/// The texture repeats beyond its border.
pub const WRAP_REPEAT: u32 = 0;
/// The texture repeats mirrored.
pub const WRAP_MIRROR: u32 = 1;
/// The texels at the border continue.
pub const WRAP_CLAMP: u32 = 2;
/// Words of a material for rays in glass.
pub const BODY_WORDS: u32 = 23;
/// Words before the materials for rays in glass: the settings of a pass for paths in glass. The first word says how light passes glass: 0 dimmed as
/// in the report, 1 straight, else the place of the spheres that focus light ([`LENS_HEAD`]), where any glass focuses light. The words named by
/// [`HEAD`] follow.
pub const BODY_HEAD: u32 = 1 + HEAD.len() as u32;
/// Place of the word of [`BODY_HEAD`] that is the place of the photons: the last one.
pub const HEAD_PHOTONS: u32 = BODY_HEAD - 1;
/// The programs' names for the places of the words of [`BODY_HEAD`], from the second word on.
pub const HEAD: [&str; 11] = [
    "HEAD_CUTOFF",
    "HEAD_REFLECTIONS",
    "HEAD_REFRACTIONS",
    "HEAD_ROULETTE",
    "HEAD_BACKGROUND",
    "HEAD_CHANCE",
    "HEAD_STRATA",
    "HEAD_STRATUM_COUNT",
    "HEAD_FACETS",
    "HEAD_FACET_COUNT",
    "HEAD_PHOTONS",
];
/// Vertex colours do not multiply the filter of glass.
pub const VERTEX_COLORS_NONE: u32 = 0;
/// Vertex colours are linear shares of light.
pub const VERTEX_COLORS_LINEAR: u32 = 1;
/// Vertex colours are display values (sRGB) of shares of light.
pub const VERTEX_COLORS_DISPLAY: u32 = 2;
/// Not glass.
pub const SHAPE_OPAQUE: u32 = 0;
/// The report's plane that represents a whole pane.
pub const SHAPE_PANE: u32 = 1;
/// A plane-parallel wall.
pub const SHAPE_THIN: u32 = 2;
/// The surface of a body.
pub const SHAPE_SOLID: u32 = 3;
/// Words before the lights in the tables: the number of lights, the share of a hidden light that arrives, and for discs the number of points,
/// the height of the cap and the place of the points in the tables.
pub const LIGHT_HEAD: u32 = 5;
/// Words of a light in the tables.
pub const LIGHT_WORDS: u32 = 17;
/// The light is positional.
pub const LIGHT_PLACE: u32 = 1;
/// The light is a spot light.
pub const LIGHT_CONE: u32 = 2;
/// Greatest range of a light. It replaces an infinite range, because programs have no infinities.
pub const LARGEST_RANGE: f32 = 1.0e30;
/// Greatest number of crossings of bodies that are stored for a line.
const MAX_LINE: u32 = 64;
/// Index that means "no child" or "no tree".
pub const NONE: u32 = u32::MAX;
/// Side of the square tiles of pixels that a workgroup computes.
pub const TILE: u32 = 8;
/// Number of slots over which ray counts are spread, so that atomics rarely collide.
pub const RAY_COUNT_SLOTS: u32 = 256;
/// Kinds of counts: shadow, occlusion, reflected, refracted and certain rays; and paths lost in glass.
pub const RAY_COUNT_KINDS: u32 = 6;

/// Size in bytes of the ray counts, two words a sum. Behind them, one word counts points, further words hold the bodies around the camera, and
/// the word [`CUT_LOOPS`] says whether the driver left a loop before its end.
pub const COUNT_BYTES: u64 = 8 * (RAY_COUNT_SLOTS * RAY_COUNT_KINDS) as u64;
/// Size in bytes of the buffer with the counts.
pub const COUNTS_BUFFER_BYTES: u64 = COUNT_BYTES + 4 * (CUT_LOOPS as u64 - COUNT_BYTES / 4 + 1).next_multiple_of(4);
/// Index of the first word with the bodies around the camera.
const AROUND_EYE: u32 = 2 * RAY_COUNT_SLOTS * RAY_COUNT_KINDS + 1;
/// Index of the word that is 1 where the driver left a loop before its end.
pub const CUT_LOOPS: u32 = AROUND_EYE + effects::MOST_BODIES + 1;
/// Size in bytes of a point: six vectors, see `programs/points.wgsl`.
pub const POINT_BYTES: u64 = 96;
/// Size in bytes of the start of a shadow ray of `deferredShadows`: two vectors, see `programs/shadow_list.wgsl`.
pub const START_BYTES: u64 = 32;

/// Smallest direction component for box tests. Products of its reciprocal with coordinates do not overflow, and the slope is too small to
/// matter: a smaller component is treated as this number, which changes no coordinate of the ray within the scene.
const LEAST_DIRECTION: f32 = 1.0e-18;
/// Largest coordinate of a scene, so that products with reciprocals of directions stay finite.
pub const LARGEST_COORDINATE: f32 = 1.0e15;

/// The parameters of a launch: `Params` of `programs/params.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Params {
    pub eye: [f32; 3],
    pub zero: u32,
    pub to_light: [f32; 3],
    pub seed: u32,
    pub light_color: [f32; 3],
    pub samples: u32,
    pub scene_low: [f32; 3],
    pub strata: u32,
    pub scene_high: [f32; 3],
    pub depth: u32,
    pub width: u32,
    pub height: u32,
    pub origin: [u32; 2],
    pub first_tile: u32,
    pub end_tile: u32,
    pub tiles_across: u32,
    /// Number of points that the list has room for.
    pub capacity: u32,
    pub root: u32,
    pub materials_at: u32,
    pub normals_at: u32,
    pub texcoords_at: u32,
    pub textures_at: u32,
    pub points_at: u32,
    pub open_share_at: u32,
    pub through_glass_at: u32,
    pub cut: u32,
    pub fresnel: u32,
    pub has_normals: u32,
    pub id_base: u32,
    pub radius: f32,
    pub index: f32,
    pub decoded_at: u32,
    pub colors_at: u32,
    pub beyond: [f32; 3],
    pub bodies_at: u32,
    pub tangents_at: u32,
    pub cone_width: f32,
    pub cone_spread: f32,
    pub lights_at: u32,
    pub whole: u32,
    /// Used, like the following fields, only by programs for exact spheres.
    pub sphere_root: u32,
    pub spheres_at: u32,
    pub first_sphere: u32,
}

/// The constants of programs for exact spheres, as WGSL.
#[must_use]
pub fn sphere_constants() -> String {
    text_of([], crate::trace::SPHERE_BOUNDS)
}

/// Words before the spheres that focus light: their number, the tangent of half the angle of the light's disc, the place of the flags (one word
/// for each exact sphere: whether it focuses light), and the direction of light in two parts. The points of the quadratures follow.
pub const LENS_HEAD: u32 = 9;
/// Words of a sphere that focuses light.
pub const LENS_WORDS: u32 = 9;
/// Words of a node: the ray of one angle of incidence, in the table for an index of refraction (`node_place` in `programs/ball.wgsl`).
pub const NODE_WORDS: u32 = 10;

/// Words of the photons of one target: the place of the photons; the place of the starts of the table's entries; the number of entries; the low and
/// the high corner of the photons' bounds; the radius of the discs; the number of cells per scene unit; and the kernel's weight at distance 0.
pub const CLOUD_WORDS: u32 = 12;
/// Words of a photon.
const PHOTON_WORDS: u32 = (size_of::<Photon>() / 4) as u32;

/// The constants of programs where glass focuses light, as WGSL.
#[must_use]
pub fn focus_constants() -> String {
    let integers = [
        ("SHADE_TARGET", SHADE_TARGET),
        ("CLOUD_WORDS", CLOUD_WORDS),
        ("PHOTON_WORDS", PHOTON_WORDS),
        ("OTHER_SIDE", 1 << 31),
    ];
    let floats = [
        ("PHOTON_ALIKE", effects::PHOTON_ALIKE),
        ("PHOTON_FLAT", effects::PHOTON_FLAT),
        ("PHOTON_GRAZING", effects::PHOTON_GRAZING),
    ];
    text_of(integers, floats)
}

/// The constants of programs for spheres that focus light, as WGSL.
#[must_use]
pub fn lens_constants() -> String {
    let integers = [
        ("LENS_HEAD", LENS_HEAD),
        ("LENS_BLUR", 1),
        ("LENS_FLAGS", 2),
        ("LENS_AXIS", 3),
        ("LENS_WORDS", LENS_WORDS),
        ("NODE_WORDS", NODE_WORDS),
        ("CELLS", ball::CELLS as u32),
        ("POINTS", ball::POINTS as u32),
        ("POINTS_AT_AXIS", ball::POINTS_AT_AXIS as u32),
        ("MOST_NEWTON", 40),
    ];
    let step = FRAC_PI_2 / ball::CELLS as f64;
    let floats = [("STEP", step as f32), ("RIGHT_ANGLE", FRAC_PI_2 as f32), ("LENS_WIDTH", LENS_WIDTH as f32)];
    text_of(integers, floats)
}

/// Words before the settings of a pass for paths in glass ([`BODY_HEAD`]), where the ways of paths are a sample: the place of the list of ways, or 0
/// where each pixel takes way 0; and the position of way 0 in the sequence. The list has four words for each pixel: the key of its random numbers,
/// the number of the first way, the number of ways, and 0.
pub const SAMPLE_HEAD: u32 = 2;

/// The constants of programs where the ways of paths in glass are a sample, as WGSL.
#[must_use]
pub fn sample_constants() -> String {
    let integers = [
        ("SAMPLE_WAYS", SAMPLE_HEAD),
        ("SAMPLE_OFFSET", SAMPLE_HEAD - 1),
        ("HASH_FACET_ORDER", effects::FACET_ORDER),
        ("HASH_SPECTRUM", effects::SPECTRUM),
        ("MET_CHANCE", MET_CHANCE.into()),
        ("MET_DIVIDED", MET_DIVIDED.into()),
    ];
    text_of(integers, [])
}

/// Constants as WGSL.
fn text_of<'n>(
    integers: impl IntoIterator<Item = (&'n str, u32)>,
    floats: impl IntoIterator<Item = (&'n str, f32)>,
) -> String {
    let integers = integers.into_iter().map(|(name, value)| format!("const {name}: u32 = {value}u;\n"));
    // `{:e}` is the shortest text that reads back as the same number.
    integers.chain(floats.into_iter().map(|(name, value)| format!("const {name}: f32 = {value:e}f;\n"))).collect()
}

/// The constants of the programs, as WGSL.
#[must_use]
pub fn constants() -> String {
    let integers = [
        ("NO_TRIANGLE", curitiba_pipeline::backend::NO_TRIANGLE),
        ("NO_TEXTURE", effects::NO_TEXTURE),
        ("NONE", NONE),
        ("TRANSPARENT", gpu_binary::TRANSPARENT),
        ("LEAF", gpu_binary::LEAF),
        ("COUNT_SHIFT", gpu_binary::COUNT_SHIFT),
        ("FIRST_OF_LEAF", (1 << gpu_binary::COUNT_SHIFT) - 1),
        ("STACK", gpu_binary::STACK as u32),
        ("FRESNEL_SCHLICK", Fresnel::Schlick as u32),
        ("FRESNEL_S", Fresnel::S as u32),
        ("FRESNEL_P", Fresnel::P as u32),
        ("SHADE_GLASS", SHADE_GLASS),
        ("SHADE_SHADOW_GLASS", SHADE_SHADOW_GLASS),
        ("SHADE_CUT", SHADE_CUT),
        ("SHADE_VERTEX_COLORS", SHADE_VERTEX_COLORS),
        ("SHADE_GLOW", SHADE_GLOW),
        ("SHADE_NORMAL_MAP", SHADE_NORMAL_MAP),
        ("SHADE_SKY", SHADE_SKY),
        ("SHADE_WORDS", SHADE_WORDS),
        ("TEXTURE_WORDS", TEXTURE_WORDS),
        ("WRAP_REPEAT", WRAP_REPEAT),
        ("WRAP_MIRROR", WRAP_MIRROR),
        ("WRAP_CLAMP", WRAP_CLAMP),
        ("LIGHT_HEAD", LIGHT_HEAD),
        ("LIGHT_WORDS", LIGHT_WORDS),
        ("LIGHT_PLACE", LIGHT_PLACE),
        ("LIGHT_CONE", LIGHT_CONE),
        ("BODY_WORDS", BODY_WORDS),
        ("BODY_HEAD", BODY_HEAD),
        ("VERTEX_COLORS_NONE", VERTEX_COLORS_NONE),
        ("VERTEX_COLORS_DISPLAY", VERTEX_COLORS_DISPLAY),
        ("SHAPE_PANE", SHAPE_PANE),
        ("SHAPE_THIN", SHAPE_THIN),
        ("SHAPE_SOLID", SHAPE_SOLID),
        ("MAX_LINE", MAX_LINE),
        ("MOST_BODIES", effects::MOST_BODIES),
        ("MOST_SURFACES", effects::MOST_SURFACES),
        ("AROUND_EYE", AROUND_EYE),
        ("CUT_LOOPS", CUT_LOOPS),
        ("HASH_PIXEL", effects::PIXEL),
        ("HASH_PATH", effects::PATH),
        ("HASH_DIMENSIONS", effects::DIMENSIONS),
        ("HASH_SCRAMBLE", effects::SCRAMBLE),
        ("HASH_DISC", effects::DISC),
        ("HASH_FACETS", effects::FACETS),
        ("HASH_ROULETTE", effects::ROULETTE),
        ("BRANCH_REFLECTED", effects::REFLECTED),
        ("BRANCH_REFRACTED", effects::REFRACTED),
        ("BRANCH_SCATTERED", effects::SCATTERED),
        ("BRANCH_LIGHTS", effects::LIGHTS),
        ("MAX_DEPTH", effects::MAX_DEPTH),
        ("MAX_CROSSINGS", effects::MAX_CROSSINGS),
        ("THROUGH_GLASS_ENTRIES", effects::THROUGH_GLASS_ENTRIES),
        ("RAY_COUNT_SLOTS", RAY_COUNT_SLOTS),
        ("RAY_COUNT_KINDS", RAY_COUNT_KINDS),
        ("TILE", TILE),
    ];
    let floats = [
        ("AMBIENT", effects::AMBIENT),
        ("SHADOWED", effects::SHADOWED),
        ("ROUND", effects::ROUND),
        ("THROUGH_GLASS", effects::THROUGH_GLASS),
        ("BEFORE_LIGHT", effects::BEFORE_LIGHT),
        ("LEAST_ATTENUATION", effects::LEAST_DIVISOR),
        ("THESIS_EPSILON", effects::EPSILON),
        ("THESIS_REFRACTED_EPSILON", effects::REFRACTED_EPSILON),
        ("GLASS_BOUNCE", effects::BOUNCE),
        ("LEAST_DIRECTION", LEAST_DIRECTION),
        ("LEAST_SQUARE", effects::LEAST_SQUARE),
        ("LEAST_HEIGHT", curitiba_pipeline::scene::normal_map::LEAST_HEIGHT),
        ("LEAST_COSINE", curitiba_pipeline::scene::normal_map::LEAST_COSINE),
        ("CAUCHY", curitiba_pipeline::glass::CAUCHY),
        ("CAUCHY_AT_D", curitiba_pipeline::glass::CAUCHY_AT_D),
        ("SMOOTH_ALPHA", curitiba_pipeline::glass::Dielectric::SMOOTH),
    ];
    text_of(
        integers.into_iter().chain(HEAD.into_iter().zip(1..)),
        floats.into_iter().chain(gpu_binary::BOUNDS.iter().copied()).chain(gpu_binary::PLANE_TEST),
    )
}
