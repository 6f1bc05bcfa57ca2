// `refraction`: glass that reflects and refracts. Other pixels keep their colour.

fn seen_through(hit: Hit, surface: Surface, key: u32, weight: Weight⟨, footprint: f32⟩) -> vec3f {
    return weight * met_color(hit, surface⟨, footprint⟩);
}
fn thesis_seen(position: vec3f, direction: vec3f, hit: Hit) -> vec3f {
    let normals = thesis_normals(hit);
    return lit_color(hit, face_forward(normals.shading, -direction, normals.geometric)⟨, NO_FOOTPRINT⟩);
}

fn corrected(pixel: Pixel) -> vec4f {
    let triangle = stored_triangle(pixel);
    let color = stored_color(pixel);
    if triangle == NO_TRIANGLE { return color; }
    if !is_glass(triangle) { return vec4f(seen_from_eye(pixel, color.xyz), color.w); }
    let point = snap(triangle, stored_position(pixel).xyz);
    let view = normalize_or(point.position - params.eye, -point.normal);
    let surface = surface_of(point, stored_normal(pixel), view);
    return opaque(glass_color(pixel, triangle, surface, view, pixel_key(pixel)) + missed_color())⟬ + noted()⟭;
}

fn thesis(pixel: Pixel) -> vec4f {
    let color = stored_color(pixel);
    if !is_glass_mask(color) { return color; }
    return opaque(thesis_glass(pixel));
}
