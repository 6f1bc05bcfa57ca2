// The parameters of all programs. The constants before this text are written by `layout.rs`, which declares the same structure.
struct Params {
    eye: vec3f,
    // Always 0, which compilers do not know: see `sep`.
    zero: u32,
    to_light: vec3f,
    seed: u32,
    light_color: vec3f,
    samples: u32,
    scene_low: vec3f,
    strata: u32,
    scene_high: vec3f,
    depth: u32,
    // Size of the images in pixels, and their place in the picture.
    width: u32,
    height: u32,
    origin_x: u32,
    origin_y: u32,
    // Tiles of 8 x 8 pixels: the range of this launch, and the number of tiles in a row of the images. Then the capacity of the list of
    // points.
    first_tile: u32,
    end_tile: u32,
    tiles_across: u32,
    capacity: u32,
    // Root of the tree without the sky, or NONE. Then the offsets of the parts of `mesh`, `vertices` and `tables`.
    root: u32,
    materials_at: u32,
    normals_at: u32,
    texcoords_at: u32,
    textures_at: u32,
    points_at: u32,
    open_share_at: u32,
    through_glass_at: u32,
    // Flags: whether any material has cut-outs, how much glass reflects (`Fresnel`), whether there are vertex normals. Then the
    // offset of the ids stored in the triangle attachment.
    cut: u32,
    fresnel: u32,
    has_normals: u32,
    id_base: u32,
    radius: f32,
    index: f32,
    // Offset in `tables` of the linear values of the sRGB codes; 0 where texels are read as stored.
    decoded_at: u32,
    // Offset of the vertex colours in `vertices`.
    colors_at: u32,
    // Colour of rays that leave the scene. Then the offset in `tables` of the glass data, whose first word says how light passes glass
    // (`BODY_HEAD` in `layout.rs`); 0 where all glass is panes.
    beyond: vec3f,
    bodies_at: u32,
    // Offset of the tangents in `vertices`; 0 where there are none.
    tangents_at: u32,
    // The cone of a pixel: its width at the eye, and its growth for each scene unit.
    cone_width: f32,
    cone_spread: f32,
    // Offset in `tables` of the lights of a pass with several lights, one with a place or a disc; 0 for a pass with one directional light that is
    // a point.
    lights_at: u32,
    // Root of the tree that includes the sky, or NONE.
    whole: u32,
⟪    // Root of the tree of exact spheres, or NONE; the place of the spheres in `leaves`, and the id of the first one.
    sphere_root: u32,
    spheres_at: u32,
    first_sphere: u32,
⟫}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var color_buffer: texture_2d<f32>;
@group(0) @binding(2) var position_buffer: texture_2d<f32>;
@group(0) @binding(3) var normal_buffer: texture_2d<f32>;
@group(0) @binding(4) var triangle_buffer: texture_2d<u32>;
@group(0) @binding(5) var output: texture_storage_2d<rgba32float, write>;
// Two words for each sum, the lower one first.
@group(0) @binding(6) var<storage, read_write> ray_counts: array<atomic<u32>>;

// Group 1, the scene, is declared by `split.rs`.

// Data of the pass: materials, textures, occlusion points, open shares, transmission through glass, glass data, lights and photons.
@group(2) @binding(0) var<storage, read> tables: array<u32>;
