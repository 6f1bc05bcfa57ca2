// `reflection`: a mirror in place of glass. Other pixels keep their colour.

fn corrected(pixel: Pixel) -> vec4f {
    let triangle = stored_triangle(pixel);
    if triangle == NO_TRIANGLE || !is_glass(triangle) { return stored_color(pixel); }
    let point = snap(triangle, stored_position(pixel).xyz);
    var view = normalize_or(point.position - params.eye, -point.normal);
    var surface = surface_of(point, stored_normal(pixel), view);
⟨    var cone = cone_at(surface);
    var mirror = triangle;
⟩    for (var bounce = 0u; bounce <= params.depth; bounce += 1u) {
        let direction = mirrored(view, interface_normal(surface, view));
⟨        cone = cone_mirrored(cone, curvature_of(mirror, surface.facing⟪, surface.point.normal⟫), -dot3(interface_normal(surface, view), view));
⟩        count(REFLECTED);
        var hit: Hit;
        if !closest_surface(spawn(surface.point, direction), direction, &hit) { return opaque(params.beyond); }
⟨        cone = cone_along(cone, hit.t);
        let footprint = footprint_of(cone, hit.triangle, direction);
        mirror = hit.triangle;
⟩        surface = surface_hit(direction, hit⟪, spawn(surface.point, direction)⟫⟨, footprint⟩);
        if !is_glass(hit.triangle) { return opaque(met_color(hit, surface⟨, footprint⟩)); }
        view = direction;
    }
    return opaque(vec3f(0.0));
}

fn thesis(pixel: Pixel) -> vec4f {
    let color = stored_color(pixel);
    if !is_glass_mask(color) { return color; }
    var origin = stored_position(pixel).xyz;
    var direction = mirrored(thesis_view(origin), stored_normal(pixel));
    for (var bounce = 0u; bounce <= params.depth; bounce += 1u) {
        count(REFLECTED);
        var hit: Hit;
        if !thesis_closest(origin, direction, THESIS_EPSILON, &hit) { break; }
        let normals = thesis_normals(hit);
        let normal = face_forward(normals.shading, -direction, normals.geometric);
        if !is_glass(hit.triangle) { return opaque(lit_color(hit, normal⟨, NO_FOOTPRINT⟩)); }
        origin = origin + sep3(hit.t * direction);
        direction = mirrored(direction, normal);
    }
    return opaque(vec3f(0.0));
}
