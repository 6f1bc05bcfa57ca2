// Finds out whether any pixel needs maps. If none does, no map is drawn.
//
//   GLASS   looks for a pixel that shows glass; else for one that faces the light, and for the range of depths of all such pixels

struct Params {
    // Without GLASS: the dot product of this with a position and 1 is the position's depth.
    depth_plane: vec4<f32>,
    // Pixels in a row, and number of rows.
    size: vec2<u32>,
    // Offset of stored triangle ids: the stored value is the id plus this.
    id_base: u32,
    // Number of ranges of glass triangles.
    ranges: u32,
}

struct Found {
    // 1 if any pixel needs maps.
    any: atomic<u32>,
    // Without GLASS: the greatest complement of a depth's bits, and the greatest bits. Non-negative floats have the
    // same order as their bits.
    nearest: atomic<u32>,
    farthest: atomic<u32>,
}

@group(0) @binding(1) var position_buffer: texture_2d<f32>;
@group(0) @binding(3) var triangle_buffer: texture_2d<u32>;
@group(1) @binding(0) var<uniform> params: Params;
// First triangle and end of each range of glass triangles, ascending.
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
    // Reads first, so that most of the millions of pixels do not write.
    if atomicLoad(&found.any) == 0u {
        atomicStore(&found.any, 1u);
    }
//#if GLASS
//#else
    let depth = dot(params.depth_plane, vec4<f32>(position.xyz, 1.0));
    // A NaN gives 0 as well.
    let bits = select(0u, bitcast<u32>(depth), depth > 0.0 && depth < LARGEST);
    if atomicLoad(&found.nearest) < ~bits {
        atomicMax(&found.nearest, ~bits);
    }
    if atomicLoad(&found.farthest) < bits {
        atomicMax(&found.farthest, bits);
    }
//#endif
}
