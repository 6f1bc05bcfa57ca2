// The share of the light that reaches the origin of a shadow ray.
fn light_from(origin: vec3f) -> vec3f {
    count(SHADOW);
    crossings_stored = 0u;
    crossings_beyond = 0u;
    if occluded(ACCEPT_COUNTS, Ray(origin, to_light(), 0.0, light_end())) { return vec3f(in_shadow()); }
    if params.bodies_at == 0u || tables[params.bodies_at] == 0u {
        return vec3f(table_number(params.through_glass_at + min(distinct_crossings(), THROUGH_GLASS_ENTRIES - 1u)));
    }
    return in_shadow() + (1.0 - in_shadow()) * straight_through(⟪origin⟫);
}
