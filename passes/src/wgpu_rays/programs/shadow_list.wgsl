// Where the shadow rays of pixels start, one vector each: in the fourth place 1, 0 where the surface is turned from the light, and 2 where
// nothing is seen.
fn list(pixel: Pixel, slot: u32) {
    let triangle = stored_triangle(pixel);
    let position = stored_position(pixel);
    if triangle == NO_TRIANGLE || !(position.w > 0.0) {
        list_nothing(slot);
        return;
    }
    points[slot] = bitcast<vec4u>(shadow_start(triangle, position.xyz));
}
fn list_nothing(slot: u32) { points[slot] = bitcast<vec4u>(vec4f(0.0, 0.0, 0.0, 2.0)); }
