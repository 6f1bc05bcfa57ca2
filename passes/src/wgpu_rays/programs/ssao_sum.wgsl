// The picture of `ssao`, from each point's number of open rays.
fn picture(pixel: Pixel) -> vec4f {
    if stored_triangle(pixel) == NO_TRIANGLE { return vec4f(1.0); }
    return opaque(vec3f(table_number(params.open_share_at + points[POINT * slot_of(pixel) + 5u].x)));
}
