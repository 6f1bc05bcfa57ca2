// The share of the light that reaches the origin of a shadow ray; each surface of glass dims it by the same factor.
fn light_from(origin: vec3f) -> f32 {
    count(SHADOW);
    crossings_stored = 0u;
    crossings_beyond = 0u;
    if occluded(ACCEPT_COUNTS, Ray(origin, to_light(), 0.0, light_end())) { return in_shadow(); }
    return table_number(params.through_glass_at + min(distinct_crossings(), THROUGH_GLASS_ENTRIES - 1u));
}
