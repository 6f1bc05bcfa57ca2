// Smooth interfaces (`effects/surface.rs`, `effects/optics.rs`, `effects/thesis.rs`).

fn mirrored(i: vec3f, n: vec3f) -> vec3f { return i - sep3(sep3(2.0 * n) * dot3(n, i)); }

fn interface_normal(surface: Surface, view: vec3f) -> vec3f {
    let usable = dot3(surface.normal, view) < 0.0 && dot3(mirrored(view, surface.normal), surface.facing) > 0.0;
    return select(surface.facing, surface.normal, usable);
}

// The reflected share of the light, and the cosine of the refracted ray.
struct Interface { reflectance: f32, cos_refracted: f32 }
fn fresnel(cosine: f32, index: f32) -> Interface {
    let cos_in = clamp(cosine, 0.0, 1.0);
    let discriminant = add(exact_product(index - 1.0, index + 1.0), exact_product(cos_in, cos_in)).h;
    if discriminant <= 0.0 { return Interface(1.0, 0.0); }
    let cos_out = min(sqrt(discriminant) / index, 1.0);
    let perpendicular = (cos_in - index * cos_out) / (cos_in + index * cos_out);
    let parallel = (index * cos_in - cos_out) / (index * cos_in + cos_out);
    var reflectance = 0.5 * (perpendicular * perpendicular + parallel * parallel);
    // Of light that is polarised across the plane of incidence, or in it.
    if params.fresnel == FRESNEL_S { reflectance = perpendicular * perpendicular; }
    if params.fresnel == FRESNEL_P { reflectance = parallel * parallel; }
    return Interface(reflectance, cos_out);
}
fn schlick(cosine: f32, index: f32) -> Interface {
    let cos_in = clamp(cosine, 0.0, 1.0);
    let discriminant = sep((index - 1.0) * (index + 1.0)) + sep(cos_in * cos_in);
    if discriminant <= 0.0 { return Interface(1.0, 0.0); }
    let cos_out = min(sqrt(discriminant) / index, 1.0);
    let root = (index - 1.0) / (index + 1.0); let zero = root * root;
    let away = 1.0 - select(cos_in, cos_out, index < 1.0); let square = away * away;
    return Interface(min(zero + (1.0 - zero) * (square * square * away), 1.0), cos_out);
}
fn interface_at(cosine: f32, ratio: f32) -> Interface {
    if params.fresnel == FRESNEL_SCHLICK { return schlick(cosine, ratio); }
    return fresnel(cosine, ratio);
}
// Whether a ray enters; if so, `refracted` is its direction.
fn refracts(interface_: Interface, i: vec3f, n: vec3f, ratio: f32, refracted: ptr<function, vec3f>) -> bool {
    if interface_.reflectance >= 1.0 { return false; }
    let along = i - sep3(n * dot3(n, i));
    *refracted = normalize_or(along / ratio - sep3(n * interface_.cos_refracted), vec3f(0.0));
    return any(*refracted != vec3f(0.0));
}

// The parts of OptiX that the report's device code uses, for thesis fidelity.
fn is_glass_mask(color: vec4f) -> bool { return color.x > 0.0 && color.y == 0.0 && color.z > 0.0 && color.w == 0.0; }
fn thesis_refracts(i: vec3f, normal: vec3f, index: f32, refracted: ptr<function, vec3f>) -> bool {
    var n = normal;
    var cosine = dot3(i, n);
    var eta = 1.0 / index;
    if cosine > 0.0 {
        n = -n;
        cosine = -cosine;
        eta = index;
    }
    let k = 1.0 - sep(sep(eta * eta) * (1.0 - sep(cosine * cosine)));
    if k < 0.0 { return false; }
    let direction = sep3(eta * i) - sep3((sep(eta * cosine) + sqrt(k)) * n);
    *refracted = direction * length_recip(direction);
    return true;
}
fn face_forward(n: vec3f, i: vec3f, reference: vec3f) -> vec3f { return n * with_sign(1.0, dot3(i, reference)); }
fn thesis_coefficient(n: vec3f, d: vec3f) -> f32 {
    let cosine = dot3(n, -d);
    return 1.0 - sep(sep(params.index * params.index) * (1.0 - sep(cosine * cosine)));
}
fn thesis_view(position: vec3f) -> vec3f {
    let direction = position - params.eye;
    return direction * length_recip(direction);
}
struct ThesisNormals { geometric: vec3f, shading: vec3f }
fn thesis_normals(hit: Hit) -> ThesisNormals {
    let corners = positions_of(hit.triangle);
    let geometric = normalize_or(cross3(corners.b - corners.a, corners.c - corners.a), vec3f(0.0));
    return ThesisNormals(geometric, normalize_or(normal_at(hit), vec3f(0.0)));
}
// The first hit farther than `t_min`. A ray that is not finite hits nothing.
fn thesis_closest(origin: vec3f, direction: vec3f, t_min: f32, hit: ptr<function, Hit>) -> bool {
    return closest(ACCEPT_ALL, Ray(origin, direction, t_min, HUGE), hit);
}
