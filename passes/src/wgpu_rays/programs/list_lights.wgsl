// Stores a point with the colour that the shadows of several lights leave of it.
fn put_lit_point(place: u32, surface: Surface, lit_side: vec3f, triangle: u32, key: u32, weight: f32, color: vec3f) {
    var lit = color;
    if any(color != vec3f(0.0)) { lit = sep3(color * light_share(surface, lit_side, triangle)); }
    put_point(place, surface, false, key, weight, lit);
}
