// Stores a point whose light a later kernel finds. For a side that is turned away from the light, it stores the vector to the round surface, from
// which that kernel traces; the vector is 0 where no light falls.
fn put_lit_point(place: u32, surface: Surface, lit_side: vec3f, triangle: u32, key: u32, weight: f32, color: vec3f) {
    let turned = is_turned(triangle, surface.point, lit_side);
    put_point(place, surface, turned, key, weight, color);
    if !turned || all(color == vec3f(0.0)) { return; }
    let side = select(1.0, -1.0, dot3(lit_side, surface.facing) < 0.0);
    points[POINT * place + 4u] = bitcast<vec4u>(vec4f(lifted(triangle, surface.point, lit_side), side));
}
