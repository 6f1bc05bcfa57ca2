// The entry point of programs that compute each pixel independently of the others: `compute` returns a pixel's value.
@compute @workgroup_size(GROUP, GROUP)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let pixel = vec2<u32>(id.x, id.y + frame.first_row);
    if pixel.x < frame.size.x && pixel.y < frame.size.y {
        textureStore(output, pixel, compute(pixel));
    }
}
