// Whether any pixel calls for maps: without one, none are drawn.
//
//   GLASS   a pixel that shows glass; else one that faces the light, and the depths of all that do

struct Params {
    // Without GLASS: the dot product with a position and 1 is its depth.
    depth_plane: vec4<f32>,
    // Pixels a row, and rows.
    size: vec2<u32>,
    // What triangle ids are stored above their value.
    id_base: u32,
    // How many ranges of triangles are glass.
    ranges: u32,
}

struct Found {
    // 1 if any pixel does.
    any: atomic<u32>,
    // Without GLASS: the largest complement of the bits of a depth, and the largest bits. Bits of floats of which none is
    // below 0 are ordered as these are.
    nearest: atomic<u32>,
    farthest: atomic<u32>,
}

@group(0) @binding(1) var position_buffer: texture_2d<f32>;
@group(0) @binding(3) var triangle_buffer: texture_2d<u32>;
@group(1) @binding(0) var<uniform> params: Params;
// First triangle and end of each range of triangles that are glass, ascending.
@group(1) @binding(1) var<storage, read> glass: array<vec2<u32>>;
@group(1) @binding(2) var<storage, read_write> found: Found;

@compute @workgroup_size(GROUP, GROUP)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.size.x || id.y >= params.size.y {
        return;
    }
//#if GLASS
    let calls = is_glass(textureLoad(triangle_buffer, id.xy, 0).x - params.id_base);
//#else
    let position = textureLoad(position_buffer, id.xy, 0);
    let calls = position.w > 0.0;
//#endif
    if !calls {
        return;
    }
    // Reading first: millions of pixels need not write.
    if atomicLoad(&found.any) == 0u {
        atomicStore(&found.any, 1u);
    }
//#if GLASS
//#else
    let depth = dot(params.depth_plane, vec4<f32>(position.xyz, 1.0));
    // Also where it is not a number.
    let bits = select(0u, bitcast<u32>(depth), depth > 0.0 && depth < LARGEST);
    if atomicLoad(&found.nearest) < ~bits {
        atomicMax(&found.nearest, ~bits);
    }
    if atomicLoad(&found.farthest) < bits {
        atomicMax(&found.farthest, bits);
    }
//#endif
}
