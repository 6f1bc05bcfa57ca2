// Lists the points of `ssao`.
fn list(pixel: Pixel, slot: u32) {
    let triangle = stored_triangle(pixel);
    if triangle == NO_TRIANGLE {
        list_nothing(slot);
        return;
    }
    let point = snap(triangle, stored_position(pixel).xyz);
    let surface = surface_of(point, stored_normal(pixel), normalize_or(point.position - params.eye, -point.normal));
    put_point(slot, surface, false, pixel_key(pixel), 1.0, vec3f(1.0));
}
fn list_nothing(slot: u32) { put_nothing(slot, NONE); }
