// What all programs are given. The constants in front of this text are written from Rust (`layout.rs`), which has the same structure.
struct Params {
    eye: vec3f,
    // 0, which no compiler knows: see `sep`.
    zero: u32,
    to_light: vec3f,
    seed: u32,
    light_color: vec3f,
    samples: u32,
    scene_low: vec3f,
    strata: u32,
    scene_high: vec3f,
    depth: u32,
    // Pixels; and where the images lie in the picture.
    width: u32,
    height: u32,
    origin_x: u32,
    origin_y: u32,
    // Tiles of 8 x 8 pixels: those of this launch, and those of a row of the picture. Points that a launch has room for.
    first_tile: u32,
    end_tile: u32,
    tiles_across: u32,
    capacity: u32,
    // The top of the tree, or NONE. Where each part of `mesh` and of `tables` begins.
    root: u32,
    materials_at: u32,
    normals_at: u32,
    texcoords_at: u32,
    textures_at: u32,
    points_at: u32,
    open_share_at: u32,
    through_glass_at: u32,
    // Flags: whether something is cut out, whether weights are Schlick's, whether there are vertex normals. What ids in the triangle
    // attachment are above their values.
    cut: u32,
    schlick: u32,
    has_normals: u32,
    id_base: u32,
    radius: f32,
    index: f32,
    // Where the linear values of the codes of sRGB begin in `tables`; 0 where texels are read as stored.
    decoded_at: u32,
    // Where vertex colours begin in `vertices`.
    colors_at: u32,
    // What is seen where rays leave the scene; where what is known of glass begins in `tables`, with whether light falls straight
    // through it; 0 where all of it is panes.
    beyond: vec3f,
    bodies_at: u32,
    // Where tangents begin in `vertices`; 0 where there are none.
    tangents_at: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var color_buffer: texture_2d<f32>;
@group(0) @binding(2) var position_buffer: texture_2d<f32>;
@group(0) @binding(3) var normal_buffer: texture_2d<f32>;
@group(0) @binding(4) var triangle_buffer: texture_2d<u32>;
@group(0) @binding(5) var output: texture_storage_2d<rgba32float, write>;
// Two words a sum, the lower one first.
@group(0) @binding(6) var<storage, read_write> ray_counts: array<atomic<u32>>;

// Group 1, the scene, is declared by `split.rs`.

// What the pass knows of materials, then of textures, occlusion points, open shares, what passes through glass, and what glass is.
@group(2) @binding(0) var<storage, read> tables: array<u32>;
