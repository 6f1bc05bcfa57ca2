// The depth of each pixel, in 4 bytes instead of a position's 16: `raster::gpu::effects::depths`.

struct Params {
    camera: ScreenCamera,
}

@group(0) @binding(1) var position_buffer: texture_2d<f32>;
@group(1) @binding(0) var<uniform> params: Params;
@group(1) @binding(1) var depths: texture_storage_2d<r32float, write>;

@compute @workgroup_size(LARGE_GROUP, LARGE_GROUP)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= textureDimensions(depths)) {
        return;
    }
    let position = textureLoad(position_buffer, id.xy, 0);
    let depth = dot(params.camera.depths, vec4<f32>(position.xyz - params.camera.origin.xyz, 1.0));
    // In perspective, nothing is visible at the eye or behind it.
    let known = any(position != vec4<f32>(0.0)) && (depth > 0.0 || params.camera.origin.w == 0.0) && abs(depth) < FAR;
    textureStore(depths, id.xy, vec4<f32>(select(FAR, depth, known), 0.0, 0.0, 0.0));
}
