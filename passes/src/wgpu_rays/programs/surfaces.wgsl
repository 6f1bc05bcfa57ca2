// The surfaces that a filter finds edges by: normals on the viewer's side, 0 where nothing is seen. `unturned` is the normal before that.
fn picture(pixel: Pixel) -> vec4f {
    let triangle = stored_triangle(pixel);
    if triangle == NO_TRIANGLE { return vec4f(0.0); }
    let normal = unturned(pixel, triangle);
    return vec4f(select(normal, -normal, dot3(normal, stored_position(pixel).xyz - params.eye) > 0.0), 0.0);
}
