// Glass of the report, shared by `refraction` and `final`. Their `thesis_seen` gives the colour at the end of a chain of rays.

// The colour of the glass branch of the report's `buffer_camera`: two chains of rays, since its glass keeps only the reflected colour.
fn thesis_glass(pixel: Pixel) -> vec3f {
    let position = stored_position(pixel).xyz; let normal = stored_normal(pixel);
    let view = thesis_view(position);
    let first = thesis_chain(position, mirrored(view, normal), THESIS_EPSILON, false);
    var refracted: vec3f;
    if !thesis_refracts(view, normal, params.index, &refracted) { return first; }
    let second = thesis_chain(position, refracted, THESIS_REFRACTED_EPSILON, true);
    let weight = thesis_coefficient(normal, view);
    return sep3(weight * second) + sep3((1.0 - weight) * first);
}
fn thesis_chain(first_origin: vec3f, first_direction: vec3f, first_t_min: f32, is_refracted: bool) -> vec3f {
    var origin = first_origin;
    var direction = first_direction;
    var t_min = first_t_min;
    var weight = 1.0;
    for (var bounce = 0u; bounce <= params.depth; bounce += 1u) {
        count(select(REFLECTED, REFRACTED, bounce == 0u && is_refracted));
        var hit: Hit;
        if !thesis_closest(origin, direction, t_min, &hit) { return vec3f(0.0); }
        let position = origin + sep3(hit.t * direction);
        if !is_glass(hit.triangle) { return weight * thesis_seen(position, direction, hit); }
        let normals = thesis_normals(hit);
        let normal = face_forward(normals.shading, -direction, normals.geometric);
        var unused: vec3f;
        if thesis_refracts(direction, normal, params.index, &unused) { weight = weight * GLASS_BOUNCE; }
        origin = position;
        direction = mirrored(direction, normal);
        t_min = THESIS_EPSILON;
    }
    return vec3f(0.0);
}
