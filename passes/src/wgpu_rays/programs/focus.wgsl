// Light that glass focuses on surfaces: the light of photons (`photons.wgsl`), and in scenes with exact spheres the light of these (`lens.wgsl`).

// A point of a surface, and the values by which it is lit: its position; the start of rays, the normal along which they are offset, and the
// offset; the side that is lit; the normal by which it was lit, and its cosine with the light; and the factor of the light in its colour
// (`tint`), where AMBIENT has the factor 1.
struct Lit { position: vec3f, start: vec3f, offset: vec3f, step: f32, facing: vec3f, normal: vec3f, cosine: f32, tint: vec3f }
fn tint_of(triangle: u32) -> vec3f {
    let shade = shade_of(triangle);
    return select(vec3f(1.0), shade.diffuse, shade.texture != NO_TEXTURE);
}
// The colour that light from a unit direction would give the surface, as a share of the colour that it has.
fn share_from(towards: vec3f) -> vec3f {
    let bent = lit.tint * params.light_color * max(dot3(lit.normal, towards), 0.0) + AMBIENT;
    return bent / (lit.tint * params.light_color * lit.cosine + AMBIENT);
}

// The surface whose light is searched for.
var<private> lit: Lit;

// The light that glass focuses on a surface, as a share of its colour.
fn focused_light(surface: Lit) -> vec3f {
    lit = surface;
    return ⟪light_of_spheres() + ⟫light_of_photons();
}

// The focused light to add to the share of a surface; `shading` must be set for that surface.
fn focused_share(surface: Surface, lit_side: vec3f, triangle: u32) -> vec3f {
    let point = surface.point;
    let cosine = light_cosine(shade_of(triangle), triangle, point.position, params.to_light);
    let normal = select(surface.normal, -surface.normal, dot3(lit_side, surface.facing) < 0.0);
    let light = focused_light(Lit(point.position, point.start, point.normal, OFFSET_UNITS * point.error, lit_side, normal, cosine,
                                  tint_of(triangle)));
    note_cut_loops();
    return (1.0 - SHADOWED) * light;
}
