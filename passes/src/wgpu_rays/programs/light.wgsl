// What comes from the light to where a ray towards it starts, where each surface of glass dims it alike.
fn light_from(origin: vec3f) -> f32 {
    count(SHADOW);
    crossings_stored = 0u;
    crossings_beyond = 0u;
    if occluded(ACCEPT_COUNTS, Ray(origin, params.to_light, 0.0, HUGE)) { return SHADOWED; }
    return table_number(params.through_glass_at + min(distinct_crossings(), THROUGH_GLASS_ENTRIES - 1u));
}
