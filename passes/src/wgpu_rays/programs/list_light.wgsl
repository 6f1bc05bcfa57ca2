// Stores a point whose light is found by a later kernel. Few sides are turned away; their light is found now, divided by SHADOWED,
// because the later kernel multiplies turned points by it.
fn put_lit_point(place: u32, surface: Surface, lit_side: vec3f, triangle: u32, key: u32, weight: f32, color: vec3f) {
    let turned = is_turned(triangle, surface.point, lit_side);
    var lit = color;
    if turned && any(color != vec3f(0.0)) { lit = sep3(color * share_at(turned_start(surface, lit_side, triangle))) * (1.0 / SHADOWED); }
    put_point(place, surface, turned, key, weight, lit);
}
