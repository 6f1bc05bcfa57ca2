// Whether any pixel calls for maps: without one, none are drawn.
//
//   GLASS   a pixel that shows glass; else one that faces the light

struct Params {
    // Pixels a row, and rows.
    size: vec2<u32>,
    // What triangle ids are stored above their value.
    id_base: u32,
    // How many ranges of triangles are glass.
    ranges: u32,
}

@group(0) @binding(1) var position_buffer: texture_2d<f32>;
@group(0) @binding(3) var triangle_buffer: texture_2d<u32>;
@group(1) @binding(0) var<uniform> params: Params;
// First triangle and end of each range of triangles that are glass, ascending.
@group(1) @binding(1) var<storage, read> glass: array<vec2<u32>>;
@group(1) @binding(2) var<storage, read_write> found: atomic<u32>;

@compute @workgroup_size(GROUP, GROUP)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.size.x || id.y >= params.size.y {
        return;
    }
//#if GLASS
    let calls = is_glass(textureLoad(triangle_buffer, id.xy, 0).x - params.id_base);
//#else
    let calls = textureLoad(position_buffer, id.xy, 0).w > 0.0;
//#endif
    // Reading first: millions of pixels need not write.
    if calls && atomicLoad(&found) == 0u {
        atomicStore(&found, 1u);
    }
}
