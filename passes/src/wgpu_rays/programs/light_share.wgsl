// The share of the light that reaches a side of a triangle; `light_from` accounts for glass on the way. `lights_final.wgsl` stands in its
// place in passes with several lights.

// The share of the light that reaches a surface on `lit_side`.
fn light_share(surface: Surface, lit_side: vec3f, triangle: u32) -> Weight {
    if is_turned(triangle, surface.point, lit_side) { return turned_share(surface, lit_side, triangle); }
    return light_from(spawn(surface.point, to_light()));
}
// The same for a side that is turned away from the light.
fn turned_share(surface: Surface, lit_side: vec3f, triangle: u32) -> Weight {
    let way = lifted(triangle, surface.point, lit_side);
    if all(way == vec3f(0.0)) { return SHADOWED * ONE; }
    let start = spawn(surface.point, lit_side);
    if is_cut_off(ACCEPT_STOPS, start, way) { return SHADOWED * ONE; }
    return light_from(sep3(start + way));
}
