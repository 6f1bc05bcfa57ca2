// `ssao`: ambient occlusion, the open share of the cosine-weighted hemisphere to the power of `intensity`.

fn corrected(pixel: Pixel) -> vec4f {
    let triangle = stored_triangle(pixel);
    if triangle == NO_TRIANGLE { return vec4f(1.0); }
    let point = snap(triangle, stored_position(pixel).xyz);
    let surface = surface_of(point, stored_normal(pixel), normalize_or(point.position - params.eye, -point.normal));
    return opaque(vec3f(occlusion(ACCEPT_COVERED, surface, pixel_key(pixel))));
}

fn thesis(pixel: Pixel) -> vec4f {
    return vec4f(thesis_occlusion(ACCEPT_ALL, stored_position(pixel).xyz, stored_normal(pixel)));
}
