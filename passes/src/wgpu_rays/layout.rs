//! Structs and constants that the host and the programs share.

use crate::effects::constants as effects;
use crate::trace::gpu_binary;
use bytemuck::{Pod, Zeroable};
use std::fmt::Write as _;

/// Rays bounce on the material.
pub const SHADE_GLASS: u32 = 1;
/// Shadow rays pass through it, dimmed.
pub const SHADE_SHADOW_GLASS: u32 = 2;
/// It is cut out by the alpha of its texture and vertices.
pub const SHADE_CUT: u32 = 4;
/// What it reflects, and its alpha, is multiplied by the colours of its vertices.
pub const SHADE_VERTEX_COLORS: u32 = 8;
/// The material sends out light.
pub const SHADE_GLOW: u32 = 16;
/// A normal map bends its shading normals.
pub const SHADE_NORMAL_MAP: u32 = 32;
/// Words of a material in the tables.
pub const SHADE_WORDS: u32 = 12;
/// Words of a texture in the tables.
pub const TEXTURE_WORDS: u32 = 5;
/// A texture is seen again beyond its sides.
pub const WRAP_REPEAT: u32 = 0;
/// Mirrored.
pub const WRAP_MIRROR: u32 = 1;
/// The texels at its edge.
pub const WRAP_CLAMP: u32 = 2;
/// Words of a material as rays in glass see it.
pub const BODY_WORDS: u32 = 22;
/// Words in front of them, of what a pass asks of paths in glass: whether light falls straight through; then by [`HEAD`].
pub const BODY_HEAD: u32 = 1 + HEAD.len() as u32;
/// What programs call the places of these words, from the second on.
pub const HEAD: [&str; 10] = [
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
];
/// The colours of vertices are no part of a filter.
pub const VERTEX_COLORS_NONE: u32 = 0;
/// They are shares of light.
pub const VERTEX_COLORS_LINEAR: u32 = 1;
/// They are display values of shares of light.
pub const VERTEX_COLORS_DISPLAY: u32 = 2;
/// No glass.
pub const SHAPE_OPAQUE: u32 = 0;
/// The report's plane that stands for a whole pane.
pub const SHAPE_PANE: u32 = 1;
/// A plane-parallel wall.
pub const SHAPE_THIN: u32 = 2;
/// The border of a body.
pub const SHAPE_SOLID: u32 = 3;
/// Crossings of bodies that are known of a line.
const MAX_LINE: u32 = 64;
/// No child, no tree.
pub const NONE: u32 = u32::MAX;
/// Sides of the tiles of pixels that a workgroup computes.
pub const TILE: u32 = 8;
/// Over how many sums the counts of rays are spread, so that threads seldom meet.
pub const RAY_COUNT_SLOTS: u32 = 256;
/// Kinds of rays that are counted: shadow, occlusion, reflected, refracted, certain; and paths that got lost in glass.
pub const RAY_COUNT_KINDS: u32 = 6;

/// Bytes of the counts of rays, two words a sum. Behind them, one word counts points, and others hold the bodies around the camera.
pub const COUNT_BYTES: u64 = 8 * (RAY_COUNT_SLOTS * RAY_COUNT_KINDS) as u64;
/// Bytes of the buffer with the counts.
pub const COUNTS_BUFFER_BYTES: u64 = COUNT_BYTES + 4 * (1 + effects::MOST_BODIES as u64 + 1).next_multiple_of(4);
/// Bytes of a point: six vectors, see `programs/points.wgsl`.
pub const POINT_BYTES: u64 = 96;
/// Bytes of where a shadow ray of `deferredShadows` starts: two vectors, see `programs/shadow_list.wgsl`.
pub const START_BYTES: u64 = 32;

/// Between the smallest reciprocal that does not overflow with coordinates and the largest slope that matters: a ray that runs along an
/// axis is treated as one that leaves it by this share, which no coordinate of the scene notices.
const LEAST_DIRECTION: f32 = 1.0e-18;
/// Coordinates of a scene at most: products with reciprocals of directions stay finite.
pub const LARGEST_COORDINATE: f32 = 1.0e15;

/// What a launch is given: `Params` of `programs/params.wgsl`.
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
    /// Points that there is room for.
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
    pub schlick: u32,
    pub has_normals: u32,
    pub id_base: u32,
    pub radius: f32,
    pub index: f32,
    pub decoded_at: u32,
    pub colors_at: u32,
    pub beyond: [f32; 3],
    pub bodies_at: u32,
    pub tangents_at: u32,
    pub padding: [u32; 3],
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
        ("SHADE_GLASS", SHADE_GLASS),
        ("SHADE_SHADOW_GLASS", SHADE_SHADOW_GLASS),
        ("SHADE_CUT", SHADE_CUT),
        ("SHADE_VERTEX_COLORS", SHADE_VERTEX_COLORS),
        ("SHADE_GLOW", SHADE_GLOW),
        ("SHADE_NORMAL_MAP", SHADE_NORMAL_MAP),
        ("SHADE_WORDS", SHADE_WORDS),
        ("TEXTURE_WORDS", TEXTURE_WORDS),
        ("WRAP_REPEAT", WRAP_REPEAT),
        ("WRAP_MIRROR", WRAP_MIRROR),
        ("WRAP_CLAMP", WRAP_CLAMP),
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
        ("AROUND_EYE", 2 * RAY_COUNT_SLOTS * RAY_COUNT_KINDS + 1),
        ("HASH_PIXEL", effects::PIXEL),
        ("HASH_PATH", effects::PATH),
        ("HASH_DIMENSIONS", effects::DIMENSIONS),
        ("HASH_SCRAMBLE", effects::SCRAMBLE),
        ("HASH_FACETS", effects::FACETS),
        ("HASH_ROULETTE", effects::ROULETTE),
        ("BRANCH_REFLECTED", effects::REFLECTED),
        ("BRANCH_REFRACTED", effects::REFRACTED),
        ("BRANCH_SCATTERED", effects::SCATTERED),
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
    let mut text = String::new();
    // Writing to a string does not fail. `{:e}` is the shortest text that reads back as the same number.
    for (name, value) in integers.into_iter().chain(HEAD.into_iter().zip(1..)) {
        _ = writeln!(text, "const {name}: u32 = {value}u;");
    }
    for (name, value) in floats.into_iter().chain(gpu_binary::BOUNDS.iter().copied()).chain(gpu_binary::PLANE_TEST) {
        _ = writeln!(text, "const {name}: f32 = {value:e}f;");
    }
    text
}
