// Stores a point with its colour. Vector 4 gets the share of the light that comes straight, and the cosine with the light. Vector 5 gets the
// position and the triangle, until a later kernel finds the light that glass focuses.
fn put_lit_point(place: u32, surface: Surface, lit_side: vec3f, triangle: u32, key: u32, weight: f32, color: vec3f) {
    put_point(place, surface, false, key, weight, color);
    if all(color == vec3f(0.0)) { return; }
    let cosine = light_cosine(shade_of(triangle), triangle, surface.point.position, params.to_light);
    points[POINT * place + 4u] = bitcast<vec4u>(vec4f(light_share(surface, lit_side, triangle), cosine));
    let told = triangle | select(0u, OTHER_SIDE, dot3(lit_side, surface.facing) < 0.0);
    points[POINT * place + 5u] = vec4u(bitcast<vec3u>(surface.point.position), told);
}
