//! Structs and constants that host and device share, declared once: what is here is written to `programs/params.cuh`.

use crate::device::Address;
use cudarc::driver::DeviceRepr;
use curitiba_passes::effects::constants as effects;
pub use curitiba_passes::effects::constants::{MAX_CROSSINGS, MAX_DEPTH, NO_TEXTURE, THROUGH_GLASS_ENTRIES};
use curitiba_passes::trace::gpu_tree;
use curitiba_pipeline::scene::normal_map;
use std::fmt::Write as _;

/// Declares structs in Rust and says how they are spelled in CUDA C++.
macro_rules! shared_structs {
    ($( $(#[$about:meta])* struct $name:ident { $( $(#[$field_about:meta])* $field:ident: $type:ty = $spelling:literal, )* } )*) => {
        $(
            $(#[$about])*
            #[derive(Debug, Clone, Copy, PartialEq, Default)]
            #[repr(C)]
            pub struct $name { $( $(#[$field_about])* pub $field: $type, )* }
        )*

        /// The structs as CUDA C++ declares them, with their sizes and offsets checked there.
        fn structs() -> String {
            let mut text = String::new();
            $(
                write!(text, "\nstruct {} {{\n", stringify!($name)).expect("strings grow");
                $(
                    writeln!(text, "    {};", declaration($spelling, stringify!($field))).expect("strings grow");
                )*
                writeln!(text, "}};\nstatic_assert(sizeof({0}) == {1}, \"{0}\");", stringify!($name), size_of::<$name>())
                    .expect("strings grow");
                $(
                    writeln!(
                        text,
                        "static_assert(offsetof({0}, {1}) == {2}, \"{0}::{1}\");",
                        stringify!($name), stringify!($field), std::mem::offset_of!($name, $field)
                    ).expect("strings grow");
                )*
            )*
            text
        }
    };
}

/// `float[3]` becomes `float name[3]`.
fn declaration(spelling: &str, name: &str) -> String {
    match spelling.split_once('[') {
        Some((element, length)) => format!("{element} {name}[{length}"),
        None => format!("{spelling} {name}"),
    }
}

shared_structs! {
    /// What hits on a material are shaded with.
    struct Shade {
        /// Diffuse colour.
        diffuse: [f32; 3] = "float[3]",
        /// [`SHADE_GLASS`], [`SHADE_SHADOW_GLASS`], [`SHADE_CUT`], [`SHADE_GLOW`], [`SHADE_VERTEX_COLORS`], [`SHADE_NORMAL_MAP`].
        flags: u32 = "unsigned",
        /// Index into [`Params::textures`], or [`NO_TEXTURE`].
        texture: u32 = "unsigned",
        /// With [`SHADE_CUT`]: alpha below this is a hole.
        cutoff: f32 = "float",
        /// With [`SHADE_GLOW`]: light that is added.
        glow: [f32; 3] = "float[3]",
        /// What that is multiplied by: index into [`Params::textures`], or [`NO_TEXTURE`].
        glow_texture: u32 = "unsigned",
        /// With [`SHADE_NORMAL_MAP`]: index into [`Params::textures`].
        normal_texture: u32 = "unsigned",
        /// What x and y of its vectors are multiplied by.
        normal_scale: f32 = "float",
    }

    /// A material as rays in glass see it: `Dielectric` of the pipeline, smooth and without dispersion.
    struct Body {
        /// [`SHAPE_OPAQUE`], [`SHAPE_PANE`], [`SHAPE_THIN`] or [`SHAPE_SOLID`].
        shape: u32 = "unsigned",
        /// Index of refraction.
        index: f32 = "float",
        /// Extinction by colour, per scene unit.
        extinction: [f32; 3] = "float[3]",
        /// Share of the light by colour that passes a surface, beside Fresnel's.
        filter: [f32; 3] = "float[3]",
        /// What that is multiplied by: index into [`Params::textures`], or [`NO_TEXTURE`].
        filter_texture: u32 = "unsigned",
        /// What it is multiplied by of the colours of vertices: [`VERTEX_COLORS_NONE`], [`VERTEX_COLORS_LINEAR`] or
        /// [`VERTEX_COLORS_DISPLAY`].
        filter_vertex_colors: u32 = "unsigned",
        /// Share of the light that enters and is scattered back.
        veil: f32 = "float",
        /// Thickness of a thin wall that absorbs, scene units; else 0.
        thickness: f32 = "float",
        /// Where bodies overlap, the one of the higher priority fills the place.
        priority: u32 = "unsigned",
    }

    /// Level 0 of a texture.
    struct TextureInfo {
        /// Index of its first texel in [`Params::texels`].
        first: u64 = "unsigned long long",
        /// Texels a row.
        width: u32 = "unsigned",
        /// Rows.
        height: u32 = "unsigned",
        /// What lies beyond its sides along u: [`WRAP_REPEAT`], [`WRAP_MIRROR`], [`WRAP_CLAMP`].
        wrap_u: u32 = "unsigned",
        /// Likewise along v.
        wrap_v: u32 = "unsigned",
    }

    /// What a launch is given. Addresses of what the program does not read are 0.
    struct Params {
        /// World position and light cosine of each pixel.
        position: Address = "const float4 *",
        /// Shading normal of each pixel.
        normal: Address = "const float4 *",
        /// Shaded colour of each pixel.
        color: Address = "const float4 *",
        /// Triangle id of each pixel.
        triangle: Address = "const unsigned *",
        /// Where each pixel goes.
        output: Address = "float4 *",
        /// World positions of the vertices, three numbers each.
        positions: Address = "const float *",
        /// Shading normals of the vertices, three numbers each.
        normals: Address = "const float *",
        /// Texture coordinates of the vertices.
        texcoords: Address = "const float2 *",
        /// Colours of the vertices, with [`SHADE_VERTEX_COLORS`].
        colors: Address = "const float4 *",
        /// Tangents of the vertices and sides of the bitangents, with [`SHADE_NORMAL_MAP`].
        tangents: Address = "const float4 *",
        /// Vertices of the triangles, three indices each.
        triangles: Address = "const unsigned *",
        /// Material of each triangle.
        materials: Address = "const unsigned *",
        /// By material.
        shades: Address = "const Shade *",
        /// By texture.
        textures: Address = "const TextureInfo *",
        /// Texels of all textures.
        texels: Address = "const uchar4 *",
        /// The linear values of the 256 codes of sRGB; 0 where texels are read as stored.
        decoded: Address = "const float *",
        /// Occlusion points: both dimensions of the Sobol sequence, bits reversed; then their numbers (`sobol_table.rs`).
        sobol: Address = "const uint2 *",
        /// By the number of open rays: their share to the power of the intensity.
        open_share: Address = "const float *",
        /// By the number of glass surfaces crossed: what is left of the light.
        through_glass: Address = "const float *",
        /// Sums of rays: [`RAY_COUNT_SLOTS`] times [`RAY_COUNT_KINDS`], then [`EXCEPTION_SLOT`].
        ray_counts: Address = "unsigned long long *",
        /// Nodes of our tree, eight vectors each.
        nodes: Address = "const uint4 *",
        /// Triangles of our tree, three vectors each.
        leaves: Address = "const float4 *",
        /// Of `final` on our own traversal: the list of surfaces, [`SURFACE_BYTES`] each.
        surfaces: Address = "float4 *",
        /// By pixel: its first surface in the list.
        first_surface: Address = "unsigned *",
        /// How many surfaces were found, and how far the kernels have come with them.
        progress: Address = "unsigned *",
        /// By pixel, in `final` by surface of the list: what is near, [`SETTLED_BYTES`] each; 0 where that is not asked.
        settled: Address = "uint4 *",
        /// Surfaces that the list has room for.
        capacity: u64 = "unsigned long long",
        /// The structure that OptiX built.
        handle: Address = "unsigned long long",
        /// By material, where glass is what each says; 0 where all of it is panes.
        bodies: Address = "const Body *",
        /// The bodies that the camera is in ([`MEDIA_BYTES`]); 0 where there is none to be in.
        around_eye: Address = "void *",
        /// Number of nodes.
        node_count: u32 = "unsigned",
        /// Pixels a row.
        width: u32 = "unsigned",
        /// Rows.
        height: u32 = "unsigned",
        /// First row of this launch.
        first_row: u32 = "unsigned",
        /// Rows of this launch.
        rows: u32 = "unsigned",
        /// How many of them follow each other in the picture, a multiple of [`BLOCK_HEIGHT`].
        stripe: u32 = "unsigned",
        /// How many rows of other GPUs lie between one stripe and the next.
        skipped: u32 = "unsigned",
        /// Seed of the random numbers.
        seed: u32 = "unsigned",
        /// Occlusion rays a point; 0 switches occlusion off.
        samples: u32 = "unsigned",
        /// Strata a side; 0 takes Sobol points.
        strata: u32 = "unsigned",
        /// Deepest glass bounce, at most [`MAX_DEPTH`].
        depth: u32 = "unsigned",
        /// Whether any material is cut out.
        cut: u32 = "unsigned",
        /// Longest distance to an occluder.
        radius: f32 = "float",
        /// Index of refraction of a pane.
        index: f32 = "float",
        /// Camera position.
        eye: [f32; 3] = "float[3]",
        /// Unit vector towards the light.
        to_light: [f32; 3] = "float[3]",
        /// The light's colour.
        light_color: [f32; 3] = "float[3]",
        /// Least coordinates of all triangles.
        scene_low: [f32; 3] = "float[3]",
        /// Greatest coordinates of all triangles.
        scene_high: [f32; 3] = "float[3]",
        /// Colour of rays that leave the scene through glass or from a mirror.
        beyond: [f32; 3] = "float[3]",
        /// [`ASKS_STRAIGHT`], [`ASKS_EYE`].
        asks: u32 = "unsigned",
        /// 1: Schlick's weights of glass; 0: Fresnel's.
        schlick: u32 = "unsigned",
        /// Triangles of a list of what is near some points, within parts of the radius, at most: no more than [`LISTED`].
        listed: [u32; REACHES as usize - 1] = "unsigned[2]",
        /// Segments between triangles, two vectors each: start and end, direction and pair.
        segments: Address = "const float4 *",
        /// By pair: the two triangles that do not block its segments.
        own: Address = "const uint2 *",
        /// One bit a segment: whether it is blocked.
        blocked: Address = "unsigned *",
        /// How many segments there are.
        segment_count: u64 = "unsigned long long",
    }
}

// SAFETY: plain numbers in C layout, and the device's declarations of both are checked against it by the compiler.
#[allow(unsafe_code, reason = "says that the struct may be passed to a kernel")]
unsafe impl DeviceRepr for Params {}
#[allow(unsafe_code, reason = "says that the struct may be copied to the device")]
// SAFETY: as above.
unsafe impl DeviceRepr for Shade {}
#[allow(unsafe_code, reason = "says that the struct may be copied to the device")]
// SAFETY: as above.
unsafe impl DeviceRepr for TextureInfo {}
#[allow(unsafe_code, reason = "says that the struct may be copied to the device")]
// SAFETY: as above.
unsafe impl DeviceRepr for Body {}

/// Rays bounce on the material.
pub const SHADE_GLASS: u32 = 1;
/// Shadow rays pass through it, dimmed.
pub const SHADE_SHADOW_GLASS: u32 = 2;
/// It is cut out by the alpha of its texture and vertices.
pub const SHADE_CUT: u32 = 4;
/// The material sends out light.
pub const SHADE_GLOW: u32 = 8;
/// What it reflects, and its alpha, is multiplied by the colours of its vertices.
pub const SHADE_VERTEX_COLORS: u32 = 16;
/// A normal map bends its shading normals.
pub const SHADE_NORMAL_MAP: u32 = 32;
/// Light falls straight through glass, weakened by what each material does; else each surface of glass dims it alike.
pub const ASKS_STRAIGHT: u32 = 1;
/// The launch is one thread, which finds the bodies that the camera is in.
pub const ASKS_EYE: u32 = 2;
/// No glass.
pub const SHAPE_OPAQUE: u32 = 0;
/// The report's plane that stands for a whole pane.
pub const SHAPE_PANE: u32 = 1;
/// A plane-parallel wall.
pub const SHAPE_THIN: u32 = 2;
/// The border of a body.
pub const SHAPE_SOLID: u32 = 3;
/// The colours of vertices are no part of a filter.
pub const VERTEX_COLORS_NONE: u32 = 0;
/// They are shares of light.
pub const VERTEX_COLORS_LINEAR: u32 = 1;
/// They are display values of shares of light.
pub const VERTEX_COLORS_DISPLAY: u32 = 2;
/// Where there is no body.
pub const NO_BODY: u32 = u32::MAX;
/// Bytes of a list of bodies: [`effects::MOST_BODIES`] and their number.
pub const MEDIA_BYTES: u32 = 4 * (effects::MOST_BODIES + 1);
/// A texture is seen again beyond its sides.
pub const WRAP_REPEAT: u32 = 0;
/// Mirrored.
pub const WRAP_MIRROR: u32 = 1;
/// The texels at its edge.
pub const WRAP_CLAMP: u32 = 2;
/// Bytes of a surface in the list of `final`.
pub const SURFACE_BYTES: u32 = 64;
/// Bytes of what is known of a point's occlusion rays before any is traced.
pub const SETTLED_BYTES: u32 = 32;
/// Threads of a block along x; a warp is a tile of 8 x 4 pixels.
pub const BLOCK_WIDTH: u32 = 8;
/// Threads of a block along y.
pub const BLOCK_HEIGHT: u32 = 8;
/// Threads of a block that trace segments between triangles.
pub const SEGMENT_THREADS: u32 = 128;
/// Warps of a block that trace the occlusion rays of 32 points together.
pub const TRACING_WARPS: u32 = 4;
/// The radius and parts of it within which occlusion looks at what is near.
pub const REACHES: u32 = 3;
/// Room in a list of what is near, triangles.
pub const LISTED: u32 = 768;
/// Over how many sums the counts of rays are spread, so that threads seldom meet.
pub const RAY_COUNT_SLOTS: u32 = 1024;
/// Kinds of rays that are counted: shadow, occlusion, reflected, refracted, certain; and paths that got lost in glass.
pub const RAY_COUNT_KINDS: u32 = 6;
/// Where among the counts OptiX's exception program writes why a ray was stopped; 0 if none was.
pub const EXCEPTION_SLOT: u32 = RAY_COUNT_SLOTS * RAY_COUNT_KINDS;
/// Types of rays that OptiX's programs tell apart: of radiance (`Phong` in project files) and of shadow.
pub const RAY_TYPES: u32 = 2;
/// Values that OptiX's programs pass along a ray.
pub const PAYLOADS: u32 = 6;

/// The header, whole: `programs/params.cuh`.
#[must_use]
pub fn header() -> String {
    let mut text = String::from(
        "// Written by `cargo test` of this crate from `src/layout.rs`, where everything is declared and described.\n\
         // Do not edit: run the tests with CURITIBA_BLESS=1 to write it anew.\n#pragma once\n#include <cstddef>\n\n",
    );
    let integers = [
        ("NO_TRIANGLE", curitiba_pipeline::backend::NO_TRIANGLE),
        ("NO_TEXTURE", NO_TEXTURE),
        ("TRANSPARENT", gpu_tree::TRANSPARENT),
        ("SHADE_GLASS", SHADE_GLASS),
        ("SHADE_SHADOW_GLASS", SHADE_SHADOW_GLASS),
        ("SHADE_CUT", SHADE_CUT),
        ("SHADE_GLOW", SHADE_GLOW),
        ("SHADE_VERTEX_COLORS", SHADE_VERTEX_COLORS),
        ("SHADE_NORMAL_MAP", SHADE_NORMAL_MAP),
        ("ASKS_STRAIGHT", ASKS_STRAIGHT),
        ("ASKS_EYE", ASKS_EYE),
        ("SHAPE_OPAQUE", SHAPE_OPAQUE),
        ("SHAPE_PANE", SHAPE_PANE),
        ("SHAPE_THIN", SHAPE_THIN),
        ("SHAPE_SOLID", SHAPE_SOLID),
        ("VERTEX_COLORS_NONE", VERTEX_COLORS_NONE),
        ("VERTEX_COLORS_LINEAR", VERTEX_COLORS_LINEAR),
        ("VERTEX_COLORS_DISPLAY", VERTEX_COLORS_DISPLAY),
        ("NO_BODY", NO_BODY),
        ("MOST_BODIES", effects::MOST_BODIES),
        ("MOST_SURFACES", effects::MOST_SURFACES),
        ("MEDIA_BYTES", MEDIA_BYTES),
        ("WRAP_REPEAT", WRAP_REPEAT),
        ("WRAP_MIRROR", WRAP_MIRROR),
        ("WRAP_CLAMP", WRAP_CLAMP),
        ("HASH_PIXEL", effects::PIXEL),
        ("HASH_PATH", effects::PATH),
        ("HASH_DIMENSIONS", effects::DIMENSIONS),
        ("HASH_SCRAMBLE", effects::SCRAMBLE),
        ("BRANCH_REFLECTED", effects::REFLECTED),
        ("BRANCH_REFRACTED", effects::REFRACTED),
        ("MAX_DEPTH", MAX_DEPTH),
        ("MAX_CROSSINGS", MAX_CROSSINGS),
        ("THROUGH_GLASS_ENTRIES", THROUGH_GLASS_ENTRIES),
        ("STACK", gpu_tree::STACK as u32),
        ("SURFACE_BYTES", SURFACE_BYTES),
        ("SETTLED_BYTES", SETTLED_BYTES),
        ("BLOCK_WIDTH", BLOCK_WIDTH),
        ("BLOCK_HEIGHT", BLOCK_HEIGHT),
        ("SEGMENT_THREADS", SEGMENT_THREADS),
        ("TRACING_WARPS", TRACING_WARPS),
        ("REACHES", REACHES),
        ("LISTED", LISTED),
        ("RAY_COUNT_SLOTS", RAY_COUNT_SLOTS),
        ("RAY_COUNT_KINDS", RAY_COUNT_KINDS),
        ("EXCEPTION_SLOT", EXCEPTION_SLOT),
        ("RAY_TYPES", RAY_TYPES),
        ("PAYLOADS", PAYLOADS),
    ];
    for (name, value) in integers {
        writeln!(text, "constexpr unsigned {name} = {value}u;").expect("strings grow");
    }
    let floats = [
        ("AMBIENT", effects::AMBIENT),
        ("SHADOWED", effects::SHADOWED),
        ("ROUND", effects::ROUND),
        ("THROUGH_GLASS", effects::THROUGH_GLASS),
        ("THESIS_EPSILON", effects::EPSILON),
        ("THESIS_REFRACTED_EPSILON", effects::REFRACTED_EPSILON),
        ("GLASS_BOUNCE", effects::BOUNCE),
        ("LEAST_SQUARE", effects::LEAST_SQUARE),
        ("LEAST_HEIGHT", normal_map::LEAST_HEIGHT),
        ("LEAST_COSINE", normal_map::LEAST_COSINE),
    ];
    for (name, value) in floats.into_iter().chain(gpu_tree::BOUNDS.iter().copied()) {
        writeln!(text, "constexpr float {name} = {value:e}f;").expect("strings grow");
    }
    writeln!(text, "constexpr double DEVICE_SHARPEST = {:e};", gpu_tree::DEVICE_SHARPEST).expect("strings grow");
    text + &structs()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_header_of_the_programs_is_what_is_declared_here() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/programs/params.cuh");
        if std::env::var_os("CURITIBA_BLESS").is_some() {
            std::fs::write(path, header()).expect("the crate's folder can be written");
        }
        let found = std::fs::read_to_string(path).expect("the header is there");
        assert_eq!(found, header(), "run this test with CURITIBA_BLESS=1, then programs/build.sh");
    }

    #[test]
    fn arrays_are_spelled_as_c_does() {
        assert_eq!(declaration("float[3]", "eye"), "float eye[3]");
        assert_eq!(declaration("const float *", "normals"), "const float * normals");
    }
}
