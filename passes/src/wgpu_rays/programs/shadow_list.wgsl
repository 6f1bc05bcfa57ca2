// The starts of the pixels' shadow rays, two vectors each. The first: the start, and in w the kind of `shadow_start`, or NOTHING. The
// second, the way, is written and read only for LIFTED.
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
