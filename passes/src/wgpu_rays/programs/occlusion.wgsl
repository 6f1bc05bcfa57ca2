// Ambient occlusion with one thread for each point: the open share of the point's rays.

// The share of the cosine-weighted hemisphere that is open within the radius, to the power of the intensity; 1 where occlusion is off.
fn occlusion(accept: u32, surface: Surface, key: u32) -> f32 {
    if params.samples == 0u { return 1.0; }
    let origin = spawn(surface.point, surface.facing);
    let basis = basis_around(surface.normal);
    let seeds = dimensions(key, HASH_SCRAMBLE);
    var open = 0u;
    for (var sample = 0u; sample < params.samples; sample += 1u) {
        let direction = to_world(basis, cosine_direction(point_of_sample(sample, key, seeds)));
        let below = min(dot3(direction, surface.facing), 0.0);
        let above = direction - sep3(2.0 * below * surface.facing);
        if !occluded(accept, Ray(origin, above, 0.0, params.radius)) { open += 1u; }
    }
    rays[OCCLUSION] += params.samples;
    note_cut_loops();
    return table_number(params.open_share_at + open);
}

// Ambient occlusion of the report. A ray that is not finite is not traced, and counts as open.
fn thesis_occlusion(accept: u32, position: vec3f, normal: vec3f) -> f32 {
    if params.strata == 0u { return 1.0; }
    let basis = thesis_basis(normal);
    var open = 0u;
    for (var sample = 0u; sample < params.strata * params.strata; sample += 1u) {
        let row = sample / params.strata;
        let direction = to_world(basis, thesis_cosine(thesis_stratum(position, row, sample - row * params.strata, params.strata)));
        if !(is_finite3(direction) && is_finite3(position)) {
            open += 1u;
            continue;
        }
        count(OCCLUSION);
        if !occluded(accept, Ray(position, direction, THESIS_EPSILON, params.radius)) { open += 1u; }
    }
    note_cut_loops();
    return table_number(params.open_share_at + open);
}
