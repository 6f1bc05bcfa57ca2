// `final`: glass as in `refraction`, shadows and ambient occlusion, at pixels and at every hit.

// A colour times the share of the light and the ambient occlusion. Black and the colour of a sky stay unchanged, without tracing a ray.
fn visible(color: vec3f, surface: Surface, lit_side: vec3f, triangle: u32, key: u32) -> vec3f {
    if all(color == vec3f(0.0)) || is_sky(triangle) { return color; }
    let light = light_share(surface, lit_side, triangle)⦃ + focused_share(surface, lit_side, triangle)⦄;
    return sep3(color * light) * occlusion(ACCEPT_STOPS, surface, key);
}
fn seen_through(hit: Hit, surface: Surface, key: u32, weight: Weight⟨, footprint: f32⟩) -> vec3f {
    shaded_as_met(hit, surface, key);
    return weight * visible(met_color(hit, surface⟨, footprint⟩), surface, surface.facing, hit.triangle, key);
}

fn thesis_light_share(position: vec3f) -> f32 {
    count(SHADOW);
    return select(SHADOWED, 1.0, thesis_sees_light(ACCEPT_OPAQUE, position));
}
// The report's `closest_hit` passes the ray's direction to `faceforward`, where the other programs pass its opposite.
fn thesis_seen(position: vec3f, direction: vec3f, hit: Hit) -> vec3f {
    let normals = thesis_normals(hit);
    let normal = face_forward(normals.shading, direction, normals.geometric);
    let color = lit_color(hit, normal⟨, NO_FOOTPRINT⟩) * thesis_light_share(position);
    return color * thesis_occlusion(ACCEPT_OPAQUE, position, normal);
}

// The surface that a pixel shows, with the stored normal and the unit direction to it.
struct Shown { surface: Surface, stored: vec3f, view: vec3f }
fn shown_by(pixel: Pixel, triangle: u32) -> Shown {
    let stored = stored_normal(pixel);
    let point = snap(triangle, stored_position(pixel).xyz);
    let view = normalize_or(point.position - params.eye, -point.normal);
    return Shown(surface_of(point, stored, view), stored, view);
}
// A pixel that shows glass.
fn glass_pixel(pixel: Pixel, triangle: u32, shown: Shown) -> vec4f {
    return opaque(glass_color(pixel, triangle, shown.surface, shown.view, pixel_key(pixel)) + missed_color())⟬ + noted()⟭;
}

fn corrected(pixel: Pixel) -> vec4f {
    let triangle = stored_triangle(pixel);
    let color = stored_color(pixel);
    if triangle == NO_TRIANGLE { return color; }
    let shown = shown_by(pixel, triangle);
    if is_glass(triangle) { return glass_pixel(pixel, triangle, shown); }
    let facing = shown.surface.facing;
    let lit_side = select(facing, -facing, dot3(shown.stored, facing) < 0.0);
    let key = pixel_key(pixel);
    shaded_as_seen(shown.stored, key);
    return opaque(visible(seen_from_eye(pixel, color.xyz), shown.surface, lit_side, triangle, key));
}

fn thesis(pixel: Pixel) -> vec4f {
    let stored = stored_color(pixel);
    let position = stored_position(pixel).xyz;
    var color = vec3f(0.0);
    if is_glass_mask(stored) {
        color = thesis_glass(pixel);
    } else {
        color = stored.xyz * thesis_light_share(position);
    }
    return opaque(color * thesis_occlusion(ACCEPT_OPAQUE, position, stored_normal(pixel)));
}
