//! Structs and constants that host and device share, declared once; they are written to `programs/params.cuh`.

use crate::device::Address;
use cudarc::driver::DeviceRepr;
use curitiba_passes::effects::constants as effects;
pub use curitiba_passes::effects::constants::{MAX_CROSSINGS, MAX_DEPTH, NO_TEXTURE, THROUGH_GLASS_ENTRIES};
use curitiba_passes::trace::{SPHERE_BOUNDS, SPHERE_STACK, gpu_tree};
use curitiba_pipeline::glass::{CAUCHY, CAUCHY_AT_D, Dielectric};
use curitiba_pipeline::programs::Fresnel;
use curitiba_pipeline::scene::normal_map;
use std::fmt::Write as _;

/// Declares structs in Rust, with the type of each field in CUDA C++. They may be copied to the device.
macro_rules! shared_structs {
    ($( $(#[$about:meta])* struct $name:ident { $( $(#[$field_about:meta])* $field:ident: $type:ty = $spelling:literal, )* } )*) => {
        $(
            $(#[$about])*
            #[derive(Debug, Clone, Copy, PartialEq, Default)]
            #[repr(C)]
            pub struct $name { $( $(#[$field_about])* pub $field: $type, )* }
            // SAFETY: plain numbers in C layout; the device compiler checks its declaration of the struct against this layout.
            #[allow(unsafe_code, reason = "says that the struct may be copied to the device and passed to a kernel")]
            unsafe impl DeviceRepr for $name {}
        )*

        /// The declarations of the structs in CUDA C++, with static assertions on their sizes and offsets.
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

/// A field declaration in C++: `float[3]` becomes `float name[3]`.
fn declaration(spelling: &str, name: &str) -> String {
    match spelling.split_once('[') {
        Some((element, length)) => format!("{element} {name}[{length}"),
        None => format!("{spelling} {name}"),
    }
}

shared_structs! {
    /// Shading data of a material, for hits on it.
    struct Shade {
        /// Diffuse colour.
        diffuse: [f32; 3] = "float[3]",
        /// Flags: [`SHADE_GLASS`], [`SHADE_SHADOW_GLASS`], [`SHADE_CUT`], [`SHADE_GLOW`], [`SHADE_VERTEX_COLORS`], [`SHADE_NORMAL_MAP`],
        /// [`SHADE_SKY`].
        flags: u32 = "unsigned",
        /// Colour texture: an index into [`Params::textures`], or [`NO_TEXTURE`].
        texture: u32 = "unsigned",
        /// With [`SHADE_CUT`]: a point with alpha below this is a hole.
        cutoff: f32 = "float",
        /// With [`SHADE_GLOW`]: emitted light.
        glow: [f32; 3] = "float[3]",
        /// Texture that `glow` is multiplied by: an index into [`Params::textures`], or [`NO_TEXTURE`].
        glow_texture: u32 = "unsigned",
        /// With [`SHADE_NORMAL_MAP`]: index of the normal map in [`Params::textures`].
        normal_texture: u32 = "unsigned",
        /// Factor of x and y of the normal map's vectors.
        normal_scale: f32 = "float",
    }

    /// A material for rays in glass: the fields of the pipeline's `Dielectric` that [`Face`] does not hold.
    struct Body {
        /// [`SHAPE_OPAQUE`], [`SHAPE_PANE`], [`SHAPE_THIN`] or [`SHAPE_SOLID`].
        shape: u32 = "unsigned",
        /// Index of refraction.
        index: f32 = "float",
        /// Extinction by colour channel, per scene unit.
        extinction: [f32; 3] = "float[3]",
        /// By colour channel, the factor for light that passes a surface, in addition to Fresnel's factor.
        filter: [f32; 3] = "float[3]",
        /// Texture that `filter` is multiplied by: an index into [`Params::textures`], or [`NO_TEXTURE`].
        filter_texture: u32 = "unsigned",
        /// Vertex colours that `filter` is multiplied by: [`VERTEX_COLORS_NONE`], [`VERTEX_COLORS_LINEAR`] or [`VERTEX_COLORS_DISPLAY`].
        filter_vertex_colors: u32 = "unsigned",
        /// Share of the entering light that is scattered back.
        veil: f32 = "float",
        /// Thickness of a thin wall that absorbs light, in scene units; else 0.
        thickness: f32 = "float",
        /// Where bodies overlap, the one with the highest priority is the medium.
        priority: u32 = "unsigned",
        /// Texture whose red channel multiplies the share that is not scattered back: an index into [`Params::textures`], or [`NO_TEXTURE`].
        transmission_texture: u32 = "unsigned",
    }

    /// Further glass data of a material, for programs that follow ways: the parts of a `Dielectric` that [`Body`] lacks.
    struct Face {
        /// Index of refraction at 486.1 nm minus that at 656.3 nm; 0 without dispersion.
        spread: f32 = "float",
        /// Width of the microfacet distribution, 0 (smooth) to 1.
        alpha: f32 = "float",
        /// Texture whose green channel, squared, multiplies the width: an index into [`Params::textures`], or [`NO_TEXTURE`].
        roughness_texture: u32 = "unsigned",
        /// By colour channel, the factor for reflected light.
        mirrors: [f32; 3] = "float[3]",
        /// Share of light reflected at normal incidence, in place of Fresnel's value.
        minimum: f32 = "float",
        /// Share of light reflected at grazing incidence.
        maximum: f32 = "float",
        /// Exponent of the curve from `minimum` to `maximum`; negative where Fresnel's share is used instead.
        exponent: f32 = "float",
    }

    /// Parameters of a pass whose paths in glass split into several ways (branches), or are cut off.
    struct Ways {
        /// Glass data of each material, in addition to [`Params::bodies`].
        faces: Address = "const Face *",
        /// Strata of the spectrum: for each, the weights of red, green and blue, and the wavelength in nanometres. Behind the last is the wavelength at
        /// which materials state their index.
        strata: Address = "const float4 *",
        /// Points of the unit square from which microfacets are sampled, bits reversed; one for each way that continues from rough glass.
        facets: Address = "const uint2 *",
        /// With [`WAYS_SAMPLED`], for each pixel: the key of its random numbers, the number of the first way, the number of ways, and 0. Null:
        /// the pixel's own key, and way 0.
        samples: Address = "const uint4 *",
        /// Number of strata; 0 without dispersion.
        stratum_count: u32 = "unsigned",
        /// Number of ways that continue from rough glass; 0 where no glass is rough.
        facet_count: u32 = "unsigned",
        /// Flags: [`WAYS_CUT`], [`WAYS_ROULETTE`], [`WAYS_BACKGROUND`], [`WAYS_SAMPLED`].
        asks: u32 = "unsigned",
        /// With [`WAYS_CUT`]: a path is cut off where less than this share of the pixel's colour depends on it.
        cutoff: f32 = "float",
        /// With [`WAYS_CUT`]: most reflections on a path.
        reflections: u32 = "unsigned",
        /// With [`WAYS_CUT`]: most refractions on a path.
        refractions: u32 = "unsigned",
        /// With [`WAYS_ROULETTE`]: key of the random numbers; it differs from one sample of a pixel to the next.
        chances: u32 = "unsigned",
        /// With [`WAYS_SAMPLED`]: position of way 0 in the sequence of points.
        offset: u32 = "unsigned",
    }

    /// A light of a pass with several lights, a light with a position or a disc light: `Light` of the pipeline.
    struct Light {
        /// Position in the world, relative to the scene's origin; read with [`LIGHT_PLACE`].
        place: [f32; 3] = "float[3]",
        /// Flags: [`LIGHT_PLACE`], [`LIGHT_CONE`].
        flags: u32 = "unsigned",
        /// Unit direction in which a directional light travels, or the axis of a spot light.
        direction: [f32; 3] = "float[3]",
        /// Distance at which a light with a position ends; infinite if it does not end.
        range: f32 = "float",
        /// Linear colour of the light before attenuation, range and cone.
        color: [f32; 3] = "float[3]",
        /// With [`LIGHT_CONE`]: the light is multiplied by the cosine of the angle to the axis, raised to this power.
        exponent: f32 = "float",
        /// Constant, linear and quadratic coefficients: at distance d, light with a position is divided by c0 + c1 d + c2 d².
        attenuation: [f32; 3] = "float[3]",
        /// With [`LIGHT_CONE`]: cosine of the angle to the axis up to which the light has full strength.
        inner: f32 = "float",
        /// With [`LIGHT_CONE`]: cosine of the angle to the axis from which on there is no light.
        outer: f32 = "float",
    }

    /// An exact sphere; the list of spheres is in the order of their tree.
    struct Sphere {
        /// Centre in the world, relative to the scene's origin.
        center: [f32; 3] = "float[3]",
        /// Radius.
        radius: f32 = "float",
        /// Id of the surface, with [`gpu_tree::TRANSPARENT`].
        id: u32 = "unsigned",
        /// In entry `i`: index in the list of the sphere whose id is the first id plus `i`. Not related to the other fields.
        place: u32 = "unsigned",
        /// Fills the struct up to 32 bytes.
        unused: [u32; 2] = "unsigned[2]",
    }

    /// A node of the tree over exact spheres: that of [`SphereTree`](curitiba_passes::trace::SphereTree).
    struct SphereNode {
        /// Low corner of the box.
        low: [f32; 3] = "float[3]",
        /// In a leaf: index of its first sphere. In an inner node: index of the first child; the second child follows it.
        first: u32 = "unsigned",
        /// High corner of the box.
        high: [f32; 3] = "float[3]",
        /// Number of spheres in a leaf; 0 in an inner node.
        count: u32 = "unsigned",
    }

    /// The exact spheres of a scene.
    struct Spheres {
        /// Nodes of the tree, the root first.
        nodes: Address = "const SphereNode *",
        /// The spheres.
        list: Address = "const Sphere *",
        /// Number of nodes; 0 where rays meet no sphere.
        node_count: u32 = "unsigned",
        /// Id of the first sphere.
        first: u32 = "unsigned",
        /// Low corner of the bounds of all spheres.
        low: [f32; 3] = "float[3]",
        /// High corner of the bounds of all spheres.
        high: [f32; 3] = "float[3]",
    }

    /// A ray that has passed a sphere of glass of radius 1: `Turned` of the processor.
    struct Turned {
        /// Sine of the angle of incidence.
        sin: f64 = "double",
        /// Cosine of the angle of incidence.
        cos: f64 = "double",
        /// Cosine of the angle of refraction, inside the sphere.
        inner: f64 = "double",
        /// Unit direction in which the ray leaves: x is away from the axis, on the side where the ray met the sphere; y is along the axis.
        direction: [f64; 2] = "double[2]",
        /// Derivative of the ray's deflection with respect to the angle of incidence.
        rate: f64 = "double",
    }

    /// A sphere that focuses light.
    struct Lens {
        /// Centre in the world, relative to the scene's origin.
        center: [f32; 3] = "float[3]",
        /// Radius.
        radius: f32 = "float",
        /// Index of refraction.
        index: f32 = "float",
        /// Id of the sphere.
        id: u32 = "unsigned",
        /// Material of the sphere.
        material: u32 = "unsigned",
        /// Index in [`Focused::nodes`] of the first ray that has this index of refraction.
        node: u32 = "unsigned",
    }

    /// A photon on a surface: [`Photon`](curitiba_passes::effects::dielectric::Photon), which is copied word by word.
    struct Photon {
        /// Where it landed, world.
        position: [f32; 3] = "float[3]",
        /// Unit direction in which it came.
        direction: [f32; 3] = "float[3]",
        /// Unit geometric normal there, on the side that it came from.
        normal: [f32; 3] = "float[3]",
        /// Its power, by colour.
        power: [f32; 3] = "float[3]",
        /// Its number among those that were shot at the same target.
        number: u32 = "unsigned",
        /// Its entry in the table of cells.
        bucket: u32 = "unsigned",
    }

    /// The photons of one target, which are found by a table of cells.
    struct PhotonCloud {
        /// The photons, sorted by their entry in the table.
        photons: Address = "const Photon *",
        /// For each entry of the table the index of its first photon, and at the end the number of photons.
        starts: Address = "const unsigned *",
        /// Low corner of the photons' bounds.
        low: [f32; 3] = "float[3]",
        /// Number of entries of the table, a power of two.
        entries: u32 = "unsigned",
        /// High corner of the photons' bounds.
        high: [f32; 3] = "float[3]",
        /// Radius of the discs over which light is averaged.
        radius: f32 = "float",
        /// Number of cells per scene unit.
        cells: f32 = "float",
        /// The kernel's weight at distance 0, in 1 / area.
        weight: f32 = "float",
    }

    /// The light that glass focuses in a pass.
    struct Focused {
        /// The spheres that focus light.
        list: Address = "const Lens *",
        /// For each index of refraction, rays of equally spaced angles of incidence from 0 to a right angle: one more than there are steps.
        nodes: Address = "const Turned *",
        /// Points and weights of two quadratures, first the one with fewer points.
        points: Address = "const double2 *",
        /// For each exact sphere of the scene, in the order of their ids: 1 if it focuses light, else 0.
        by_sphere: Address = "const unsigned *",
        /// The photons of each target.
        clouds: Address = "const PhotonCloud *",
        /// Unit direction in which the light travels.
        axis: [f64; 3] = "double[3]",
        /// A unit vector across `axis`.
        across: [f64; 3] = "double[3]",
        /// Half the width of the light's disc at the distance 1; 0 for a point.
        blur: f64 = "double",
        /// Number of spheres in `list`.
        count: u32 = "unsigned",
        /// Number of targets in `clouds`. If it is not 0, all bodies of meshes that bend light are targets.
        cloud_count: u32 = "unsigned",
    }

    /// Level 0 of a texture; where there are other levels, they follow it.
    struct TextureInfo {
        /// Index of the texture's first texel in [`Params::texels`].
        first: u64 = "unsigned long long",
        /// Width in texels.
        width: u32 = "unsigned",
        /// Height in texels.
        height: u32 = "unsigned",
        /// Wrapping along u: [`WRAP_REPEAT`], [`WRAP_MIRROR`], [`WRAP_CLAMP`].
        wrap_u: u32 = "unsigned",
        /// Wrapping along v.
        wrap_v: u32 = "unsigned",
        /// Not 0 where a magnified texture is read at the nearest texel only.
        nearest: u32 = "unsigned",
        /// Fills the struct up to the alignment of [`Self::first`].
        unused: u32 = "unsigned",
    }

    /// The parameters of a launch. Addresses of data that the program does not read are 0.
    struct Params {
        /// For each pixel: world position, and the cosine by which the light is multiplied.
        position: Address = "const float4 *",
        /// Shading normal of each pixel.
        normal: Address = "const float4 *",
        /// Shaded colour of each pixel.
        color: Address = "const float4 *",
        /// Triangle id of each pixel.
        triangle: Address = "const unsigned *",
        /// Output colour of each pixel.
        output: Address = "float4 *",
        /// World positions of the vertices, three numbers each.
        positions: Address = "const float *",
        /// Shading normals of the vertices, three numbers each.
        normals: Address = "const float *",
        /// Texture coordinates of the vertices.
        texcoords: Address = "const float2 *",
        /// Colours of the vertices; read with [`SHADE_VERTEX_COLORS`].
        colors: Address = "const float4 *",
        /// Tangents of the vertices, with the sign of the bitangent in w; read with [`SHADE_NORMAL_MAP`].
        tangents: Address = "const float4 *",
        /// Vertices of the triangles, three indices each.
        triangles: Address = "const unsigned *",
        /// Material of each triangle, then of each exact sphere.
        materials: Address = "const unsigned *",
        /// Shading data of each material.
        shades: Address = "const Shade *",
        /// Description of each texture.
        textures: Address = "const TextureInfo *",
        /// Texels of all textures.
        texels: Address = "const uchar4 *",
        /// Linear values of the 256 sRGB codes; 0 where texels are read as stored.
        decoded: Address = "const float *",
        /// Occlusion points: both dimensions of the Sobol sequence, bits reversed; then sample numbers in neighbouring order
        /// (`sobol_table.rs`).
        sobol: Address = "const uint2 *",
        /// For each number of unoccluded occlusion rays: their share, to the power of the intensity.
        open_share: Address = "const float *",
        /// For each number of glass surfaces crossed: the share of the light that is left.
        through_glass: Address = "const float *",
        /// Ray counts: [`RAY_COUNT_SLOTS`] times [`RAY_COUNT_KINDS`] sums, then the exception code, at [`EXCEPTION_SLOT`].
        ray_counts: Address = "unsigned long long *",
        /// Nodes of our tree, eight vectors each.
        nodes: Address = "const uint4 *",
        /// Triangles of our tree, three vectors each.
        leaves: Address = "const float4 *",
        /// For `final` on our own traversal: the list of surfaces, [`SURFACE_BYTES`] each.
        surfaces: Address = "float4 *",
        /// For `final` on our own traversal: for each pixel, the index of its first surface in `surfaces`.
        first_surface: Address = "unsigned *",
        /// Progress counters of the kernels: surfaces found, and how far each kernel has come.
        progress: Address = "unsigned *",
        /// What is known of occlusion rays before any is traced, [`SETTLED_BYTES`] for each pixel or, in `final`, for each listed surface; 0 where
        /// rays are not settled.
        settled: Address = "uint4 *",
        /// Number of surfaces for which `surfaces` has room.
        capacity: u64 = "unsigned long long",
        /// Handle of the acceleration structure that OptiX built.
        handle: Address = "unsigned long long",
        /// Glass data of each material, where materials define their glass; 0 where all glass is panes.
        bodies: Address = "const Body *",
        /// The bodies that the camera is in ([`MEDIA_BYTES`]); 0 where there are no bodies.
        around_eye: Address = "void *",
        /// Number of nodes of our tree.
        node_count: u32 = "unsigned",
        /// Width of the picture in pixels.
        width: u32 = "unsigned",
        /// Height of the picture in pixels.
        height: u32 = "unsigned",
        /// First row of this launch.
        first_row: u32 = "unsigned",
        /// Number of rows of this launch.
        rows: u32 = "unsigned",
        /// Number of consecutive rows in a stripe, a multiple of [`BLOCK_HEIGHT`].
        stripe: u32 = "unsigned",
        /// Number of rows between one stripe and the next, which other GPUs compute.
        skipped: u32 = "unsigned",
        /// Seed of the random numbers.
        seed: u32 = "unsigned",
        /// Number of occlusion rays a point; 0 switches occlusion off.
        samples: u32 = "unsigned",
        /// Number of strata along each side of the unit square of occlusion samples; 0 selects Sobol points.
        strata: u32 = "unsigned",
        /// Greatest number of glass bounces, at most [`MAX_DEPTH`].
        depth: u32 = "unsigned",
        /// 1 if any material has cut-outs, in corrected fidelity; else 0.
        cut: u32 = "unsigned",
        /// Length of occlusion rays.
        radius: f32 = "float",
        /// Index of refraction of a pane.
        index: f32 = "float",
        /// Camera position.
        eye: [f32; 3] = "float[3]",
        /// Unit vector towards the light.
        to_light: [f32; 3] = "float[3]",
        /// The light's colour.
        light_color: [f32; 3] = "float[3]",
        /// Low corner of the bounds of our tree's triangles.
        scene_low: [f32; 3] = "float[3]",
        /// High corner of the bounds of our tree's triangles.
        scene_high: [f32; 3] = "float[3]",
        /// Colour of rays that leave the scene after glass or a mirror.
        beyond: [f32; 3] = "float[3]",
        /// Flags: [`ASKS_STRAIGHT`], [`ASKS_EYE`], [`ASKS_FOCUSED`].
        asks: u32 = "unsigned",
        /// How much interfaces of glass reflect: [`FRESNEL_EXACT`], [`FRESNEL_SCHLICK`], [`FRESNEL_S`] or [`FRESNEL_P`].
        fresnel: u32 = "unsigned",
        /// Greatest length of a list of nearby triangles, for each part of the radius; at most [`LISTED`].
        listed: [u32; REACHES as usize - 1] = "unsigned[2]",
        /// Width of a pixel's ray cone at the eye, in scene units. This and `cone_spread` are 0 where textures are read at level 0.
        cone_width: f32 = "float",
        /// Growth of the cone's width per scene unit.
        cone_spread: f32 = "float",
        /// Segments between triangles, two vectors each: (start, length), (direction, pair). In programs that follow ways, the address of
        /// [`Ways`].
        segments: Address = "const float4 *",
        /// For each pair: the two triangles that do not block its segments.
        own: Address = "const uint2 *",
        /// Results: one bit a segment, set if the segment is blocked.
        blocked: Address = "unsigned *",
        /// Number of segments.
        segment_count: u64 = "unsigned long long",
        /// The lights of a pass with several lights, a light with a position or a disc light; 0 where there is one directional light without a disc.
        lights: Address = "const Light *",
        /// For each material, three numbers: its emission, which is added to the light from `lights`.
        emissions: Address = "const float *",
        /// Number of lights.
        light_count: u32 = "unsigned",
        /// Share of a light that arrives behind an opaque occluder. If above 0, there is a single directional light, and programs write the share
        /// of this light that arrives. If 0, programs write the share of the colour that the shadows of all lights leave.
        in_shadow: f32 = "float",
        /// Points of the unit square for the discs of directional lights, bits reversed; 0 where these lights have no disc.
        disc: Address = "const uint2 *",
        /// Number of points in `disc`.
        disc_samples: u32 = "unsigned",
        /// Height of the spherical cap that a disc covers on the unit sphere of directions.
        disc_height: f32 = "float",
        /// On our own traversal: address of a copy of these parameters with the tree of the sky as its tree; 0 without a sky.
        sky: Address = "const Params *",
        /// Handle of the acceleration structure that OptiX built of a sky; 0 without one.
        sky_handle: Address = "unsigned long long",
        /// The exact spheres of the scene; 0 where there are none.
        spheres: Address = "const Spheres *",
        /// With [`ASKS_FOCUSED`]: the light that glass focuses.
        focused: Address = "const Focused *",
    }
}

/// The light has a position.
pub const LIGHT_PLACE: u32 = 1;
/// The light is a spot light.
pub const LIGHT_CONE: u32 = 2;
/// Rays bounce on the material (reflection and refraction).
pub const SHADE_GLASS: u32 = 1;
/// Shadow rays pass the material, dimmed.
pub const SHADE_SHADOW_GLASS: u32 = 2;
/// The material has cut-outs, by the alpha of its texture and vertices.
pub const SHADE_CUT: u32 = 4;
/// The material emits light.
pub const SHADE_GLOW: u32 = 8;
/// The material's reflected colour and alpha are multiplied by the vertex colours.
pub const SHADE_VERTEX_COLORS: u32 = 16;
/// A normal map bends the material's shading normals.
pub const SHADE_NORMAL_MAP: u32 = 32;
/// The material is a sky, whose colour is shown without lighting.
pub const SHADE_SKY: u32 = 64;
/// Light passes glass in a straight line, attenuated as each material defines. If unset, each glass surface dims it by the same factor.
pub const ASKS_STRAIGHT: u32 = 1;
/// The launch is a single thread, which finds the bodies that the camera is in.
pub const ASKS_EYE: u32 = 2;
/// Glass focuses light on surfaces.
pub const ASKS_FOCUSED: u32 = 4;
/// Not glass.
pub const SHAPE_OPAQUE: u32 = 0;
/// The report's plane that represents a whole pane.
pub const SHAPE_PANE: u32 = 1;
/// A plane-parallel wall.
pub const SHAPE_THIN: u32 = 2;
/// The surface of a body.
pub const SHAPE_SOLID: u32 = 3;
/// Fresnel's equations for unpolarised light.
pub const FRESNEL_EXACT: u32 = Fresnel::Exact as u32;
/// Schlick's approximation.
pub const FRESNEL_SCHLICK: u32 = Fresnel::Schlick as u32;
/// Fresnel's equation for light that is polarised across the plane of incidence.
pub const FRESNEL_S: u32 = Fresnel::S as u32;
/// Fresnel's equation for light that is polarised in the plane of incidence.
pub const FRESNEL_P: u32 = Fresnel::P as u32;
/// Vertex colours do not affect the filter.
pub const VERTEX_COLORS_NONE: u32 = 0;
/// Vertex colours are linear shares of light.
pub const VERTEX_COLORS_LINEAR: u32 = 1;
/// Vertex colours are display values (sRGB) of shares of light.
pub const VERTEX_COLORS_DISPLAY: u32 = 2;
/// Paths are cut off below a share of the pixel's colour, or after a number of reflections or refractions.
pub const WAYS_CUT: u32 = 1;
/// A path below the share [`Ways::cutoff`] continues at random, by Russian roulette.
pub const WAYS_ROULETTE: u32 = 2;
/// Paths that are cut off show the background; if unset, black.
pub const WAYS_BACKGROUND: u32 = 4;
/// Each pixel follows some of its ways, which are a sample.
pub const WAYS_SAMPLED: u32 = 8;
/// Marks the medium outside all bodies.
pub const NO_BODY: u32 = u32::MAX;
/// Size of a list of bodies in bytes: [`effects::MOST_BODIES`] entries and their number.
pub const MEDIA_BYTES: u32 = 4 * (effects::MOST_BODIES + 1);
/// The texture repeats beyond its border.
pub const WRAP_REPEAT: u32 = 0;
/// The texture repeats mirrored.
pub const WRAP_MIRROR: u32 = 1;
/// The texels at the border continue.
pub const WRAP_CLAMP: u32 = 2;
/// Size of a surface in the list of `final`, in bytes.
pub const SURFACE_BYTES: u32 = 64;
/// Size in bytes of the record `Settled`: what is known of a point's occlusion rays before any of them is traced.
pub const SETTLED_BYTES: u32 = 32;
/// Threads of a block along x; a warp is a tile of 8 x 4 pixels.
pub const BLOCK_WIDTH: u32 = 8;
/// Threads of a block along y.
pub const BLOCK_HEIGHT: u32 = 8;
/// Threads of a block that traces segments between triangles.
pub const SEGMENT_THREADS: u32 = 128;
/// Warps of a block that traces the occlusion rays of 32 points together.
pub const TRACING_WARPS: u32 = 4;
/// Number of distances within which nearby triangles are gathered: the radius and parts of it.
pub const REACHES: u32 = 3;
/// Capacity of a list of nearby triangles.
pub const LISTED: u32 = 768;
/// Number of slots over which ray counts are spread, so that atomics rarely collide.
pub const RAY_COUNT_SLOTS: u32 = 1024;
/// Number of kinds of counts: shadow, occlusion, reflected and refracted rays; occlusion rays skipped as certain misses; paths lost in glass.
pub const RAY_COUNT_KINDS: u32 = 6;
/// Index, behind the ray counts, at which OptiX's exception program writes its code; the value there is 0 without an exception.
pub const EXCEPTION_SLOT: u32 = RAY_COUNT_SLOTS * RAY_COUNT_KINDS;
/// Number of ray types of OptiX's programs: radiance (`Phong` in project files) and shadow.
pub const RAY_TYPES: u32 = 2;
/// Number of payload values of a ray in OptiX.
pub const PAYLOADS: u32 = 6;

/// The whole header `programs/params.cuh`.
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
        ("LIGHT_PLACE", LIGHT_PLACE),
        ("LIGHT_CONE", LIGHT_CONE),
        ("SHADE_GLASS", SHADE_GLASS),
        ("SHADE_SHADOW_GLASS", SHADE_SHADOW_GLASS),
        ("SHADE_CUT", SHADE_CUT),
        ("SHADE_GLOW", SHADE_GLOW),
        ("SHADE_VERTEX_COLORS", SHADE_VERTEX_COLORS),
        ("SHADE_NORMAL_MAP", SHADE_NORMAL_MAP),
        ("SHADE_SKY", SHADE_SKY),
        ("ASKS_STRAIGHT", ASKS_STRAIGHT),
        ("ASKS_EYE", ASKS_EYE),
        ("ASKS_FOCUSED", ASKS_FOCUSED),
        ("SHAPE_OPAQUE", SHAPE_OPAQUE),
        ("SHAPE_PANE", SHAPE_PANE),
        ("SHAPE_THIN", SHAPE_THIN),
        ("SHAPE_SOLID", SHAPE_SOLID),
        ("FRESNEL_EXACT", FRESNEL_EXACT),
        ("FRESNEL_SCHLICK", FRESNEL_SCHLICK),
        ("FRESNEL_S", FRESNEL_S),
        ("FRESNEL_P", FRESNEL_P),
        ("VERTEX_COLORS_NONE", VERTEX_COLORS_NONE),
        ("VERTEX_COLORS_LINEAR", VERTEX_COLORS_LINEAR),
        ("VERTEX_COLORS_DISPLAY", VERTEX_COLORS_DISPLAY),
        ("WAYS_CUT", WAYS_CUT),
        ("WAYS_ROULETTE", WAYS_ROULETTE),
        ("WAYS_BACKGROUND", WAYS_BACKGROUND),
        ("WAYS_SAMPLED", WAYS_SAMPLED),
        ("MET_CHANCE", effects::MET_CHANCE.into()),
        ("MET_DIVIDED", effects::MET_DIVIDED.into()),
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
        ("HASH_DISC", effects::DISC),
        ("HASH_FACETS", effects::FACETS),
        ("HASH_FACET_ORDER", effects::FACET_ORDER),
        ("HASH_SPECTRUM", effects::SPECTRUM),
        ("HASH_ROULETTE", effects::ROULETTE),
        ("BRANCH_REFLECTED", effects::REFLECTED),
        ("BRANCH_REFRACTED", effects::REFRACTED),
        ("BRANCH_SCATTERED", effects::SCATTERED),
        ("BRANCH_LIGHTS", effects::LIGHTS),
        ("MAX_DEPTH", MAX_DEPTH),
        ("MAX_CROSSINGS", MAX_CROSSINGS),
        ("THROUGH_GLASS_ENTRIES", THROUGH_GLASS_ENTRIES),
        ("STACK", gpu_tree::STACK as u32),
        ("SPHERE_STACK", SPHERE_STACK as u32),
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
        ("CELLS", effects::CELLS as u32),
        ("POINTS", effects::POINTS as u32),
        ("POINTS_AT_AXIS", effects::POINTS_AT_AXIS as u32),
    ];
    for (name, value) in integers {
        writeln!(text, "constexpr unsigned {name} = {value}u;").expect("strings grow");
    }
    let floats = [
        ("AMBIENT", effects::AMBIENT),
        ("SHADOWED", effects::SHADOWED),
        ("ROUND", effects::ROUND),
        ("THROUGH_GLASS", effects::THROUGH_GLASS),
        ("BEFORE_LIGHT", effects::BEFORE_LIGHT),
        ("LEAST_DIVISOR", effects::LEAST_DIVISOR),
        ("THESIS_EPSILON", effects::EPSILON),
        ("THESIS_REFRACTED_EPSILON", effects::REFRACTED_EPSILON),
        ("GLASS_BOUNCE", effects::BOUNCE),
        ("LEAST_SQUARE", effects::LEAST_SQUARE),
        ("LEAST_HEIGHT", normal_map::LEAST_HEIGHT),
        ("LEAST_COSINE", normal_map::LEAST_COSINE),
        ("CAUCHY", CAUCHY),
        ("CAUCHY_AT_D", CAUCHY_AT_D),
        ("SMOOTH_ALPHA", Dielectric::SMOOTH),
        ("PHOTON_ALIKE", effects::PHOTON_ALIKE),
        ("PHOTON_FLAT", effects::PHOTON_FLAT),
        ("PHOTON_GRAZING", effects::PHOTON_GRAZING),
    ];
    for (name, value) in floats.into_iter().chain(gpu_tree::BOUNDS.iter().copied()).chain(SPHERE_BOUNDS) {
        writeln!(text, "constexpr float {name} = {value:e}f;").expect("strings grow");
    }
    for (name, value) in [("DEVICE_SHARPEST", gpu_tree::DEVICE_SHARPEST), ("LENS_WIDTH", effects::LENS_WIDTH)] {
        writeln!(text, "constexpr double {name} = {value:e};").expect("strings grow");
    }
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
