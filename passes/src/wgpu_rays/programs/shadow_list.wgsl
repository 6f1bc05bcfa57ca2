// Where the shadow rays of pixels start, two vectors each: in the fourth place what `shadow_start` says, or that nothing is seen; the
// second is written and read where the way is.
fn list(pixel: Pixel, slot: u32) {
    let triangle = stored_triangle(pixel);
    let position = stored_position(pixel);
    if triangle == NO_TRIANGLE || !(position.w > 0.0) {
        list_nothing(slot);
        return;
    }
    let start = shadow_start(triangle, position.xyz);
    points[2u * slot] = bitcast<vec4u>(vec4f(start.start, start.kind));
    if start.kind == LIFTED { points[2u * slot + 1u] = bitcast<vec4u>(vec4f(start.way, 0.0)); }
}
fn list_nothing(slot: u32) { points[2u * slot] = bitcast<vec4u>(vec4f(0.0, 0.0, 0.0, NOTHING)); }
