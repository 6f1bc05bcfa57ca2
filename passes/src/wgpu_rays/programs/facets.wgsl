// Microfacets of rough interfaces (`effects/dielectric/facets.rs`).

// A visible facet: its unit normal, that of the surface, the width of the distribution, and Smith's function of the viewer.
struct Facet { normal: vec3f, surface: vec3f, alpha: f32, viewer: f32 }

// Smith's auxiliary function of GGX for a direction whose cosine with the normal is given.
fn smith(alpha: f32, cosine: f32) -> f32 {
    let square = sep(cosine * cosine);
    let slope = alpha * alpha * (1.0 - square) / square;
    return 0.5 * slope / (sqrt(1.0 + slope) + 1.0);
}
fn smith_at(alpha: f32, cosine: f32) -> f32 { return smith(alpha, clamp(cosine, 1.0e-6, 1.0)); }

// The facet for a point of the unit square, sampled from the visible normals.
fn facet_seen(alpha: f32, normal: vec3f, view: vec3f, point: vec2f) -> Facet {
    let basis = basis_around(normal);
    let viewer = vec3f(-dot3(view, basis.tangent), -dot3(view, basis.bitangent), max(-dot3(view, normal), 0.0));
    let stretched = normalize_or(vec3f(alpha * viewer.x, alpha * viewer.y, viewer.z), vec3f(0.0, 0.0, 1.0));
    let disk = concentric_disk(point);
    let height = 1.0 + stretched.z;
    let depth = sep(sep(disk.x * disk.x) + sep(disk.y * disk.y)) * height;
    let half_vector = vec3f(disk * sqrt(height * max(2.0 - depth, 0.0)), 1.0 - depth) + stretched;
    let local = normalize_or(vec3f(alpha * half_vector.x, alpha * half_vector.y, max(half_vector.z, 0.0)), vec3f(0.0, 0.0, 1.0));
    return Facet(normalize_or(to_world(basis, local), normal), normal, alpha, smith_at(alpha, viewer.z));
}
// The share of the light sent in this direction that no other facet masks.
fn passes_facets(facet: Facet, direction: vec3f) -> f32 {
    return (1.0 + facet.viewer) / (1.0 + facet.viewer + smith_at(facet.alpha, abs(dot3(direction, facet.surface))));
}

// The width of the distribution at a hit; 0 where the surface is smooth.
fn alpha_at(body: Body, hit: Hit⟨, footprint: f32⟩) -> f32 {
    if body.roughness_texture == NO_TEXTURE || body.alpha <= 0.0 { return body.alpha; }
    let roughness = sample_numbers(body.roughness_texture, texture_coordinates(hit)⟨, footprint⟩).y;
    let alpha = body.alpha * roughness * roughness;
    return select(alpha, 0.0, alpha < SMOOTH_ALPHA);
}
