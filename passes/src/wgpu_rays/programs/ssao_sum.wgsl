// The picture of `ssao`, from what is known of its points.
fn picture_of(pixel: Pixel, slot: u32) -> vec4f {
    if stored_triangle(pixel) == NO_TRIANGLE { return vec4f(1.0); }
    return opaque(vec3f(table_number(params.open_share_at + points[POINT * slot + 5u].x)));
}
