// Stores a point with its colour; in the vector 4 the share of the light that comes straight and the cosine with the light; in 5, until the light that
// spheres focus is found by a later kernel, its position and what it is a point of.
fn put_lit_point(place: u32, surface: Surface, lit_side: vec3f, triangle: u32, key: u32, weight: f32, color: vec3f) {
    put_point(place, surface, false, key, weight, color);
    if all(color == vec3f(0.0)) { return; }
    let cosine = light_cosine(shade_of(triangle), triangle, surface.point.position, params.to_light);
    points[POINT * place + 4u] = bitcast<vec4u>(vec4f(light_share(surface, lit_side, triangle), cosine));
    let told = triangle | select(0u, OTHER_SIDE, dot3(lit_side, surface.facing) < 0.0);
    points[POINT * place + 5u] = vec4u(bitcast<vec3u>(surface.point.position), told);
}
