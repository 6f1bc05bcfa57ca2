// What comes from the light to where a ray towards it starts, through glass.
fn light_from(origin: vec3f) -> f32 {
    count(SHADOW);
    crossings_stored = 0u;
    crossings_beyond = 0u;
    if occluded(ACCEPT_COUNTS, Ray(origin, params.to_light, 0.0, HUGE)) { return SHADOWED; }
    return table_number(params.through_glass_at + min(distinct_crossings(), THROUGH_GLASS_ENTRIES - 1u));
}
// What reaches a surface of the light, on a side of its triangle.
fn light_share(surface: Surface, lit_side: vec3f, triangle: u32) -> f32 {
    if dot3(lit_side, params.to_light) <= 0.0 { return turned_share(surface, lit_side, triangle); }
    return light_from(spawn(surface.point, params.to_light));
}
// The same of a side that is turned away.
fn turned_share(surface: Surface, lit_side: vec3f, triangle: u32) -> f32 {
    let way = lifted(triangle, surface.point, lit_side);
    if all(way == vec3f(0.0)) { return SHADOWED; }
    let start = spawn(surface.point, lit_side);
    if is_cut_off(ACCEPT_STOPS, start, way) { return SHADOWED; }
    return light_from(sep3(start + way));
}
