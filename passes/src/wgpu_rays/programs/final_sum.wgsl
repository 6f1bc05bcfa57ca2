// The picture of `final`, from its points.
fn picture(pixel: Pixel) -> vec4f {
    let triangle = stored_triangle(pixel);
    if triangle == NO_TRIANGLE { return stored_color(pixel); }
    let slot = slot_of(pixel);
    var point = slot;
    if is_glass(triangle) {
        point = next_of(slot);
        if point == NO_ROOM { return glass_pixel(pixel, triangle, shown_by(pixel, triangle)); }
    }
    var sum = vec3f(0.0);
    if HAS_BODIES && point != slot { sum = missed_of(slot); }
    while point != NONE {
        let color = color_of(point);
        if any(color != vec3f(0.0)) {
            var share = 1.0;
            if params.samples != 0u { share = table_number(params.open_share_at + points[POINT * point + 5u].x); }
            sum += point_vector(point, 2u).w * (color * share);
        }
        point = next_of(point);
    }
⟬    if is_glass(triangle) { return vec4f(sum, 1.0 + f32(points[POINT * slot + 2u].w)); }
⟭    return opaque(sum);
}
