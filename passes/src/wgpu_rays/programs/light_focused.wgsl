// Light that passes straight through glass, except through glass that focuses it: spheres that focus light, and meshes whose light photons carry,
// stop straight light (`shadow.rs`, `Pass::focuses`). Replaces `light_from.wgsl`.

⟪// The place in the tables of the spheres that focus light (`lenses.rs` of this backend).
fn lenses_at() -> u32 { return tables[params.bodies_at]; }

// The origin of the ray to the light, and the sphere that the ray ignores; NONE if it ignores none.
var<private> line_origin: vec3f;
var<private> left_out: u32 = NONE;

// Whether this sphere focuses light that meets it, so that the light does not go straight on. This holds for rays from outside of the sphere.
fn focuses(id: u32) -> bool {
    if tables[tables[lenses_at() + LENS_FLAGS] + (id - params.first_sphere)] == 0u { return false; }
    let sphere = sphere_of(id);
    let apart = line_origin - sphere.center;
    return dot3(apart, apart) > sphere.radius * sphere.radius;
}

⟫// By colour, the share of the light that comes straight to the origin of a shadow ray. In scenes with spheres, the ray ignores the sphere `without`.
fn straight_along(origin: vec3f⟪, without: u32⟫) -> vec3f {
    count(SHADOW);
    crossings_stored = 0u;
    crossings_beyond = 0u;
⟪    line_origin = origin;
    left_out = without;
⟫    let is_blocked = occluded(ACCEPT_COUNTS, Ray(origin, to_light(), 0.0, light_end()));
⟪    left_out = NONE;
⟫    if is_blocked { return vec3f(0.0); }
    return straight_through(⟪origin⟫);
}

// The share of the light that reaches the origin of a shadow ray.
fn light_from(origin: vec3f) -> vec3f { return in_shadow() + (1.0 - in_shadow()) * straight_along(origin⟪, NONE⟫); }
