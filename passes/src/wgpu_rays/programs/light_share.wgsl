// The share of the light that reaches a side of a triangle; `light_from` accounts for glass on the way. In passes with several lights,
// `lights_final.wgsl` replaces this text.

// The start of a ray to the light from a side of a triangle; if `is_dark`, there is no ray.
struct RayStart { origin: vec3f, is_dark: bool }
// The start on the round surface above `start`, for a side that is turned away from the light; `way` leads there (`lifted`).
fn lifted_start(start: vec3f, way: vec3f) -> RayStart {
    if all(way == vec3f(0.0)) { return RayStart(vec3f(0.0), true); }
    return RayStart(sep3(start + way), is_cut_off(ACCEPT_STOPS, start, way));
}
// The share of the light that reaches a start.
fn share_at(start: RayStart) -> Weight {
    if start.is_dark { return SHADOWED * ONE; }
    return light_from(start.origin);
}
// The share of the light that reaches a surface on `lit_side`.
fn light_share(surface: Surface, lit_side: vec3f, triangle: u32) -> Weight {
    var start = RayStart(spawn(surface.point, to_light()), false);
    if is_turned(triangle, surface.point, lit_side) {
        start = lifted_start(spawn(surface.point, lit_side), lifted(triangle, surface.point, lit_side));
    }
    return share_at(start);
}
