// The normals by which a filter finds edges: on the viewer's side, 0 where the pixel shows nothing. `unturned` gives the normal of either side.
fn picture(pixel: Pixel) -> vec4f {
    let triangle = stored_triangle(pixel);
    if triangle == NO_TRIANGLE { return vec4f(0.0); }
    let normal = unturned(pixel, triangle);
    return vec4f(select(normal, -normal, dot3(normal, stored_position(pixel).xyz - params.eye) > 0.0), 0.0);
}
