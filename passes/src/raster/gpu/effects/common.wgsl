// Shared by the pixel programs of the raster effects. The Rust module `raster::effects` documents every formula under
// the same names.

struct Frame {
    // Pixels in a row, and number of rows.
    size: vec2<u32>,
    // First row of this submission: large pictures are computed in several submissions.
    first_row: u32,
    // Offset of stored triangle ids: the stored value is the id plus this.
    id_base: u32,
}

@group(0) @binding(0) var color_buffer: texture_2d<f32>;
@group(0) @binding(1) var position_buffer: texture_2d<f32>;
@group(0) @binding(2) var normal_buffer: texture_2d<f32>;
@group(0) @binding(3) var triangle_buffer: texture_2d<u32>;
@group(1) @binding(0) var<uniform> frame: Frame;
@group(1) @binding(1) var<uniform> params: Params;
//#if SHARE
@group(1) @binding(2) var output: texture_storage_2d<r32float, write>;
//#else
@group(1) @binding(2) var output: texture_storage_2d<rgba32float, write>;
//#endif

// The unit direction from the eye to a position, and the unit normal turned to the eye.
struct Facing {
    view: vec3<f32>,
    normal: vec3<f32>,
    // False where the normal is 0, or the position is the eye's or NaN.
    known: bool,
}

fn facing(eye: vec3<f32>, position: vec3<f32>, normal: vec3<f32>) -> Facing {
    let away = position - eye;
    let lengths = sqrt(vec2<f32>(dot(away, away), dot(normal, normal)));
    if !(all(lengths > vec2<f32>(0.0)) && all(lengths < vec2<f32>(LARGEST))) {
        return Facing(vec3<f32>(0.0), vec3<f32>(0.0), false);
    }
    let view = away / lengths.x;
    let unit_normal = normal / lengths.y;
    return Facing(view, select(unit_normal, -unit_normal, dot(unit_normal, view) > 0.0), true);
}
